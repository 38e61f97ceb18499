"""Closed ends: points of an end's own face lie within the tube, and say where the axis goes through it.

Scans that were fused from all sides show the ends of an object as well: square, oblique or rounded. Those points are no
points of the tube, but some of them are so near to its edge that they would bend the line towards one side. They are
left out of the fit, and so is what of the tube goes on beside them; the line runs on straight to the face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.geometry.vectors import unit
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import TubeCurve, arc_at, arc_table, reparametrised
from dlogen.types import Array, BoolArray

#: How far from an end its face may be, in radii, and the stretch behind that that tells what else is inside the tube.
_REACH, _BEHIND = 3.0, 10.0

#: A point is inside if it is nearer to the axis than the surface by so many radii and standard deviations.
_INSIDE, _SURE = 0.15, 4.0

#: Points that a face needs: so many, this share of those that are due on a disc, and this many times as many as are
#: inside the tube elsewhere.
_FEWEST, _SHARE, _TIMES = 12, 0.15, 4.0

#: A face reaches as far in as there are so many inside points as a share of the most, in bins of so many radii; and how
#: much farther in its edge is, in radii; of a face that is flat and square, less, if
#: the line does not bend at it by more than this, curvature times radius.
_STILL_FACE, _BIN, _MARGIN, _FLAT_MARGIN, _UNBENT = 0.25, 0.25, 0.5, 0.3, 0.15

#: Points nearer to the axis than this, in radii, tell where it goes through the face; and how many of them do.
_CORE, _CORE_FEWEST = 0.4, 5


@dataclass(frozen=True)
class Caps:
    """Where the faces of closed ends begin, as arc lengths on a curve, metres; infinite where an end is open.

    Attributes:
        low: points before it belong to the face of the first end, or are beside it.
        high: the same of the last end: points behind it.
    """

    low: float
    high: float

    @property
    def any(self) -> bool:
        """Whether an end is closed."""
        return bool(np.isfinite(self.low) or np.isfinite(self.high))


def find_caps(tube: Tube) -> Caps:
    """Which ends of a tube are closed, and from where on.

    Args:
        tube: fitted to its points, of which those of the faces are some.
    """
    radius = tube.radius
    arc = arc_table(tube.curve)[1]
    s = arc_at(arc, tube.x)
    inside = tube.distance < radius - max(_INSIDE * radius, _SURE * tube.sigma)
    on_tube = (np.abs(tube.residual) < max(_SURE * tube.sigma, 0.02 * radius)) & tube.on_curve
    if np.count_nonzero(on_tube) < _FEWEST:
        return Caps(-np.inf, np.inf)
    bends = radius * tube.curve.curvature(np.array([0.5]))
    near = max(1, round(_REACH * radius / tube.curve.step))
    high = _edge(s, inside, on_tube, radius, float(bends[-near - 1 :].max()) < _UNBENT)
    low = -_edge(-s, inside, on_tube, radius, float(bends[: near + 1].max()) < _UNBENT)
    return Caps(low, high)


def _edge(s: Array, inside: BoolArray, on_tube: BoolArray, radius: float, straight: bool) -> float:
    """Where the face of the upper end begins; infinite if there is none."""
    end = float(np.quantile(s[on_tube], 0.998))
    at_end = s > end - _REACH * radius
    face = s[inside & at_end]
    behind = (s > end - (_REACH + _BEHIND) * radius) & ~at_end
    stretch = min(_BEHIND * radius, max(end - _REACH * radius - float(s.min()), 0.0))
    if stretch < radius:
        return np.inf
    # A disc has the area of half a radius of the tube.
    due = 0.5 * radius * np.count_nonzero(on_tube & behind) / stretch
    elsewhere = _REACH * radius * np.count_nonzero(inside & behind) / stretch
    if len(face) < max(_FEWEST, _SHARE * due, _TIMES * elsewhere):
        return np.inf
    counts = np.bincount(((face.max() - face) / (_BIN * radius)).astype(np.intp))
    most = int(np.argmax(counts))
    thin = np.flatnonzero(counts[most:] < max(_STILL_FACE * counts[most], 1.0))
    bins = most + int(thin[0]) if len(thin) else len(counts)
    margin = _FLAT_MARGIN if straight and bins <= 2 else _MARGIN
    return float(face.max()) - (bins * _BIN + margin) * radius


def straight_beyond(curve: TubeCurve, low: float, high: float, more: tuple[float, float]) -> TubeCurve:
    """A curve between two arc lengths, and straight on for so many metres before and behind them."""
    inner = reparametrised(curve, max(4, round((high - low) / curve.step)), low, high)
    length = float(arc_table(inner)[1][-1])
    # Knots as dense as they are keep the straight part straight.
    return reparametrised(inner, max(6, round((length + sum(more)) / (0.5 * inner.step))), -more[0], length + more[1])


def through_face(points: Array, curve: TubeCurve, end: float, radius: float, last: bool) -> float | None:
    """Where a straight end of the axis goes through the face of an object: arc length from `end`, metres.

    Args:
        points: (3, M) metres.
        curve: whose parameter `end` is where its straight part begins.
        end: that parameter.
        radius: of the tube, metres.
        last: whether it is the last end.

    Returns:
        None where too few points show it.
    """
    place, tangent = curve(np.array([end]))[0], unit(curve(np.array([end]), 1)[0])
    offset = points.T - place
    along = offset @ (tangent if last else -tangent)
    away = np.linalg.norm(offset - (offset @ tangent)[:, None] * tangent, axis=1)
    core = along[(away < _CORE * radius) & (along > -radius) & (along < (2.0 * _REACH) * radius)]
    return float(np.median(core)) if len(core) >= _CORE_FEWEST else None


def on_faces(s: Array, residual: Array, on_tube: BoolArray, closed: tuple[bool, bool], reach: float) -> BoolArray:
    """Which points belong to the faces of closed ends: those near them and inside the tube.

    Args:
        s: (M,) foot coordinates in [0, 1].
        residual: (M,) distances to the surface, positive outside, metres.
        on_tube: (M,) which points belong to the tube.
        closed: which of the two ends are closed.
        reach: the radius over the length.
    """
    near = np.zeros(len(s), dtype=bool)
    if closed[0]:
        near |= s < _REACH * reach
    if closed[1]:
        near |= s > 1.0 - _REACH * reach
    return near & (residual < 0.0) & ~on_tube
