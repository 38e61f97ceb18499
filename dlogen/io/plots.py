"""Pictures of a fit and of the evaluation, with matplotlib (extra `plots`).

Figures are drawn without pyplot and without a display; the same input gives the same bytes.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from dlogen.errors import UsageError
from dlogen.geometry.curvature import curvature
from dlogen.types import Array, FitData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas


#: Points of the cloud that are drawn; more would only make the file larger.
_DRAWN = 4000

# Okabe and Ito's colours, which are told apart without full colour vision.
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#8c8c8c"


def fit_picture(result: FitData) -> bytes:
    """A PNG of a fit: cloud, skeleton line and chain from two sides, curvature, and the error (the paper's Fig. 9).

    Args:
        result: of a fit.

    Raises:
        UsageError: matplotlib is not installed.
    """
    figure = canvas(11.0, 8.0)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.5, 1.0])
    shape = figure.add_subplot(grid[0, :])
    _draw_views(shape, result)
    _draw_curvature(figure.add_subplot(grid[1, 0]), result)
    _draw_error(figure.add_subplot(grid[1, 1]), result)
    chain = result.chain
    figure.suptitle(
        f"{result.name}: {result.skeleton.length:.3f} m, radius {1e3 * chain.radius:.2f} mm, "
        f"{len(chain.lengths)} segments of {1e3 * result.joints.segment_length:.1f} mm, {result.quality.verdict}",
        fontsize=13,
    )
    return png(figure)


def _draw_views(axes: Axes, result: FitData) -> None:
    """Two perpendicular views side by side in one frame: the widest one and the one from its side."""
    cloud = result.intermediates[0 if result.profile == "paper" else 1].points
    # Who looks for what the chain misses has to see it; what is far away would only make the rest small.
    left_out = np.concatenate([item.points for item in result.intermediates if item.name == "off_tube"] or [cloud[:0]])
    room = 0.5 * np.ptp(cloud, axis=0).max()
    left_out = left_out[((left_out > cloud.min(axis=0) - room) & (left_out < cloud.max(axis=0) + room)).all(axis=1)]
    centre, main = principal_axes(result.skeleton_points)
    seen = [
        (part - centre) @ main.T
        for part in (
            cloud[:: max(1, len(cloud) // _DRAWN)],
            left_out[:: max(1, len(left_out) // _DRAWN)],
            result.skeleton_points,
            result.chain.joints,
        )
    ]
    drawn = np.concatenate(seen[:2])
    unit, drop = label_views(axes, drawn)
    for column, shift in ((1, 0.0), (2, drop)):
        first = column == 1
        points, others, line, joints = (np.stack([part[:, 0], part[:, column] + shift]) * unit for part in seen)
        dots: dict[str, Any] = {"markersize": 1.5, "alpha": 0.6, "rasterized": True}
        axes.plot(*points, ".", color=GREY, label="points" if first else None, **dots)
        if others.size:
            axes.plot(*others, ".", color=ORANGE, label="points left out" if first else None, **dots)
        axes.plot(*line, "-", color=BLUE, linewidth=1.5, label="skeleton line" if first else None)
        axes.plot(*joints, "o-", color=RED, linewidth=1.0, markersize=3.5, label="chain" if first else None)
    for finding in result.quality.findings:
        if finding.position is not None:
            x, y, _ = (np.asarray(finding.position) - centre) @ main.T * unit
            axes.annotate(
                finding.code,
                (x, y),
                xytext=(0, 18),
                textcoords="offset points",
                ha="center",
                fontsize=9,
                arrowprops={"arrowstyle": "->", "color": "black"},
            )
    legend(axes, ncols=4, markerscale=2)


def _draw_curvature(axes: Axes, result: FitData) -> None:
    s = np.linspace(0.0, 1.0, 1000)
    axes.plot(s, curvature(result.skeleton, s), color=BLUE, linewidth=1.3)
    axes.plot(result.chain.s, np.zeros(len(result.chain.s)), "|", color=RED, markersize=8, label="joints")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("s")
    axes.set_ylabel("curvature of the skeleton line [1/m]")
    legend(axes)
    axes.grid(alpha=0.3)


def _draw_error(axes: Axes, result: FitData) -> None:
    axes.plot(result.mdtw.s, 1e3 * result.mdtw.error, color=BLUE, linewidth=1.0, label="MDTW error")
    draw_allowed(axes, result.e_max, result.mdtw.max)
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("s")
    legend(axes, ncols=2)


def principal_axes(points: Array) -> tuple[Array, Array]:
    """Mean and principal directions of points, the one of largest extent first: (M, 3) -> (3,), (3, 3) by rows.

    A straight line has no second direction of its own; any will come out.
    """
    centre = points.mean(axis=0)
    return centre, np.linalg.svd(points - centre, full_matrices=False)[2]


def label_views(axes: Axes, drawn: Array) -> tuple[float, float]:
    """Set up axes for two views in one frame: from the front, and below it, a tenth of the width apart, from the side.

    Args:
        axes: to be labelled.
        drawn: (..., 3) what will be seen, along `principal_axes`, metres.

    Returns:
        Units a metre, and what the second view is moved by, metres.
    """
    x, y, z = np.moveaxis(drawn, -1, 0)
    width = np.ptp(x)
    unit, name = (1e3, "mm") if width < 1.0 else (1.0, "m")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"along the longest extent [{name}]; above from the front, below from the side")
    axes.set_ylabel(f"[{name}]")
    return unit, float(y.min() - 0.1 * width - z.max())


def draw_allowed(axes: Axes, e_max: float, largest: float) -> None:
    """The line of e_max in a plot of deviations, and room for the largest of them; metres."""
    axes.axhline(1e3 * e_max, color=RED, linestyle="--", linewidth=1.2, label="e_max")
    axes.set_ylim(0.0, 1.25e3 * max(e_max, largest))
    axes.set_ylabel("skeleton line to chain [mm]")
    axes.grid(alpha=0.3)


def legend(axes: Axes, **more: Any) -> None:
    """A legend above the axes, at their right end."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=9, frameon=False, **more)


def canvas(width: float, height: float) -> Canvas:
    """An empty figure of that size in inches.

    Raises:
        UsageError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure as Canvas
    except ImportError:
        raise UsageError("pictures need matplotlib", "pip install 'dlogen[plots]'") from None
    figure = Canvas(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def png(figure: Canvas) -> bytes:
    """The picture: the same bytes for the same figure."""
    out = io.BytesIO()
    # Without the version of matplotlib the bytes depend on the picture alone.
    figure.savefig(out, format="png", dpi=100, metadata={"Software": None})
    return out.getvalue()
