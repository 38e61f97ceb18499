"""Gauss-Newton on the distance of surface points to the tube around a curve, with smoothing chosen from the data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from dlogen.errors import FitError
from dlogen.stages.refined.tube_curve import (
    THIRD_DIFFERENCE,
    TubeCurve,
    dot,
    evened,
    foot_points,
    nearest,
    nearest_by_cells,
    spline_values,
)
from dlogen.types import Array, BoolArray, IntArray

#: Tukey's biweight constant: 98 % efficiency for Gaussian noise; strays are rarely so near the surface.
_TUKEY = 6.0

#: Bounds of log10(lambda / its natural scale), where data and penalty weigh the same in the matrix.
_LOG_LAMBDA = (-8.0, 6.0)

#: log10 of the smoothing over the one of largest likelihood. The sample paths of the prior are rougher than cables, so
#: that its best smoothing is too weak for them: twice as much lowers the error of position by 4 % and that of the
#: largest curvature by 15 % on random curves, loops and tight bends alike, and still raises none.
_SMOOTHER = 0.3

#: The least of it as long as the curve is far from the points: it keeps ends in place that hardly a point holds.
_LOG_ROUGH = -3.0

#: Points that are worked on at a time: bounds the memory, and stays in the processor's cache.
_CHUNK = 1 << 14

#: Smallest scale of the robust weights in the last steps, in radii: the error of the curve itself.
LEAST_FLOOR = 5e-4

#: A step that changes the distances by less than the sum of these, in radii and in standard deviations, is the last.
_STILL, _STILL_NOISE = 1e-5, 0.02

#: Fewest points near the curve that a fit goes on with.
_FEWEST = 10


@dataclass(frozen=True, eq=False)
class Normals:
    """Normal equations of one linearisation, summed over points.

    Attributes:
        blocks: (n, 12, 12) of the coefficients of each interval: sum of w a a^T, a_(j, c) = B_j(t) e_c.
        right: (n, 12) sum of w a d, with d = |p - f| - rho.
        radius: (n, 12) sum of w a.
        weight: sum of w.
        residual: sum of w d.
        squares: sum of w d^2.
    """

    blocks: Array
    right: Array
    radius: Array
    weight: float
    residual: float
    squares: float

    def __add__(self, other: Normals) -> Normals:
        return Normals(
            self.blocks + other.blocks,
            self.right + other.right,
            self.radius + other.radius,
            self.weight + other.weight,
            self.residual + other.residual,
            self.squares + other.squares,
        )


def normals(k: IntArray, t: Array, direction: Array, residual: Array, weight: Array, intervals: int) -> Normals:
    """Sum the normal equations of points: see `Normals`. Directions (3, M), the others (M,)."""
    root = np.sqrt(weight)
    columns = np.empty((14, len(k)))
    np.multiply((spline_values(t) * root)[:, None], direction, out=columns[:12].reshape(4, 3, -1))
    columns[12] = root
    columns[13] = root * residual
    columns = np.take(columns, np.argsort(k.astype(np.int16), kind="stable"), axis=1)
    ends = np.cumsum(np.bincount(k, minlength=intervals)).tolist()
    sums = np.zeros((intervals, 14, 14))
    first = 0
    for j, last in enumerate(ends):
        if last > first:
            part = columns[:, first:last]
            np.matmul(part, part.T, out=sums[j])
        first = last
    total = sums[:, 12:, 12:].sum(axis=0)
    return Normals(
        np.ascontiguousarray(sums[:, :12, :12]),
        sums[:, :12, 13].copy(),
        sums[:, :12, 12].copy(),
        float(total[0, 0]),
        float(total[0, 1]),
        float(total[1, 1]),
    )


@lru_cache(maxsize=32)
def _band_index(intervals: int) -> tuple[IntArray, IntArray, IntArray]:
    """Where the lower triangles of the blocks go in LAPACK's lower band storage, and the entries of a vector."""
    a, b = np.tril_indices(12)
    start = 3 * np.arange(intervals)[:, None]
    size = 3 * (intervals + 3)
    return a * 12 + b, ((a - b) * size + start + b).ravel(), (start + np.arange(12)).ravel()


