"""The curve that the tube fit works on: a uniform cubic B-spline whose parameter is close to arc length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.spatial import cKDTree

from dlogen.model import Array, IntArray

#: Monomial coefficients of the four B-splines of an interval: row p holds the coefficients of t^p.
_MONOMIALS = (
    np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0
)


@dataclass(frozen=True, eq=False)
class TubeCurve:
    """f(x) = sum_j c_j B_j(x) for x in [0, n], the knots at the integers; one unit of x is `step` metres of arc.

    Attributes:
        coefficients: (n + 3, 3), metres.
        step: the nominal arc length of one interval, metres.
    """

    coefficients: Array
    step: float

    @property
    def intervals(self) -> int:
        """n."""
        return len(self.coefficients) - 3

    @property
    def length(self) -> float:
        """The nominal arc length, metres."""
        return self.step * self.intervals

    @cached_property
    def pieces(self) -> Array:
        """(4, 3, n) coefficients of 1, t, t^2, t^3 in each interval, t in [0, 1]."""
        c, n = self.coefficients.T, self.intervals
        windows = np.stack([c[:, q : q + n] for q in range(4)])
        return np.tensordot(_MONOMIALS, windows, axes=1)

    def __call__(self, x: npt.ArrayLike, derivative: int = 0) -> Array:
        """f or its derivative with respect to arc length (that is, x times `step`): (K,) -> (K, 3)."""
        x = np.asarray(x, dtype=float)
        k = np.clip(x.astype(np.intp), 0, self.intervals - 1)
        return self.at(k, x - k, derivative).T

    def at(self, k: IntArray, t: Array, derivative: int = 0) -> Array:
        """The same at places t of intervals k, as columns: (K,) -> (3, K)."""
        a = self.pieces[:, :, k]
        if derivative == 0:
            return ((a[3] * t + a[2]) * t + a[1]) * t + a[0]
        if derivative == 1:
            return ((3.0 * a[3] * t + 2.0 * a[2]) * t + a[1]) / self.step
        if derivative == 2:
            return (6.0 * a[3] * t + 2.0 * a[2]) / self.step**2
        raise ValueError(f"derivative {derivative} is not available")

    def curvature(self, x: npt.ArrayLike) -> Array:
        """|f' x f''| / |f'|^3 (paper Eq. 16): (K,), 1/m."""
        first, second = self(x, 1), self(x, 2)
        bend = np.linalg.norm(np.cross(first, second), axis=1)
        result: Array = bend / np.maximum(np.linalg.norm(first, axis=1), 1e-9) ** 3
        return result


def spline_values(t: Array) -> Array:
    """The four B-splines that are not zero at t in [0, 1] of an interval: (K,) -> (4, K)."""
    u = 1.0 - t
    t2, u2 = t * t, u * u
    return np.stack([u2 * u, (3.0 * t - 6.0) * t2 + 4.0, (3.0 * u - 6.0) * u2 + 4.0, t2 * t]) / 6.0


#: Where a curve is sampled within every interval when another one is put through it.
_SAMPLES = 6


@lru_cache(maxsize=32)
def _interpolator(intervals: int, smoothing: float) -> tuple[Array, IntArray, Array]:
    """Factor of the least-squares fit of n + 3 coefficients to samples at the same places in every interval."""
    x = np.linspace(0.0, intervals, intervals * _SAMPLES + 1)
    k = np.minimum(x.astype(np.intp), intervals - 1)
    values = spline_values(x - k)
    size = intervals + 3
    band = np.zeros((4, size))
    for d in range(4):
        for q in range(4 - d):
            band[d] += np.bincount(k + q, values[q] * values[q + d], minlength=size)
    difference = np.array([-1.0, 3.0, -3.0, 1.0])
    for d in range(4):
        for q in range(4 - d):
            band[d, q : q + intervals] += smoothing * difference[q] * difference[q + d]
    factor, info = dpbtrf(band, lower=1)
    if info:
        raise np.linalg.LinAlgError("the interpolation matrix is not positive definite")
    return factor, k, values


def through(samples: Array, intervals: int, step: float, smoothing: float = 0.0) -> TubeCurve:
    """The curve with n intervals closest to 6 n + 1 samples that are even in its parameter.

    Args:
        samples: (6 n + 1, 3), metres.
        intervals: n.
        step: arc length of an interval, metres.
        smoothing: weight of the third differences of the coefficients.
    """
    factor, k, values = _interpolator(intervals, smoothing)
    right = np.empty((intervals + 3, 3))
    for c in range(3):
        right[:, c] = sum(np.bincount(k + q, values[q] * samples[:, c], minlength=intervals + 3) for q in range(4))
    return TubeCurve(dpbtrs(factor, right, lower=1)[0], step)


def arc_table(curve: TubeCurve) -> tuple[Array, Array]:
    """x at 4 places per interval and the arc length from x = 0 there (Gauss-Legendre, 3 points each)."""
    grid = np.linspace(0.0, curve.intervals, 4 * curve.intervals + 1)
    node = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
    weight = np.array([5.0, 8.0, 5.0]) / 18.0
    x = (grid[:-1, None] + (0.5 + 0.5 * node) * 0.25).ravel()
    speed = np.linalg.norm(curve(x, 1), axis=1).reshape(-1, 3)
    return grid, np.concatenate([[0.0], np.cumsum(speed @ weight * (0.25 * curve.step))])


def reparametrised(
    curve: TubeCurve, intervals: int | None = None, start: float = 0.0, end: float | None = None
) -> TubeCurve:
    """The same curve by arc length, on another grid of knots and between other ends.

    Args:
        curve: any curve.
        intervals: number of intervals; the curve's own by default.
        start, end: arc length, from the old start, of the new ends; beyond the old ones the curve goes on straight.
    """
    grid, length = arc_table(curve)
    end = float(length[-1]) if end is None else end
    intervals = intervals or curve.intervals
    at = np.linspace(start, end, intervals * _SAMPLES + 1)
    inside = np.clip(at, 0.0, length[-1])
    samples = curve(_inverse(curve, grid, length, inside))
    if start < 0.0 or end > length[-1]:
        tangent = curve(np.array([0.0, curve.intervals]), 1)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        beyond = (at - inside)[:, None]
        samples += np.where(beyond < 0.0, tangent[0], tangent[1]) * beyond
    return through(samples, intervals, (end - start) / intervals)


def evened(curve: TubeCurve) -> TubeCurve:
    """The curve by arc length, if its speed has come to differ; else the curve itself."""
    speed = np.linalg.norm(curve(np.arange(curve.intervals) + 0.5, 1), axis=1)
    return reparametrised(curve) if np.abs(speed - 1.0).max() > 1e-3 else curve


def _inverse(curve: TubeCurve, grid: Array, length: Array, at: Array) -> Array:
    """x at given arc lengths: linear in the table, then a Newton step with the speed."""
    x = np.interp(at, length, grid)
    k = np.minimum((x * 4.0).astype(np.intp), len(grid) - 2)
    t = x - grid[k]
    # Simpson's rule from the table's place to x gives the arc length there to fourth order.
    ends = [np.linalg.norm(curve(grid[k] + f * t, 1), axis=1) for f in (0.0, 0.5, 1.0)]
    here = length[k] + (ends[0] + 4.0 * ends[1] + ends[2]) * (t * curve.step / 6.0)
    return np.clip(x - (here - at) / (np.maximum(ends[2], 1e-9) * curve.step), 0.0, curve.intervals)


def from_polyline(points: Array, spacing: float, extension: float, smoothing: float) -> TubeCurve:
    """A smooth curve near a polyline, with straight extensions at both ends.

    Args:
        points: (K, 3) vertices in order, metres.
        spacing: wanted length of an interval, metres.
        extension: length added at either end, metres.
        smoothing: weight of the third differences.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate([[True], steps > 0.0])]
    length = np.concatenate([[0.0], np.cumsum(steps[steps > 0.0])])
    intervals = max(4, round(length[-1] / spacing))
    at = np.linspace(0.0, length[-1], intervals * _SAMPLES + 1)
    samples = np.stack([np.interp(at, length, points[:, c]) for c in range(3)], axis=1)
    curve = through(samples, intervals, float(length[-1]) / intervals, smoothing)
    total = float(arc_table(curve)[1][-1])
    return reparametrised(curve, max(4, round((total + 2.0 * extension) / spacing)), -extension, total + extension)


