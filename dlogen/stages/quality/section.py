"""The cross-section of an object as all points along its line show it together, and the ellipse through it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import unit
from dlogen.types import Array, IntArray, Skeleton

#: Points that show the section, at most; frames along the line; radii of line whose points are turned together, where
#: one side was seen, and pieces of the line that are, where all sides were; share of the line left out at either end.
_LOOKED_AT, _FRAMES, _TOGETHER, _PIECES, _ENDS = 20_000, 400, 3.0, 8, 0.02

#: Distance of the centroid of the directions from the axis to the points beyond which one side was seen.
_ONE_SIDE = 0.25

#: How often, and over how many neighbours in turn, directions are averaged, as long as they keep this share of length.
_POOLINGS, _POOLED, _TURNING = 6, 4, 0.97

#: Points farther from the surface than this, in radii, are no part of the section.
_NEAR = 0.6

#: Share of the points beyond either edge of the arc that was seen: strays.
_EDGE = 0.01

#: Sectors around the axis whose points are looked at together, the points that each needs, and how many are needed.
_SECTORS, _PER_SECTOR, _FEWEST_SECTORS = 48, 30, 6

#: Fewest points of a section; most steps of the fit, the longest of them, and the one that ends it; Tukey's constant.
_FEWEST, _STEPS, _LONGEST, _STILL, _TUKEY = 200, 40, 0.3, 1e-4, 6.0


@dataclass(frozen=True, eq=False)
class Section:
    """Points of all cross-sections, turned so that what was seen of each is above the axis.

    Attributes:
        index: (K,) which points of the cloud these are.
        side, up: (K,) coordinates across the line, metres.
        half_angle: half of the arc around the axis in which points are, radians; pi for a whole circle.
        whole: whether all sides were seen.
    """

    index: IntArray
    side: Array
    up: Array
    half_angle: float
    whole: bool

    def within(self, angle: float) -> Section:
        """The part of it no farther around the axis than this from the middle of what was seen, radians."""
        near = np.abs(np.arctan2(self.side, self.up)) <= angle
        return replace(self, index=self.index[near], side=self.side[near], up=self.up[near])


@dataclass(frozen=True)
class Ellipse:
    """An ellipse with its axes along `side` and `up`.

    Attributes:
        width, height: the whole axes, metres.
        side, up: its centre, metres.
        ratio_std: standard deviation of height over width, relative, for independent points.
        noise: standard deviation of the points about it, metres.
    """

    width: float
    height: float
    side: float
    up: float
    ratio_std: float
    noise: float


@dataclass(frozen=True)
class Misfit:
    """How far the points of a section are from a circle, sector by sector around the axis.

    Attributes:
        shape: root mean square of what the medians of the sectors are off the circle nearest to them, metres.
        chance: what it would be by chance, for independent points, metres.
        noise: standard deviation of the points of a sector about their median, metres.
    """

    shape: float
    chance: float
    noise: float


def pooled_section(points: Array, s: Array, residual: Array, line: Skeleton, radius: float) -> Section | None:
    """The section of a line's points; None if there are too few.

    Args:
        points: (M, 3) metres.
        s: (M,) foot coordinate of every point.
        residual: (M,) its distance to the tube's surface, positive outside, metres.
        line: the skeleton line.
        radius: of the tube, metres.
    """
    near = np.flatnonzero((np.abs(residual) < _NEAR * radius) & (s > _ENDS) & (s < 1.0 - _ENDS))
    if len(near) < _FEWEST:
        return None
    index = near[spatial_sample(points[near], _LOOKED_AT)]
    foot = s[index]
    frames = minimal_rotation_frames(unit(line((np.arange(_FRAMES) + 0.5) / _FRAMES, 1)))
    across = frames[np.minimum((foot * _FRAMES).astype(np.intp), _FRAMES - 1), :, 1:]
    y, z = np.einsum("ij,ijk->ki", points[index] - line(foot), across)
    distance = np.maximum(np.hypot(y, z), 1e-12 * radius)
    count = max(round(line.length / (_TOGETHER * radius)), _PIECES)
    turn, one_side = _seen_from(
        y / distance, z / distance, np.minimum((foot * count).astype(np.intp), count - 1), count
    )
    if not one_side:
        pieces = np.minimum((foot * _PIECES).astype(np.intp), _PIECES - 1)
        turn = _flattest(np.arctan2(z, y), distance, pieces)
    side, up = z * np.cos(turn) - y * np.sin(turn), y * np.cos(turn) + z * np.sin(turn)
    low, high = np.quantile(np.arctan2(side, up), (_EDGE, 1.0 - _EDGE))
    half_angle = float(0.5 * (high - low)) / (1.0 - 2.0 * _EDGE) if one_side else np.pi
    return Section(index, side, up, min(half_angle, np.pi), not one_side)


def _seen_from(y: Array, z: Array, group: IntArray, count: int) -> tuple[Array, bool]:
    """(K,) angle of the middle of what was seen around each point, from directions; and whether it is one side.

    A few points tell the middle to a few degrees only, and neighbours tell more as long as what was seen does not turn
    around the line.
    """
    weight = np.bincount(group, minlength=count).astype(float)
    sums = np.stack([weight, np.bincount(group, y, count), np.bincount(group, z, count)])
    length = float(np.hypot(*sums[1:]).sum())
    one_side = length > _ONE_SIDE * len(group)
    for _ in range(_POOLINGS):
        wider = sums
        for _ in range(_POOLED):
            padded = np.pad(wider, ((0, 0), (1, 1)), mode="edge")
            wider = 0.25 * (padded[:, :-2] + 2.0 * padded[:, 1:-1] + padded[:, 2:])
        shorter = float(np.sum(weight * np.hypot(*wider[1:]) / np.maximum(wider[0], 1e-300)))
        if shorter < _TURNING * length:
            break
        sums = wider
    return np.arctan2(sums[2], sums[1])[group], one_side


def _flattest(angle: Array, distance: Array, group: IntArray) -> Array:
    """(K,) angle around the axis at which the section around each point is flattest, from its second harmonic."""
    turn = np.zeros(_PIECES)
    for piece in range(_PIECES):
        own = group == piece
        if np.count_nonzero(own) < _FEWEST // _PIECES:
            continue
        theta = angle[own]
        harmonics = np.stack([np.ones_like(theta), *(f(k * theta) for k in (1, 2) for f in (np.cos, np.sin))], axis=1)
        found = np.linalg.lstsq(harmonics, distance[own], rcond=None)[0]
        turn[piece] = 0.5 * np.arctan2(-found[4], -found[3])
    return turn[group]


def ellipse_through(section: Section) -> Ellipse | None:
    """The ellipse nearest to the points of a section, robustly; None if they show none.

    Gauss-Newton on the distances. The derivatives are taken at the foot points on the ellipse: at the points themselves
    they would share their noise, which matters on arcs.

    Args:
        section: the points, around an axis at the origin.
    """
    x, y = section.side, section.up
    if len(x) < _FEWEST:
        return None
    size = float(np.median(np.hypot(x, y)))
    x, y = x / size, y / size
    a, b, x0, y0 = 1.0, 1.0, 0.0, 0.0
    for _ in range(_STEPS):
        foot_x, foot_y = x - x0, y - y0
        for _ in range(2):
            u, v = foot_x / a**2, foot_y / b**2
            excess = 0.5 * (foot_x * u + foot_y * v - 1.0) / np.maximum(u * u + v * v, 1e-12)
            foot_x, foot_y = foot_x - excess * u, foot_y - excess * v
        u, v = foot_x / a**2, foot_y / b**2
        length = np.maximum(np.hypot(u, v), 1e-12)
        u, v = u / length, v / length
        residual = (x - x0 - foot_x) * u + (y - y0 - foot_y) * v
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
        weight = np.clip(1.0 - (residual / (_TUKEY * scale)) ** 2, 0.0, 1.0) ** 2
        slopes = np.stack([u * foot_x, v * foot_y, u, v], axis=1)
        normal = slopes.T @ (weight[:, None] * slopes) + 1e-9 * len(x) * np.eye(4)
        step = np.linalg.solve(normal, slopes.T @ (weight * residual))
        longest = float(np.abs(step).max())
        step *= min(1.0, _LONGEST / max(longest, 1e-300))
        a, b, x0, y0 = a * np.exp(step[0]), b * np.exp(step[1]), x0 + step[2], y0 + step[3]
        if longest < _STILL:
            break
    else:
        return None
    ratio = np.array([-1.0, 1.0, 0.0, 0.0])
    spread = scale * float(np.sqrt(ratio @ np.linalg.solve(normal, ratio)))
    return Ellipse(2.0 * a * size, 2.0 * b * size, x0 * size, y0 * size, spread, scale * size)


def misfit(section: Section) -> Misfit | None:
    """How far a section is from a circle, whose centre and radius are free; None if there are too few points."""
    distance = np.hypot(section.side, section.up)
    sector = ((np.arctan2(section.side, section.up) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.intp) % _SECTORS
    counts = np.bincount(sector, minlength=_SECTORS)
    full = np.flatnonzero(counts >= _PER_SECTOR)
    if len(full) < _FEWEST_SECTORS:
        return None
    parts = [distance[sector == each] for each in full]
    medians = np.array([np.median(part) for part in parts])
    off = np.concatenate([np.abs(part - middle) for part, middle in zip(parts, medians, strict=True)])
    noise = 1.4826 * float(np.median(off))
    angle = (full + 0.5) * (2.0 * np.pi / _SECTORS)
    weight = np.sqrt(counts[full] / counts[full].sum())
    circle = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1) * weight[:, None]
    rest = medians * weight
    rest = rest - circle @ np.linalg.lstsq(circle, rest, rcond=None)[0]
    # A median of n is uncertain by 1.25 standard deviations over the root of n.
    chance = 1.25 * noise * float(np.sqrt((len(full) - 3) / counts[full].sum()))
    return Misfit(float(np.sqrt(rest @ rest)), chance, noise)