def _band(blocks: Array) -> Array:
    """(12, 3 N) lower band storage of the sum of overlapping blocks (n, 12, 12)."""
    inside, at, _ = _band_index(len(blocks))
    size = 3 * (len(blocks) + 3)
    band = np.bincount(at, blocks.reshape(-1, 144)[:, inside].ravel(), minlength=12 * size)
    return band.reshape(12, size).astype(float, copy=False)


def _vector(parts: Array) -> Array:
    """(3 N,) sum of overlapping parts (n, 12)."""
    return np.bincount(_band_index(len(parts))[2], parts.ravel(), minlength=3 * (len(parts) + 3)).astype(
        float, copy=False
    )


def _penalty(curve: TubeCurve) -> Array:
    """(n, 12, 12) blocks of the penalty: the squared third derivative across the tangent.

    The third differences of uniform cubic B-spline coefficients are the third derivative. Only what is normal to the
    curve is penalised, which for a curve in arc length is the change of its curvature and torsion: circles and straight
    lines cost nothing.
    """
    tangent = curve.everywhere(np.array([0.5]), 1).T
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.eye(3) - tangent[:, :, None] * tangent[:, None, :]
    blocks = THIRD_DIFFERENCE[:, None, None, None] * THIRD_DIFFERENCE[:, None] * across[:, None, :, None, :]
    return blocks.reshape(-1, 12, 12)


@dataclass(frozen=True, eq=False)
class Solution:
    """The step of one linearisation.

    Attributes:
        curve: the curve after the step.
        radius_step: change of rho.
        log_lambda: log10 of the smoothing, relative to its natural scale.
        smoothing: the weight of the integral of the squared third derivative over arc length, m^5.
        criterion: -2 log of the marginal likelihood, up to a constant.
        factor: Cholesky factor of the matrix (band storage).
        coupling: (3 N,) its solution for the radius column.
        schur: what is left for the radius after the coefficients.
        step: (3 N,) the change of the coefficients.
    """

    curve: TubeCurve
    radius_step: float
    log_lambda: float
    smoothing: float
    criterion: float
    factor: Array
    coupling: Array
    schur: float
    step: Array

    def covariance(self, rows: Array) -> Array:
        """Posterior covariance of linear functions of the coefficients, for unit noise: (R, 3 N) -> (R, R)."""
        solved = dpbtrs(self.factor, np.ascontiguousarray(rows.T), lower=1)[0]
        through_radius = rows @ self.coupling
        covariance: Array = rows @ solved + np.outer(through_radius, through_radius) / self.schur
        return covariance


