"""A picture of a motion, with matplotlib (extra `plots`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dlogen.geometry.vectors import dots
from dlogen.io.plots import BLUE, GREEN, ORANGE, RED, canvas, draw_allowed, label_views, legend, png, principal_axes
from dlogen.sequence.trajectory import Motion
from dlogen.types.texts import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Chains that are drawn; more would hide one another.
_DRAWN = 60

#: Colour and mark of a reason to exclude a capture.
_REASONS = {
    "failed": (RED, "X"),
    "doubtful": (ORANGE, "s"),
    "length": (BLUE, "v"),
    "radius": (BLUE, "^"),
    "noise": (GREEN, "D"),
    "motion": ("black", "P"),
}


def motion_picture(motion: Motion) -> bytes:
    """A PNG: chains coloured by time from two sides, the error of each capture, and the bend of each joint over time.

    Args:
        motion: of a recording, or poses without an order in time, which are drawn in the order given.

    Raises:
        UsageError: matplotlib is not installed.
    """
    figure = canvas(11.0, 9.0)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.6, 1.0])
    _draw_chains(figure.add_subplot(grid[0, :]), motion)
    _draw_errors(figure.add_subplot(grid[1, 0]), motion)
    _draw_bends(figure.add_subplot(grid[1, 1]), motion)
    model = motion.model
    count, links = len(motion.states), len(model.links)
    what = counted(count, "frame" if motion.times is not None else "cloud")
    figure.suptitle(
        f"{what}, {motion.states.count('good')} good: {model.sizes.length.value:.3f} m, radius "
        f"{1e3 * model.sizes.radius.value:.2f} mm, {counted(links, 'segment')} of "
        f"{1e3 * model.links[0]:.1f} mm",
        fontsize=13,
    )
    return png(figure)


def _clock(motion: Motion) -> tuple[np.ndarray, str]:
    """Where captures are on the axis of time, and its name."""
    if motion.times is None:
        return np.arange(len(motion.states), dtype=float), "cloud"
    start = motion.times[0]
    # Seconds since 1970 would fill the axis with digits.
    return motion.times - (
        start if start > 1e6 else 0.0
    ), "time [s]" if start <= 1e6 else f"time since {start:.0f} s [s]"


def _draw_chains(axes: Axes, motion: Motion) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    clock, name = _clock(motion)
    posed = np.flatnonzero(motion.posed)
    joints = motion.model.joints[posed]
    centre, main = principal_axes(joints.reshape(-1, 3))
    seen = (joints - centre) @ main.T
    unit, drop = label_views(axes, seen)
    colours = ScalarMappable(Normalize(clock[0], clock[-1]), colormaps["viridis"])
    good = motion.model.good[posed]
    shown = np.unique(np.linspace(0, len(posed) - 1, min(_DRAWN, len(posed))).round().astype(int))
    for k in shown:
        colour, dashes = (colours.to_rgba(clock[posed[k]]), "-") if good[k] else (RED, "--")
        for column, shift in ((1, 0.0), (2, drop)):
            axes.plot(unit * seen[k, :, 0], unit * (seen[k, :, column] + shift), dashes, color=colour, linewidth=1.2)
            # The first end.
            axes.plot(unit * seen[k, :1, 0], unit * (seen[k, :1, column] + shift), "o", color=colour, markersize=3.5)
    if not good[shown].all():
        axes.plot([], [], color=RED, linestyle="--", label="set aside: from its neighbours")
    axes.plot([], [], "o", color="black", markersize=3.5, label="base")
    legend(axes, ncols=2)
    axes.figure.colorbar(colours, ax=axes, label=name, pad=0.01)


def _draw_errors(axes: Axes, motion: Motion) -> None:
    clock, name = _clock(motion)
    model = motion.model
    axes.plot(clock, 1e3 * model.deviation, ".-", color=BLUE, linewidth=1.0, markersize=4, label="deviation")
    draw_allowed(axes, model.e_max, float(np.nanmax(model.deviation)))
    for code, (colour, mark) in _REASONS.items():
        at = [
            clock[k] for k, exclusion in enumerate(model.exclusions) if exclusion is not None and exclusion.code == code
        ]
        if at:
            axes.plot(at, np.zeros(len(at)), mark, color=colour, markersize=7, label=code, clip_on=False, zorder=3)
    axes.set_xlabel(name)
    legend(axes, ncols=4)


def _draw_bends(axes: Axes, motion: Motion) -> None:
    from matplotlib.ticker import MaxNLocator

    clock, name = _clock(motion)
    model = motion.model
    edges = np.diff(model.joints, axis=1) / model.links[:, None]
    bends = np.degrees(np.arccos(np.clip(dots(edges[:, 1:], edges[:, :-1]), -1.0, 1.0)))
    if bends.shape[1] == 0:
        axes.text(0.5, 0.5, "one segment: no joints", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    middles = 0.5 * (clock[1:] + clock[:-1])
    edge = 0.5 * (clock[1] - clock[0]) if len(clock) > 1 else 0.5
    x = np.concatenate([[clock[0] - edge], middles, [clock[-1] + edge]])
    image = axes.pcolormesh(x, np.arange(bends.shape[1] + 1) + 0.5, bends.T, cmap="magma", rasterized=True)
    axes.set_xlabel(name)
    axes.set_ylabel("joint")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if motion.times is None:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.figure.colorbar(image, ax=axes, label="bend [degrees]", pad=0.02)
