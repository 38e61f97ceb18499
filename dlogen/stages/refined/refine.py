"""The refined skeleton line: a robust fit of the tube itself, started from a rough backbone.

Its steps: a cubic B-spline along the backbone; Gauss-Newton on the distance of the points to the tube, first with
widely spaced knots and a given radius, while ends are followed, then with the final knots and the radius free; ends
from the density of the points; and the result as a weighted sum of basis functions of s in [0, 1] (paper Eq. 7).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from dlogen.errors import FitError
from dlogen.geometry.basis import CubicBSpline
from dlogen.geometry.polyline import segment_lengths
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.quality.findings import CURVATURE_UNCERTAIN, RADIUS_UNKNOWN
from dlogen.stages.refined.caps import Caps, find_caps, straight_beyond, through_face
from dlogen.stages.refined.ends import End, find_ends, find_gaps
from dlogen.stages.refined.output_curve import curvature_std, output_curve, sharpest_bend, sufficient_spacing
from dlogen.stages.refined.shared_ends import INLIER, INLIER_FLOOR, shared_at_ends
from dlogen.stages.refined.support import POINTS_PER_INTERVAL, on_support
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import arc_at, arc_table, from_polyline, nearest
from dlogen.stages.refined.tube_fit import LEAST_FLOOR, all_points, gauss_newton
from dlogen.stages.refined.uncertainty import PLACES, line_uncertainty
from dlogen.types import Array, BoolArray, Finding, Skeleton, Uncertainty

#: Knot spacing over the radius, while the points near the curve are looked for and in the end. A cubic spline with
#: knots 1.25 radii apart follows a bend of 3 radii to about 1e-3 radii.
_COARSE, _FINE = 3.0, 1.25

#: The most intervals at first, where the smoothing asks for no more, and of the fit.
_ROUGH_INTERVALS, _MOST_INTERVALS = 96, 20_000

#: Rounds of searching for the points near the curve, and for its ends: each gets a radius farther.
_ROUNDS = 30

#: Points that the backbone is brought to the axis with, and points of the fit proper; larger clouds are fitted by
#: subsets of these sizes first. The last steps use a million points at most.
_ROUGH_POINTS, _FINE_POINTS, _MOST_POINTS = 2000, 8000, 1_000_000

#: So many times as many bring it there if the line bends more often than their number allows.
_MORE = 4

#: Points of the fit for each radius of length, where that is more: the longer a line, the more often it may bend.
_FINE_PER_RADIUS = 20.0

#: Knot spacing over the length below which the smoothing leaves nothing.
_KNOTS = 0.8

#: Noise over radius beyond which the direction from the axis to a point means little.
_SOLID = 0.5

#: Relative standard deviation beyond which the radius counts as unknown: two of them are 4 %.
_RADIUS_KNOWN = 0.02

#: Relative standard deviation beyond which the largest curvature counts as uncertain, and the angle (curvature times
#: length) below which a line is straight, so that it does not matter.
_BEND_KNOWN, _STRAIGHT = 0.25, 0.2


#: The axis is followed beyond the tube so many radii to look for the face of a closed end.
_BEYOND = 6.0


@dataclass(frozen=True, eq=False)
class Refined:
    """The refined skeleton line, with what is known about its accuracy.

    Attributes:
        skeleton: f(s), s proportional to arc length, from end to end of the object.
        radius: of the tube, metres.
        radius_std: its standard deviation, metres; 0 for a given radius, infinite where the points do not tell.
        radius_identifiable: whether the points tell the radius to 4 %.
        inliers: (M,) which points belong to the tube.
        residuals: (M,) distance to the tube's surface, positive outside, metres.
        s: (M,) foot coordinates in [0, 1]; for points beyond the ends 0 or 1.
        noise: standard deviation of the distances of the tube's points to its surface, metres.
        shared: how many points are worth one independent one, since neighbours share their noise.
        end_std: standard deviations of the places of the two ends along the axis, metres.
        max_curvature: the largest curvature, 1/m.
        max_curvature_s: where it is.
        curvature_std: standard deviation of the curvature there, 1/m.
        gaps: (s0, s1) of stretches without points, which chance does not explain.
        used: how many points the last steps used.
        findings: what a user should know.
        closed: whether the faces of the two ends were seen, so that the object certainly ends there.
        uncertainty: of the line along it.
    """

    skeleton: Skeleton
    radius: float
    radius_std: float
    radius_identifiable: bool
    inliers: BoolArray
    residuals: Array
    s: Array
    noise: float
    shared: float
    end_std: tuple[float, float]
    max_curvature: float
    max_curvature_s: float
    curvature_std: float
    gaps: tuple[tuple[float, float], ...]
    used: int
    findings: tuple[Finding, ...]
    closed: tuple[bool, bool] = (False, False)
    uncertainty: Uncertainty | None = None


def refine(points: npt.ArrayLike, backbone: npt.ArrayLike, radius: float, *, fixed_radius: bool = False) -> Refined:
    """Fit a tube to surface points, robustly and without parameters.

    Minimises the robust squared distance of the points to the tube around a uniform cubic B-spline f, plus lambda
    times the squared third derivative of f across its tangent; lambda maximises the marginal likelihood of the data, so
    that neither is noise fitted nor are bends flattened. The points may be one-sided, unevenly dense, noisy, with
    strays and gaps. Of more than 8,000 points a subset is fitted first; two last steps use all, or a million.

    Args:
        points: (M, 3) surface points, metres, in any order.
        backbone: (K, 3) K >= 2 vertices in order, within about 0.7 radii of the axis, metres. It may fall short of the
            ends or go beyond them by about two radii.
        radius: of the tube, metres; a guess within about a third unless it is fixed.
        fixed_radius: keep the radius.

    Returns:
        The skeleton line and its accuracy, in the frame of the points.

    Raises:
        FitError: hardly any points near the backbone, or no line in it.
    """
    points, backbone = np.asarray(points, dtype=float), np.asarray(backbone, dtype=float)
    if not radius > 0.0:
        raise FitError(f"a radius of {radius:g} m makes no tube", "give r in metres", stage="refine")
    origin = backbone.mean(axis=0)
    near = points - origin
    # Random samples, the same ones in whatever order the points come; of the whole, since a sample of one is itself.
    most = _some(near, _MOST_POINTS)
    radii = float(segment_lengths(backbone).sum()) / radius
    fine = _some(most, max(_FINE_POINTS, int(_FINE_PER_RADIUS * radii)))
    rough = _rough(most, len(fine), backbone - origin, radius, fixed_radius)
    tube = _apart(_columns(fine), _fine(_columns(fine), rough, fixed_radius, radius), fixed_radius)
    if not tube.solid and find_caps(tube).any:
        return _closed(near, most, fine, tube, origin, fixed_radius)
    more = most is not fine
    steps = 2 if more and not tube.solid else 0
    tube = all_points(_columns(most), tube, free_radius=not fixed_radius, steps=steps, search=more)
    whole = tube if most is near else all_points(_columns(near), tube, free_radius=False, steps=0, search=True)
    shared = shared_at_ends(_columns(most), tube)
    return _result(tube, whole, shared, origin, fixed_radius)


def _some(points: Array, count: int) -> Array:
    """At most `count` of the points, the same ones in whatever order they come."""
    return points if len(points) <= count else points[spatial_sample(points, count)]


def _columns(points: Array) -> Array:
    return np.ascontiguousarray(points.T)


def _rough(cloud: Array, most: int, backbone: Array, radius: float, fixed_radius: bool) -> Tube:
    """Bring the backbone (K, 3) to the axis of points (M, 3), `most` of which count, and follow it to the ends."""
    start = from_polyline(backbone, _COARSE * radius, radius, 1.0)
    count = _ROUGH_POINTS
    while True:
        points = _columns(_some(cloud, min(count, most)))
        nothing = np.zeros(points.shape[1])
        tube = Tube(start, radius, 0.1 * radius, nothing, nothing)
        tube = gauss_newton(points, tube, free_radius=False, steps=1, floor=0.1, search=True)
        if count >= most or points.shape[1] > POINTS_PER_INTERVAL * start.length / _rough_spacing(tube, radius):
            break
        count *= _MORE
    for step in range(_ROUNDS):
        if step > 0:
            # The radius is freed when the axis is halfway right: from outside it, a circle can be fitted in two ways.
            tube = gauss_newton(points, tube, free_radius=not fixed_radius, steps=1, floor=0.1)
        grown = _on_support(tube, 1.0, _rough_spacing(tube, radius), _MOST_INTERVALS)
        if step >= 1 and grown.curve.length < tube.curve.length + 0.5 * radius:
            break
        tube = grown
    return _on_support(tube, 0.7, _knot_spacing(tube), _MOST_INTERVALS)


def _fine(points: Array, tube: Tube, fixed_radius: bool, radius: float) -> Tube:
    """The tube that fits best, from one that is nearly right: (3, M) points. `radius` is for noise that hides it."""
    first = gauss_newton(points, tube, free_radius=not fixed_radius, steps=1, floor=0.02, search=True)
    if first.sigma > _SOLID * first.radius:
        tube = replace(tube, radius=radius, solid=True)
        return gauss_newton(points, tube, free_radius=False, steps=8, floor=LEAST_FLOOR, search=True)
    tube = _on_support(first, 0.7, _knot_spacing(first), _MOST_INTERVALS)
    # Where points are sparse, the few of the rough rounds fall short of the ends.
    for _ in range(_ROUNDS):
        if tube.curve.length < first.curve.length + 0.2 * first.radius:
            break
        first = gauss_newton(points, tube, free_radius=not fixed_radius, steps=1, floor=0.02, search=True)
        tube = _on_support(first, 0.7, _knot_spacing(first), _MOST_INTERVALS)
    return gauss_newton(points, tube, free_radius=not fixed_radius, steps=6, floor=LEAST_FLOOR)


def _apart(points: Array, tube: Tube, fixed_radius: bool) -> Tube:
    """The tube fitted again where an end touches another strand, without that strand's points: (3, M) points.

    An end that is followed along another strand takes its points for its own: the curve goes on over it, or is bent
    away from the end, whose own points are outliers then.
    """
    shared = np.zeros(points.shape[1], dtype=bool) if tube.solid else shared_at_ends(points, tube)
    if not shared.any():
        return tube
    free = not fixed_radius
    own = points[:, ~shared]
    again = replace(tube, x=tube.x[~shared], distance=tube.distance[~shared])
    for floor, steps in ((0.1, 1), (0.02, 1), (LEAST_FLOOR, 6)):
        again = _on_support(again, 0.7, _knot_spacing(again), _MOST_INTERVALS)
        again = gauss_newton(own, again, free_radius=free, steps=steps, floor=floor, search=True)
    return all_points(points, again, free_radius=free, steps=0, search=True)


def _closed(near: Array, most: Array, fine: Array, tube: Tube, origin: Array, fixed_radius: bool) -> Refined:
    """The result for an object with closed ends: fitted without their faces, and straight up to these.

    Args:
        near, most, fine: (M, 3) all points, those of the last steps, and those of the fit proper.
        tube: fitted to the latter, faces and all.
        origin: of the points, metres.
        fixed_radius: whether the radius was given.
    """
    free = not fixed_radius
    caps = find_caps(tube)
    closed = (bool(np.isfinite(caps.low)), bool(np.isfinite(caps.high)))
    own, fitted = _without(_columns(fine), tube, caps)
    for floor, steps in ((0.1, 1), (0.02, 1), (LEAST_FLOOR, 6)):
        fitted = _on_support(fitted, 0.7, _knot_spacing(fitted), _MOST_INTERVALS)
        fitted = gauss_newton(own, fitted, free_radius=free, steps=steps, floor=floor, search=True)
    if most is not fine:
        own, _ = _without(
            _columns(most), all_points(_columns(most), tube, free_radius=free, steps=0, search=True), caps
        )
        fitted = all_points(own, fitted, free_radius=free, steps=2, search=True)
    radius, s = fitted.radius, arc_at(arc_table(fitted.curve)[1], fitted.x)
    s = s[(np.abs(fitted.residual) < max(INLIER * fitted.sigma, INLIER_FLOOR * radius)) & fitted.on_curve]
    low, high = float(s.min()), float(s.max())
    more = tuple(_BEYOND * radius for _ in closed)
    curve = straight_beyond(fitted.curve, low, high, (more[0], more[1]))
    straight = replace(fitted, curve=curve)
    used = all_points(_columns(most), straight, free_radius=False, steps=0, search=True)
    whole = used if most is near else all_points(_columns(near), straight, free_radius=False, steps=0, search=True)
    used, whole = replace(used, sigma=fitted.sigma), replace(whole, sigma=fitted.sigma)
    length = float(arc_table(curve)[1][-1])
    faces: list[float | None] = [None, None]
    for side, at in ((0, more[0]), (1, length - more[1])):
        if closed[side]:
            away = through_face(_columns(most), curve, at / length * curve.intervals, radius, side == 1)
            faces[side] = None if away is None else (at - away, at + away)[side]
    shared = shared_at_ends(_columns(most), used)
    return _result(used, whole, shared, origin, fixed_radius, fitted, (faces[0], faces[1]))


def _without(points: Array, tube: Tube, caps: Caps) -> tuple[Array, Tube]:
    """The points between the faces of closed ends, and the tube with their feet: (3, M) -> (3, K)."""
    s = arc_at(arc_table(tube.curve)[1], tube.x)
    kept = (s >= caps.low) & (s <= caps.high)
    return points[:, kept], replace(tube, x=tube.x[kept], distance=tube.distance[kept])


def _left_over(tube: Tube) -> float:
    """Length that the smoothing leaves over, metres: what is shorter needs no knots of its own."""
    density = 0.5 * np.count_nonzero(tube.on_curve) / tube.curve.length
    return (tube.smoothing / density) ** (1.0 / 6.0) if tube.smoothing else 0.0


def _rough_spacing(tube: Tube, radius: float) -> float:
    """Distance of the knots while the ends are looked for, metres; long lines have fewer if they bend little."""
    few = tube.curve.length / _ROUGH_INTERVALS
    return max(_COARSE * radius, min(few, _KNOTS * _left_over(tube)))


def _knot_spacing(tube: Tube) -> float:
    """Distance of the knots that a tube needs, metres: not less than 1.25 radii."""
    enough = 0.7 * sufficient_spacing(tube.curve, tube.radius)
    return max(_FINE * tube.radius, _KNOTS * _left_over(tube), min(enough, _COARSE * tube.radius))


def _on_support(tube: Tube, margin: float, spacing: float, most: int) -> Tube:
    """The tube with its curve cut or extended to where the points are, see `on_support`."""
    inlier = (np.abs(tube.residual) < max(3.0 * tube.sigma, 0.2 * tube.radius)) & tube.on_curve
    curve, x = on_support(tube.curve, tube.x, inlier, tube.radius, margin, spacing, most)
    return replace(tube, curve=curve, x=x, solution=None)


def _result(
    tube: Tube,
    whole: Tube,
    shared: BoolArray,
    origin: Array,
    fixed_radius: bool,
    fit: Tube | None = None,
    faces: tuple[float | None, float | None] = (None, None),
) -> Refined:
    """What the fitted tube says, between the ends that its points show.

    Args:
        tube: with the points of the fit.
        whole: the same with all points.
        shared: which points of the fit may belong to a strand that an end touches, and say nothing of the end.
        origin: of the points, metres.
        fixed_radius: whether the radius was given.
        fit: the tube that was fitted, where the ends of `tube` were made straight afterwards.
        faces: where the axis goes through the faces of closed ends, arc length, metres; None for open ends.
    """
    curve, radius, sigma = tube.curve, tube.radius, tube.sigma
    fit = fit or tube
    grid, arc, _ = arc_table(curve)
    scale = max(sigma, INLIER_FLOOR / INLIER * radius)
    deviation = np.abs(tube.residual) / scale
    s = arc_at(arc, tube.x)
    inside = s[(deviation < INLIER) & tube.on_curve & ~shared]
    ends = find_ends(inside, deviation[tube.on_curve], sigma)
    first, last = (end if face is None else End(face, sigma) for end, face in zip(ends, faces, strict=True))
    start, end = first.position, last.position
    if not end - start > 0.1 * radius:
        raise FitError("the line has no length", "check r and units", stage="refine")
    fitted = output_curve(curve, start, end, radius)
    length = float(arc_table(fitted)[1][-1])
    skeleton = Skeleton(CubicBSpline(fitted.intervals + 3), fitted.coefficients, origin, length)

    kappa, s_kappa = sharpest_bend(fitted)
    sharpest = float(np.interp(start + s_kappa * (end - start), arc, grid))
    if fit is not tube:
        sharpest = float(nearest(fit.curve, curve(np.array([sharpest])).T, 0.1 * radius)[0])
    kappa_std = curvature_std(fit, sharpest)
    if fixed_radius:
        radius_std = 0.0
    elif tube.solid or fit.solution is None:
        radius_std = np.inf
    else:
        radius_std = sigma / float(np.sqrt(fit.solution.schur))
    known = radius_std < _RADIUS_KNOWN * radius
    gaps = find_gaps(s[(deviation < INLIER) & tube.on_curve], start, end, radius)

    used = len(s)
    if whole is not tube:
        s, deviation = arc_at(arc, whole.x), np.abs(whole.residual) / scale
    inlier = (deviation < INLIER) & (s > start - INLIER * scale) & (s < end + INLIER * scale) & whole.on_curve
    return Refined(
        skeleton=skeleton,
        radius=radius,
        radius_std=radius_std,
        radius_identifiable=known,
        inliers=inlier,
        residuals=whole.distance - radius,
        s=np.clip((s - start) / (end - start), 0.0, 1.0),
        noise=sigma,
        shared=tube.shared,
        end_std=(first.std, last.std),
        max_curvature=kappa,
        max_curvature_s=s_kappa,
        curvature_std=kappa_std,
        gaps=gaps,
        used=used,
        findings=_findings(skeleton, radius, radius_std, known, kappa, s_kappa, kappa_std),
        closed=(faces[0] is not None, faces[1] is not None),
        uncertainty=_uncertainty(tube, fit, np.interp(np.linspace(start, end, PLACES), arc, grid), radius_std),
    )


def _uncertainty(tube: Tube, fit: Tube, x: Array, radius_std: float) -> Uncertainty | None:
    """How well the axis is known at places of a tube, by the fit that it came from."""
    if fit.solution is None:
        return None
    if fit is not tube:
        x = nearest(fit.curve, tube.curve(x).T, 0.1 * tube.radius)
    return line_uncertainty(fit.curve, fit.solution, fit.sigma, x, radius_std)


def _findings(
    line: Skeleton,
    radius: float,
    radius_std: float,
    known: bool,
    kappa: float,
    s_kappa: float,
    kappa_std: float,
) -> tuple[Finding, ...]:
    """What a user should know about the fit; gaps are judged by the ordering, which bridged them."""
    findings = []
    if not known:
        spread = f"to {100.0 * radius_std / radius:.0f} % only" if np.isfinite(radius_std) else "at this noise"
        findings.append(RADIUS_UNKNOWN.found(f"the points do not tell the radius {spread}: give r"))
    if kappa_std > _BEND_KNOWN * kappa and kappa * line.length > _STRAIGHT:
        message = f"the sharpest bend, radius {1e3 / kappa:.0f} mm, is known to {100.0 * kappa_std / kappa:.0f} % only"
        findings.append(CURVATURE_UNCERTAIN.at(line, s_kappa, message))
    return tuple(findings)