class Linearisation:
    """The penalised least-squares problem around a curve, for any smoothing.

    Args:
        curve: where it is linearised.
        sums: the normal equations.
        free_radius: whether rho is an unknown.
    """

    def __init__(self, curve: TubeCurve, sums: Normals, free_radius: bool) -> None:
        self.curve, self.sums, self.free_radius = curve, sums, free_radius
        self.data = _band(sums.blocks)
        penalty = _penalty(curve)
        self.penalty = _band(penalty)
        self.right = _vector(sums.right)
        self.radius = _vector(sums.radius)
        windows = np.lib.stride_tricks.sliding_window_view(curve.coefficients, 4, axis=0)
        local = windows.transpose(0, 2, 1).reshape(-1, 12)
        slope = np.einsum("kab,kb->ka", penalty, local)
        self.pull = _vector(slope)
        self.energy = float(np.sum(slope * local))
        self.scale = self.data[0].sum() / self.penalty[0].sum()
        self._hold(0.1)

    def _hold(self, share: float) -> None:
        """Hold the coefficients along the tangent: moving along itself does not change a curve."""
        size = len(self.curve.coefficients)
        tangent = self.curve(np.clip(np.arange(size) - 1.0, 0.0, self.curve.intervals), 1)
        tangent *= np.sqrt(share * self.data[0].sum() / size) / np.linalg.norm(tangent, axis=1, keepdims=True)
        outer = tangent[:, :, None] * tangent[:, None, :]
        self.held = self.data.copy()
        for d in range(3):
            for c in range(3 - d):
                self.held[d, c::3] += outer[:, c + d, c]

    def solve(self, log_lambda: float) -> Solution:
        """The step for one smoothing, with the marginal likelihood of that smoothing.

        The penalty is the prior N(0, sigma^2 / lambda) of the third derivative; integrating the coefficients out and
        maximising over sigma leaves the restricted likelihood (REML; Wahba 1985, Wood 2011), which is less prone to
        fit noise than cross-validation.
        """
        smoothing = 10.0**log_lambda * self.scale
        factor, info = dpbtrf(self.held + smoothing * self.penalty, lower=1, overwrite_ab=1)
        if info:
            # Long stretches without points need more of the penalty to be determined at all.
            if log_lambda > _LOG_LAMBDA[1]:
                raise FitError("the points do not determine a line", "check r and units", stage="refine")
            return self.solve(log_lambda + 1.0)
        right = self.right - smoothing * self.pull
        solved = dpbtrs(factor, np.stack([right, self.radius], axis=1), lower=1)[0]
        step, coupling = solved[:, 0], solved[:, 1]
        sums = self.sums
        objective = sums.squares + smoothing * self.energy - float(right @ step)
        log_determinant = 2.0 * float(np.log(factor[0]).sum())
        radius_step, schur = 0.0, np.inf
        if self.free_radius:
            schur = max(sums.weight - float(self.radius @ coupling), 1e-12 * sums.weight)
            slope = sums.residual - float(self.radius @ step)
            radius_step = slope / schur
            step = step - coupling * radius_step
            objective -= slope * radius_step
            log_determinant += float(np.log(schur))
        freedom = max(sums.weight - 6.0 - self.free_radius, 1.0)
        objective = max(objective, 1e-24 * sums.weight * self.curve.step**2)
        rank = 2 * self.curve.intervals
        criterion = freedom * np.log(objective) + log_determinant - rank * np.log(smoothing)
        return Solution(
            TubeCurve(self.curve.coefficients + self._limited(step.reshape(-1, 3)), self.curve.step),
            radius_step,
            log_lambda,
            smoothing * self.curve.step**5,
            float(criterion),
            factor,
            coupling,
            schur,
            step,
        )

    def _limited(self, step: Array) -> Array:
        """Steps of at most half an interval each: where there are hardly any points, a solution may be anywhere."""
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return step * np.minimum(1.0, 0.5 * self.curve.step / np.maximum(length, 1e-300))

    def moved(self, solution: Solution) -> float:
        """Root mean square of the change that a step makes to the distances of the points, metres."""
        local = np.lib.stride_tricks.sliding_window_view(solution.step.reshape(-1, 3), 4, axis=0)
        local = local.transpose(0, 2, 1).reshape(-1, 1, 12)
        change = solution.radius_step
        squares = float((local @ self.sums.blocks @ local.transpose(0, 2, 1)).sum())
        squares += 2.0 * change * float(self.radius @ solution.step) + change**2 * self.sums.weight
        return float(np.sqrt(max(squares, 0.0) / self.sums.weight))

    def best(self, smoothing: float | None = None, least: float = _LOG_LAMBDA[0]) -> Solution:
        """The step with twice the smoothing of largest marginal likelihood (see `_SMOOTHER`).

        Args:
            smoothing: `Solution.smoothing` to start from; without one the whole range is searched.
            least: log10 of the least smoothing, relative to its natural scale.
        """
        low, high = least, _LOG_LAMBDA[1]
        if smoothing is None:
            tried = [self.solve(value) for value in np.arange(low, high + 0.1, 2.0)]
            guess, width = min(tried, key=lambda solution: solution.criterion).log_lambda, 1.0
        else:
            relative = smoothing / (self.curve.step**5 * self.scale)
            guess, width = float(np.clip(np.log10(relative) - _SMOOTHER, low + 0.5, high - 0.5)), 0.5
        left, middle, right = (self.solve(guess + side).criterion for side in (-width, 0.0, width))
        # The vertex of the parabola through three places; downhill where there is none.
        bend, slope = left - 2.0 * middle + right, 0.5 * (right - left)
        move = -slope / bend if bend > abs(slope) else -np.sign(slope)
        return self.solve(float(np.clip(guess + width * move, low, high)) + _SMOOTHER)


