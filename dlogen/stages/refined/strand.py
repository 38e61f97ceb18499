"""The line of a strand: an object whose depth is as noisy as it is thick, so that only its width shows.

Seen from one side by a depth camera, a rope is a strip. Across the view its edges tell where the axis is and how wide
it is; along the view its points scatter by as much as the surface is curved, and neighbours share what they are off
by, since a stereo camera matches windows. So the axis is fitted in two parts: across the view to the middle of the
strip, along the view to the mean depth of the strip, and that is brought under the surface by what the radius says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import column_dots
from dlogen.stages.refined.linearisation import LOG_LAMBDA, Linearisation, Solution
from dlogen.stages.refined.normal_equations import NormalEquations, normal_equations
from dlogen.stages.refined.shared_noise import inflation
from dlogen.stages.refined.support import on_support
from dlogen.stages.refined.tube import robust_scale, tukey
from dlogen.stages.refined.tube_curve import (
    SAMPLES,
    TubeCurve,
    arc_at,
    arc_table,
    evened,
    foot_points,
    from_polyline,
    nearest,
    through,
)
from dlogen.stages.view import View
from dlogen.types import Array, BoolArray, IntArray

#: Knot spacing over half the width, at first and in the end; most intervals.
_COARSE, _FINE, _MOST = 8.0, 3.0, 20_000

#: Rounds at first, which follow the ends, and rounds of the fit proper.
_ROUGH_ROUNDS, _ROUNDS = 40, 5

#: Half widths that the ends are followed by at a time.
_ON = 3.0

#: A gap at an end of so many half widths is a strand that crosses there.
_OVER = 5.0

#: Points of the rounds at first, and of those of the fit proper; the last one has all.
_FEW, _SOME = 3000, 8000

#: Distance of the knots of a line that follows the shape of the object but not the noise, in half widths.
_SHAPE = 20.0

#: Points are near the strand up to so many half widths across the view.
_NEAR = 2.5


@dataclass(frozen=True, eq=False)
class Strand:
    """A strand: the line through the middle of what is seen of it.

    Attributes:
        curve: through the mean of the points; the axis is behind it.
        half_width: of the strip, metres.
        x: (M,) foot parameters.
        depth, across: (M,) offsets from the curve along the view and across it, metres.
        sigma: standard deviations of these two, metres.
        inflation: how many points are worth one independent observation, of either.
        smoothing: see `Solution`.
        solution: the last step.
    """

    curve: TubeCurve
    half_width: float
    x: Array
    depth: Array
    across: Array
    sigma: tuple[float, float]
    inflation: tuple[float, float]
    smoothing: float | None = None
    solution: Solution | None = None

    @property
    def on_curve(self) -> BoolArray:
        """(M,) whether the foot point is not just the end of the curve."""
        return (self.x > 0.0) & (self.x < self.curve.intervals)

    @property
    def deviation(self) -> Array:
        """(M,) from the line, in standard deviations; 1 at the edges."""
        return np.hypot(self.depth / (3.0 * self.sigma[0]), self.across / (1.2 * self.half_width))


def fit_strand(points: Array, view: View, backbone: Array, half_width: float) -> Strand:
    """Fit the line.

    Args:
        points: (3, M) metres.
        view: along which they are seen.
        backbone: (K, 3) vertices in order, metres.
        half_width: of the strip, roughly, metres.
    """
    everything = points
    some = everything if points.shape[1] <= _SOME else _some(points, _SOME)
    # Of the whole, since a sample of a sample is itself.
    points = some if points.shape[1] <= _FEW else _some(points, _FEW)
    nothing = np.zeros(points.shape[1])
    curve = from_polyline(backbone, _COARSE * half_width, half_width, 1.0)
    strand = Strand(curve, half_width, nothing, nothing, nothing, (half_width, half_width), (1.0, 1.0))
    for step in range(_ROUGH_ROUNDS):
        # Beyond a strand that it crosses, an end goes on: it is followed far enough to find the points there.
        strand = _step(points, view, strand, search=True, least=-3.0)
        grown = _supported(strand, _ON, _COARSE * half_width)
        if step >= 1 and grown.curve.length < strand.curve.length + 0.5 * half_width:
            break
        strand = grown
    if some is not points:
        points = some
        strand = _step(points, view, strand, search=True, least=-3.0)
    shared = _shared_depth(points, view, strand)
    strand = replace(_supported(strand, 0.7, _FINE * half_width), smoothing=None)
    for _ in range(_ROUNDS):
        strand = _step(points, view, _worth(strand, shared))
    if some is everything:
        return strand
    # The more points there are, the more of them share their noise.
    times = everything.shape[1] / points.shape[1]
    depth, across = (1.0 + (worth - 1.0) * times for worth in strand.inflation)
    return _step(everything, view, replace(strand, inflation=(depth, across)), search=True)


def _some(points: Array, count: int) -> Array:
    """About so many of the points: (3, M)."""
    return points[:, spatial_sample(points.T, count)]


def _worth(strand: Strand, shared: float) -> Strand:
    """The strand with how many of its points are worth one, along the view and across it.

    Args:
        strand: as it is.
        shared: variance of sums of depths over the number of their points, square metres.
    """
    if strand.solution is None or strand.smoothing is None:
        across = 1.0
    else:
        s = arc_at(arc_table(strand.curve)[1], strand.x)
        good = (strand.deviation < 1.0) & strand.on_curve
        across = inflation(s[good], strand.across[good], strand.half_width)
    return replace(strand, inflation=(max(shared / strand.sigma[0] ** 2, 1.0), across))


def _shared_depth(points: Array, view: View, strand: Strand) -> float:
    """Variance of sums of depths over the number of their points, about a line with few knots, square metres.

    A line that is free to follow what neighbours share would hide it, and one that is told what they share could be
    smoothed on and on: so the line that tells it has knots in fixed places.
    """
    curve = strand.curve
    few = max(6, round(curve.length / (_SHAPE * strand.half_width)))
    places = np.linspace(0.0, curve.intervals, few * SAMPLES + 1)
    coarse = through(curve(places).T, few, curve.length / few)
    x, k, t, offset = foot_points(curve, points, strand.x)
    at = x * (few / curve.intervals)
    depth, across, ahead, _ = components(curve, k, t, offset, view)
    depth = depth + column_dots(curve(x).T - coarse(at).T, ahead)
    good = (np.abs(across) < 1.2 * strand.half_width) & (x > 0.0) & (x < curve.intervals)
    depth = depth - np.median(depth[good])
    good &= np.abs(depth) < 4.0 * robust_scale(depth[good])
    return (
        inflation(arc_at(arc_table(curve)[1], x)[good], depth[good], strand.half_width) * robust_scale(depth[good]) ** 2
    )


def _step(points: Array, view: View, strand: Strand, *, search: bool = False, least: float = LOG_LAMBDA[0]) -> Strand:
    curve, half = evened(strand.curve), strand.half_width
    x = nearest(curve, points, 0.5 * half) if search else strand.x
    x, k, t, offset = foot_points(curve, points, x, 2 if search else 1)
    depth, across, ahead, sideways = components(curve, k, t, offset, view)
    on = (x > 0.0) & (x < curve.intervals)
    near = on & (np.abs(across) < _NEAR * half) & (np.abs(depth) < max(3.0 * half, 4.0 * strand.sigma[0]))
    if np.count_nonzero(near) < 10:
        raise FitError("hardly any points near the line that the fit started from", "check r and units", stage="refine")
    sigma = robust_scale(depth[near]), robust_scale(across[near])
    weight = np.where(near, tukey(np.hypot(depth / sigma[0], across / sigma[1]), 1.0), 0.0)
    shares = [1.0 / (sigma[0] ** 2 * strand.inflation[0]), 1.0 / (sigma[1] ** 2 * strand.inflation[1])]
    sums: NormalEquations | None = None
    for direction, residual, share, worth in zip(
        (ahead, sideways), (depth, across), shares, strand.inflation, strict=True
    ):
        more = normal_equations(k, t, direction, residual, weight, curve.intervals).scaled(share, 1.0 / worth)
        sums = more if sums is None else sums + more
    assert sums is not None
    solution = Linearisation(curve, sums, False).best(strand.smoothing, least)
    return replace(
        strand,
        curve=solution.curve,
        x=x,
        depth=depth,
        across=across,
        sigma=sigma,
        smoothing=solution.smoothing,
        solution=solution,
    )


def components(curve: TubeCurve, k: IntArray, t: Array, offset: Array, view: View) -> tuple[Array, Array, Array, Array]:
    """Offsets (3, M) along the view and across it, and the unit vectors of these two.

    The view is that of the places on the line: with that of the points, a strip seen in perspective would be the
    narrower, the farther away the line is put, and the fit would do so.
    """
    tangent = curve.at(k, t, 1)
    rays = view(curve.at(k, t))
    tangent = tangent / np.maximum(np.sqrt(column_dots(tangent, tangent)), 1e-9)
    ahead = rays - column_dots(rays, tangent) * tangent
    ahead = ahead / np.maximum(np.sqrt(column_dots(ahead, ahead)), 1e-9)
    sideways = np.cross(tangent, ahead, axis=0)
    return column_dots(offset, ahead), column_dots(offset, sideways), ahead, sideways


def _supported(strand: Strand, margin: float, spacing: float) -> Strand:
    inlier = (strand.deviation < 1.0) & strand.on_curve
    curve, x = on_support(strand.curve, strand.x, inlier, strand.half_width, margin, spacing, _MOST, _OVER)
    return replace(strand, curve=curve, x=x)