def nearest(curve: TubeCurve, points: Array, spacing: float) -> Array:
    """Foot parameter of the nearest of samples at most `spacing` apart: (3, M) -> (M,)."""
    per_interval = max(1, int(np.ceil(curve.step / spacing)))
    x = np.linspace(0.0, curve.intervals, per_interval * curve.intervals + 1)
    return x[cKDTree(curve(x), balanced_tree=False, compact_nodes=False).query(points.T)[1]]


def foot_points(curve: TubeCurve, points: Array, x: Array, steps: int = 1) -> tuple[Array, IntArray, Array, Array]:
    """Newton's method for the foot points: (p - f(x)) . f'(x) = 0, near given x.

    Args:
        curve: the curve.
        points: (3, M), metres.
        x: (M,) parameters to start from.
        steps: number of Newton steps.

    Returns:
        x (M,), the interval (M,), t in it (M,) and the vectors p - f(x) (3, M). Feet are kept within the curve.
    """
    pieces, last = curve.pieces, float(curve.intervals)
    for step in range(steps):
        k = np.minimum(x.astype(np.intp), curve.intervals - 1)
        t = x - k
        a = pieces[:, :, k]
        offset = points - (((a[3] * t + a[2]) * t + a[1]) * t + a[0])
        half = 3.0 * a[3] * t + a[2]
        first = (2.0 * half - 3.0 * a[3] * t) * t + a[1]
        speed = dot(first, first)
        # Inside a bend, far from the curve, the second derivative of the distance vanishes: keep the step finite.
        slope = np.maximum(speed - 2.0 * dot(offset, half), 0.25 * speed)
        move = np.clip(dot(offset, first) / np.maximum(slope, 1e-300), -1.0, 1.0)
        moved = np.clip(x + move, 0.0, last)
        if step == steps - 1:
            # The polynomial of the interval goes on beyond it: Taylor's formula saves another look-up.
            move = moved - x
            offset -= ((a[3] * move + half) * move + first) * move
            return moved, k, t + move, offset
        x = moved
    raise ValueError("at least one step is needed")


def dot(a: Array, b: Array) -> Array:
    """Scalar products of columns: (3, M), (3, M) -> (M,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