@dataclass(frozen=True, eq=False)
class Tube:
    """A tube around a curve, with the points around it.

    Attributes:
        curve: the axis.
        radius: of the tube, metres; the points' mean distance to the axis is larger, see `expected_distance`.
        sigma: standard deviation of the distances of the points to the tube's surface, metres.
        x: (M,) foot parameters of the points.
        distance: (M,) distances of the points to the axis, metres.
        smoothing: see `Solution`; None as long as it is not known.
        solution: the last step of the fit, for covariances.
        solid: the axis was fitted to the points themselves, since noise of the size of the radius hides the surface.
    """

    curve: TubeCurve
    radius: float
    sigma: float
    x: Array
    distance: Array
    smoothing: float | None = None
    solution: Solution | None = None
    solid: bool = False

    @property
    def residual(self) -> Array:
        """(M,) distance of each point to the axis less its expectation, metres."""
        return self.distance - expected_distance(self.radius, self.sigma)

    @property
    def on_curve(self) -> BoolArray:
        """(M,) whether the foot point is not just the end of the curve."""
        return (self.x > 0.0) & (self.x < self.curve.intervals)


def expected_distance(radius: float, sigma: float) -> float:
    """Mean distance of noisy points of a tube to its axis: r + sigma^2 / (2 r), to second order.

    Noise across the radius moves a point outward, on average by sigma^2 / (2 r). It is the bias of every geometric
    circle fit, the same on whole circles and on arcs (Al-Sharadqah and Chernov 2009).

    Args:
        radius: metres.
        sigma: standard deviation of the distances, metres.
    """
    return radius + 0.5 * _noise_variance(radius, sigma) / radius


def _noise_variance(radius: float, sigma: float) -> float:
    """Variance v of each coordinate, from the one of the distances: sigma^2 = v - v^2 / (2 r^2) (Rice)."""
    ratio = min(2.0 * sigma**2 / radius**2, 1.0)
    return radius**2 * (1.0 - float(np.sqrt(1.0 - ratio)))


def robust_scale(residual: Array) -> float:
    """Standard deviation of the Gaussian core: 1.4826 times the median absolute residual."""
    return 1.4826 * median(np.abs(residual))


def median(values: Array) -> float:
    """The median, of an even number the upper one of the middle two: a third of the time of numpy's."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def tukey(residual: Array, scale: float) -> Array:
    """Tukey's biweight: (M,) weights in [0, 1], 0 beyond 6 scales."""
    z = np.minimum(np.abs(residual) / (_TUKEY * scale), 1.0)
    weight = 1.0 - z * z
    return weight * weight


def gauss_newton(
    points: Array, tube: Tube, *, free_radius: bool, steps: int, floor: float, search: bool = False
) -> Tube:
    """Gauss-Newton on the robust squared distances of points to a tube, until steps are small beside the noise.

    The residual of a point is |p - f(u)| - E|p - f(u)| with u its foot point; since f'(u) is normal to p - f(u), its
    derivative with respect to the coefficient j is -B_j(u) times the unit vector from axis to point. No normals and no
    full circumference are needed.

    Args:
        points: (3, M), metres.
        tube: where to start.
        free_radius: whether the radius is estimated.
        steps: the most steps.
        floor: smallest scale of the robust weights, in radii. A scale below the error of the curve itself would make
            outliers of whole bends.
        search: look for the nearest place on the whole curve first, not only near the present feet.

    Returns:
        The tube after the last step, its speed not evened; x and distances are those to the curve before it.

    Raises:
        FitError: hardly any points near the curve.
    """
    curve, radius, sigma, x = tube.curve, tube.radius, tube.sigma, tube.x
    smoothing, solution = tube.smoothing, tube.solution
    if search:
        x = nearest(curve, points, 0.5 * radius)
    for step in range(steps):
        if step > 0:
            curve = evened(curve)
        x, k, t, offset = foot_points(curve, points, x, 2 if search and step == 0 else 1)
        distance = np.sqrt(dot(offset, offset))
        expected = expected_distance(radius, sigma)
        near = (x > 0.0) & (x < curve.intervals) & (distance < expected + radius)
        if np.count_nonzero(near) < _FEWEST:
            raise FitError(
                f"only {np.count_nonzero(near)} of {len(x)} points are near the line that the fit started from",
                "check r and units: dlogen info shows what the cloud suggests",
                stage="refine",
            )
        direction = offset / np.maximum(distance, 1e-12 * radius)
        if tube.solid:
            sums = _solid_normals(curve, k, t, direction, distance, near)
        else:
            residual = distance - expected
            inside = residual[near]
            scale = robust_scale(inside)
            # A wrong radius shifts all residuals; only their spread about that is noise.
            sigma = min(scale, robust_scale(inside - median(inside)))
            weight = np.where(near, tukey(residual, max(scale, floor * radius)), 0.0)
            sums = normals(k, t, direction, residual, weight, curve.intervals)
        problem = Linearisation(curve, sums, free_radius)
        solution = problem.best(smoothing, _LOG_ROUGH if floor >= 0.1 else _LOG_LAMBDA[0])
        smoothing = solution.smoothing
        radius = max(radius + solution.radius_step, 0.2 * radius)
        curve = solution.curve
        # The next step would be some ten times smaller again.
        if step < steps - 1 and problem.moved(solution) < _STILL * radius + _STILL_NOISE * sigma:
            break
    return Tube(curve, radius, sigma, x, distance, smoothing, solution, tube.solid)


