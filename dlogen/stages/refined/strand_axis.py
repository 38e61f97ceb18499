"""From the fitted strip to the object: its radius from the width, and the axis behind the surface that was seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dlogen.geometry.basis import CubicBSpline
from dlogen.geometry.vectors import column_dots, unit
from dlogen.stages.refined.ends import find_ends, find_gaps
from dlogen.stages.refined.output_curve import output_curve, sharpest_bend
from dlogen.stages.refined.strand import Strand, components
from dlogen.stages.refined.tube_curve import SAMPLES, TubeCurve, arc_at, arc_table, foot_points, through
from dlogen.stages.refined.uncertainty import PLACES, line_uncertainty
from dlogen.stages.view import View
from dlogen.types import Array, BoolArray, Skeleton, Uncertainty

#: The axis is behind the mean depth of the seen half of a tube by this many radii: the mean of sqrt(1 - w^2) over the
#: width, which a camera's pixels cover evenly.
_BEHIND = np.pi / 4.0

#: The edges of the strip: this quantile of the distances across the view, and where it is for pixels that cover the
#: width evenly and for points that cover the circumference evenly, on average.
_EDGE, _EDGE_AT = 0.95, 0.97

#: Points farther off than so many half widths are of something else.
_WIDEST = 2.5

#: Length of the stretches whose width is measured, in half widths, and the points that each needs.
_STRETCH, _FEWEST = 4.0, 12

#: A mask is off by a pixel at either edge; the rest of a width is uncertain by this share.
_PIXELS, _SHARE = 0.6, 0.04

#: A strip whose half width is less than so many pixels is a thread.
_PIXELS_WIDE = 2.5

#: A radius that is known worse than this, relative, counts as unknown.
KNOWN = 0.15

#: The ends of a strip are known to this share of its half width.
_END = 0.3


@dataclass(frozen=True, eq=False)
class StrandFit:
    """What a strip says of its object.

    Attributes:
        skeleton: the axis, from end to end.
        radius: metres.
        radius_std: its standard deviation, metres; 0 for a given one.
        half_width: of the strip, metres.
        widths: (P, 2) s and half width of stretches along it.
        inliers: (M,) which points belong to the strip.
        residuals: (M,) distance of the points from the surface along the view, positive towards the camera, metres.
        s: (M,) foot coordinates in [0, 1].
        noise: standard deviation along the view, metres.
        shared: how many points share their noise.
        uncertainty: of the axis along it.
        gaps: (s0, s1) of stretches without points.
        max_curvature, max_curvature_s: of the sharpest bend, 1/m.
        regime: "strand", or "thread" where not even the width shows.
    """

    skeleton: Skeleton
    radius: float
    radius_std: float
    half_width: float
    widths: Array
    inliers: BoolArray
    residuals: Array
    s: Array
    noise: float
    shared: float
    uncertainty: Uncertainty
    gaps: tuple[tuple[float, float], ...]
    max_curvature: float
    max_curvature_s: float
    regime: str

    @property
    def radius_known(self) -> bool:
        """Whether the width tells the radius."""
        return self.radius_std < KNOWN * self.radius


def object_of(
    strand: Strand, points: Array, view: View, radius: float | None, origin: Array, *, side: bool, around: bool = False
) -> StrandFit:
    """The object that a strip is seen of.

    Args:
        strand: the strip.
        points: (3, M) that it was fitted to, metres.
        view: along which they are seen.
        radius: the given one, metres.
        origin: (3,) of the points, metres.
        side: whether it is known from which side the strip is seen; if not, the line stays in its surface.
        around: the points are noise all around the object, so that the line is the axis.
    """
    grid, arc, _ = arc_table(strand.curve)
    s = arc_at(arc, strand.x)
    inlier = (strand.deviation < 1.0) & strand.on_curve
    # Stretches that are wider than the rest are to show.
    wide = strand.on_curve & (np.abs(strand.depth) < 3.0 * strand.sigma[0])
    wide &= np.abs(strand.across) < _WIDEST * strand.half_width
    half_width, widths, spread = _half_width(s[wide], strand.across[wide], strand.half_width)
    pixel = float(np.sqrt(2.0 * half_width * strand.curve.length / max(int(inlier.sum()), 1)))
    if radius is None:
        used, radius_std = half_width, float(np.hypot(np.hypot(_PIXELS * pixel, _SHARE * half_width), spread))
    else:
        used, radius_std = radius, 0.0
    behind = _BEHIND * used if side and not around else 0.0
    along = strand.sigma[0]
    first, last = find_ends(s[inlier], 3.0 * strand.deviation[strand.on_curve], _END * half_width)
    axis, scale = _behind(strand.curve, view, behind)
    start, end = (float(np.interp(place, arc, scale)) for place in (first.position, last.position))
    fitted = output_curve(axis, start, end, used)
    length = float(arc_table(fitted)[1][-1])
    skeleton = Skeleton(CubicBSpline(fitted.intervals + 3), fitted.coefficients, origin, length)
    x, k, t, offset = foot_points(axis, points, strand.x, 2)
    depth, across, _, _ = components(axis, k, t, offset, view)
    seen = np.sqrt(np.maximum(used**2 - across**2, 0.0)) if side else np.full(len(x), 0.0)
    residual = -(depth + seen)
    if around:
        away = np.hypot(depth, across)
        residual = away - np.median(away[inlier])
    place = arc_at(arc_table(axis)[1], x)
    kappa, s_kappa = sharpest_bend(fitted)
    known = _uncertainty(strand, np.interp(np.linspace(first.position, last.position, PLACES), arc, grid), radius_std)
    if not around:
        # How far behind its surface the axis is depends on the radius, and on how its points cover the width.
        behind_std = 0.15 * used + _BEHIND * radius_std if side else used
        known = replace(known, position=np.hypot(known.position, behind_std))
    return StrandFit(
        skeleton=skeleton,
        radius=used,
        radius_std=radius_std,
        half_width=half_width,
        widths=widths,
        inliers=inlier & (s > first.position - 0.5 * half_width) & (s < last.position + 0.5 * half_width),
        residuals=np.where(np.abs(across) < 2.0 * half_width, residual, np.hypot(depth, across) - used),
        s=np.clip((place - start) / (end - start), 0.0, 1.0),
        noise=along,
        shared=strand.inflation[0],
        uncertainty=known,
        gaps=find_gaps(s[inlier], first.position, last.position, half_width),
        max_curvature=kappa,
        max_curvature_s=s_kappa,
        regime="thread" if around or half_width < _PIXELS_WIDE * pixel else "strand",
    )


def _half_width(s: Array, across: Array, guess: float) -> tuple[float, Array, float]:
    """Half the width of the strip, that of its stretches (P, 2), and the standard deviation of the former."""
    stretch = (s / (_STRETCH * guess)).astype(np.intp)
    order = np.argsort(stretch, kind="stable")
    stretch, across = stretch[order], across[order]
    starts = np.flatnonzero(np.append(True, np.diff(stretch) > 0))
    rows = []
    for number, part in zip(stretch[starts], np.split(across, starts[1:]), strict=True):
        if len(part) >= _FEWEST:
            rows.append(
                (
                    (number + 0.5) * _STRETCH * guess,
                    float(np.quantile(np.abs(part - np.median(part)), _EDGE)) / _EDGE_AT,
                )
            )
    widths = np.array(rows).reshape(-1, 2)
    if len(widths) == 0:
        return guess, widths, guess
    usual = float(np.median(widths[:, 1]))
    spread = 1.4826 * float(np.median(np.abs(widths[:, 1] - usual))) / np.sqrt(len(widths))
    return usual, widths, spread


def _behind(curve: TubeCurve, view: View, behind: float) -> tuple[TubeCurve, Array]:
    """The curve moved along the view, and the arc lengths on it of the places of the table of the old one."""
    samples = np.linspace(0.0, curve.intervals, curve.intervals * SAMPLES + 1)
    place, tangent = curve(samples).T, unit(curve(samples, 1)).T
    rays = view(place)
    ahead = rays - column_dots(rays, tangent) * tangent
    moved = through(place + behind * unit(ahead.T).T, curve.intervals, curve.step)
    return moved, arc_table(moved)[1]


def _uncertainty(strand: Strand, x: Array, radius_std: float) -> Uncertainty:
    """Of the line through the strip, at places of it."""
    if strand.solution is None:
        nothing = np.zeros(len(x))
        return Uncertainty(np.linspace(0.0, 1.0, len(x)), nothing, nothing, radius_std)
    return line_uncertainty(strand.curve, strand.solution, 1.0, x, radius_std)