def _solid_normals(
    curve: TubeCurve, k: IntArray, t: Array, direction: Array, distance: Array, near: BoolArray
) -> Normals:
    """Normal equations for an axis through the points themselves: both components of their offset across the axis."""
    # The median of the distance of a two-dimensional Gaussian is 1.1774 standard deviations.
    weight = np.where(near, tukey(distance, float(np.median(distance[near])) / 1.1774), 0.0)
    tangent = curve.at(k, t, 1)
    sideways = np.cross(tangent, direction, axis=0)
    sideways /= np.maximum(np.sqrt(dot(sideways, sideways)), 1e-9)
    along = normals(k, t, direction, distance, weight, curve.intervals)
    return along + normals(k, t, sideways, np.zeros_like(distance), weight, curve.intervals)


def all_points(points: Array, tube: Tube, *, free_radius: bool, steps: int, search: bool) -> Tube:
    """Steps as in `gauss_newton` over any number of points, in chunks, and the feet of all points at the end.

    Args:
        points: (3, M), metres.
        tube: a tube that is nearly right.
        free_radius: whether the radius is estimated.
        steps: number of steps; 0 only finds the feet.
        search: whether the points are others than those of the tube, so that their feet have to be looked for.

    Returns:
        The tube with x and distance of every point to its curve.
    """
    x = nearest_by_cells(tube.curve, points, 0.5 * tube.radius) if search else tube.x.copy()
    distance = np.empty(len(x))
    for step in range(steps + 1):
        curve, radius = tube.curve, tube.radius
        expected = expected_distance(radius, tube.sigma)
        sums = None
        for first in range(0, len(x), _CHUNK):
            part = slice(first, first + _CHUNK)
            x[part], k, t, offset = foot_points(curve, points[:, part], x[part], 2 if search else 1)
            distance[part] = away = np.sqrt(dot(offset, offset))
            if step < steps:
                near = (x[part] > 0.0) & (x[part] < curve.intervals)
                weight = np.where(near, tukey(away - expected, max(tube.sigma, LEAST_FLOOR * radius)), 0.0)
                direction = offset / np.maximum(away, 1e-12 * radius)
                more = normals(k, t, direction, away - expected, weight, curve.intervals)
                sums = more if sums is None else sums + more
        search = False
        residual = distance - expected
        near = (x > 0.0) & (x < curve.intervals) & (np.abs(residual) < radius)
        if np.count_nonzero(near) < _FEWEST:
            raise FitError("the line that was found is not near the points", "check r and units", stage="refine")
        tube = replace(tube, sigma=robust_scale(residual[near]), x=x, distance=distance)
        if sums is not None:
            solution = Linearisation(curve, sums, free_radius).best(tube.smoothing)
            tube = replace(
                tube,
                curve=evened(solution.curve),
                radius=radius + solution.radius_step,
                smoothing=solution.smoothing,
                solution=solution,
            )
    return tube
