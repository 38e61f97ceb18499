"""The curve that the tube fit works on: a uniform cubic B-spline whose parameter is close to arc length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.spatial import cKDTree

from dlogen.geometry.arc_length import cells
from dlogen.geometry.polyline import arc_lengths, at_arc_lengths, segment_lengths
from dlogen.geometry.spline import MONOMIALS, THIRD_DIFFERENCE, spline_values
from dlogen.geometry.vectors import column_dots, unit
from dlogen.types import Array, IntArray

#: Where a curve is sampled within every interval when another one is put through it.
SAMPLES = 6

#: Cells of the table of arc lengths in every interval.
_CELLS = 4

#: From so many points on, their feet are looked for by cells, and so many at a time.
_CELLS_FROM = 1 << 17

#: Speeds that differ less than this are left alone.
_UNEVEN = 1e-3


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
        return np.tensordot(MONOMIALS, windows, axes=1)

    @cached_property
    def arc_table(self) -> tuple[Array, Array, Array]:
        """See the function of this name."""
        places = np.arange(2 * _CELLS) / (2 * _CELLS)
        first = self.everywhere(places, 1)
        last = self(np.array([self.intervals]), 1).T
        speed = np.sqrt(np.append(column_dots(first, first), column_dots(last, last))) * self.step
        ends = speed[::2]
        cells = (ends[:-1] + 4.0 * speed[1::2] + ends[1:]) / (6.0 * _CELLS)
        grid = np.arange(len(ends)) / _CELLS
        return grid, np.concatenate([[0.0], np.cumsum(cells)]), ends

    def __call__(self, x: npt.ArrayLike, derivative: int = 0) -> Array:
        """f or its derivative with respect to arc length (that is, x times `step`): (K,) -> (K, 3)."""
        x = np.asarray(x, dtype=float)
        k = np.clip(x.astype(np.intp), 0, self.intervals - 1)
        rows: Array = self.at(k, x - k, derivative).T
        return rows

    def at(self, k: IntArray, t: Array, derivative: int = 0) -> Array:
        """The same at places t of intervals k, as columns: (K,), (K,) -> (3, K)."""
        a = np.take(self.pieces, k, axis=2)
        columns: Array
        if derivative == 0:
            columns = ((a[3] * t + a[2]) * t + a[1]) * t + a[0]
        elif derivative == 1:
            columns = ((3.0 * a[3] * t + 2.0 * a[2]) * t + a[1]) / self.step
        else:
            columns = (6.0 * a[3] * t + 2.0 * a[2]) / self.step**2
        return columns

    def everywhere(self, places: Array, derivative: int = 0) -> Array:
        """The same at the same places t of all intervals, in order: (P,) -> (3, n P)."""
        powers = np.zeros((len(places), 4))
        powers[:, 0] = derivative == 0
        for p in range(1, 4):
            factor = (p, p * (p - 1))[derivative - 1] if derivative else 1
            powers[:, p] = factor * places ** max(p - derivative, 0)
        values = np.tensordot(powers, self.pieces, axes=1) / self.step**derivative
        columns: Array = values.transpose(1, 2, 0).reshape(3, -1)
        return columns

    def curvature(self, places: Array) -> Array:
        """|f' x f''| / |f'|^3 (paper Eq. 16) at places t of all intervals, 1/m: (P,) -> (n P,)."""
        first, second = self.everywhere(places, 1), self.everywhere(places, 2)
        bend = np.cross(first, second, axis=0)
        kappa: Array = np.sqrt(column_dots(bend, bend)) / np.maximum(np.sqrt(column_dots(first, first)), 1e-9) ** 3
        return kappa


@lru_cache(maxsize=32)
def _interpolator(intervals: int, smoothing: float) -> tuple[Array, IntArray, Array]:
    """Factor of the least-squares fit of n + 3 coefficients to samples at the same places in every interval."""
    x = np.linspace(0.0, intervals, intervals * SAMPLES + 1)
    k = np.minimum(x.astype(np.intp), intervals - 1)
    values = spline_values(x - k)
    size = intervals + 3
    band = np.zeros((4, size))
    for d in range(4):
        for q in range(4 - d):
            band[d] += np.bincount(k + q, values[q] * values[q + d], minlength=size)
            band[d, q : q + intervals] += smoothing * THIRD_DIFFERENCE[q] * THIRD_DIFFERENCE[q + d]
    factor, info = dpbtrf(band, lower=1)
    if info:
        raise np.linalg.LinAlgError("the interpolation matrix is not positive definite")
    return factor, k, values


def through(samples: Array, intervals: int, step: float, smoothing: float = 0.0) -> TubeCurve:
    """The curve with n intervals closest to 6 n + 1 samples that are even in its parameter.

    Args:
        samples: (3, 6 n + 1), metres.
        intervals: n.
        step: arc length of an interval, metres.
        smoothing: weight of the third differences of the coefficients.
    """
    factor, k, values = _interpolator(intervals, smoothing)
    right = np.empty((intervals + 3, 3))
    for c in range(3):
        right[:, c] = sum(np.bincount(k + q, values[q] * samples[c], minlength=intervals + 3) for q in range(4))
    return TubeCurve(dpbtrs(factor, right, lower=1)[0], step)


def arc_table(curve: TubeCurve) -> tuple[Array, Array, Array]:
    """Arc length at 4 places per interval, by Simpson's rule.

    Returns:
        x (4 n + 1,), the arc length from x = 0 there, metres, and the speed |df/dx| there, metres.
    """
    return curve.arc_table


def arc_at(length: Array, x: Array) -> Array:
    """Arc length at places x of a curve, given its `arc_table`: (K,) -> (K,)."""
    at = x * _CELLS
    k = np.minimum(at.astype(np.intp), len(length) - 2)
    before = length[k]
    arc: Array = before + (at - k) * (length[k + 1] - before)
    return arc


def _inverse(grid: Array, length: Array, speed: Array, at: Array) -> Array:
    """x at given arc lengths, by cubic Hermite interpolation of the table.

    As `arc_length.interpolated`, which rounds in another order: with that one all lines differ in their last digits.
    """
    k, h, t = cells(length, at)
    slope = h / np.maximum(speed, 1e-9 * float(speed.max()))[np.stack([k, k + 1])]
    u = 1.0 - t
    x = grid[k] + t * t * (3.0 - 2.0 * t) / _CELLS + t * u * (u * slope[0] - t * slope[1])
    # A cusp can make the cubic leave its cell.
    inside: Array = np.clip(x, grid[k], grid[k + 1])
    return inside


def reparametrised(
    curve: TubeCurve, intervals: int | None = None, start: float = 0.0, end: float | None = None
) -> TubeCurve:
    """The same curve by arc length, on another grid of knots and between other ends.

    Args:
        curve: any curve.
        intervals: number of intervals; the curve's own by default.
        start, end: arc length, from the old start, of the new ends; beyond the old ones the curve goes on straight.
    """
    grid, length, speed = arc_table(curve)
    end = float(length[-1]) if end is None else end
    intervals = intervals or curve.intervals
    at = np.linspace(start, end, intervals * SAMPLES + 1)
    inside = np.clip(at, 0.0, length[-1])
    samples = curve(_inverse(grid, length, speed, inside)).T
    if start < 0.0 or end > length[-1]:
        tangent = curve(np.array([0.0, curve.intervals]), 1)
        tangent = unit(tangent)
        beyond = at - inside
        samples += np.where(beyond < 0.0, tangent[0][:, None], tangent[1][:, None]) * beyond
    return through(samples, intervals, (end - start) / intervals)


def evened(curve: TubeCurve) -> TubeCurve:
    """The curve by arc length, if its speed has come to differ; else the curve itself."""
    first = curve.everywhere(np.array([0.5]), 1)
    uneven = float(np.abs(column_dots(first, first) - 1.0).max())
    return reparametrised(curve) if uneven > 2.0 * _UNEVEN else curve


def from_polyline(points: Array, spacing: float, extension: float, smoothing: float) -> TubeCurve:
    """A smooth curve near a polyline, with straight extensions at both ends.

    Args:
        points: (K, 3) vertices in order, not all in one place, metres.
        spacing: wanted length of an interval, metres.
        extension: length added at either end, metres.
        smoothing: weight of the third differences.
    """
    points = points[np.concatenate([[True], segment_lengths(points) > 0.0])]
    length = arc_lengths(points)
    intervals = max(4, round(length[-1] / spacing))
    at = np.linspace(0.0, length[-1], intervals * SAMPLES + 1)
    curve = through(at_arc_lengths(points, length, at).T, intervals, float(length[-1]) / intervals, smoothing)
    total = float(arc_table(curve)[1][-1])
    return reparametrised(curve, max(4, round((total + 2.0 * extension) / spacing)), -extension, total + extension)


def nearest(curve: TubeCurve, points: Array, spacing: float) -> Array:
    """Foot parameter of the nearest of samples at most `spacing` apart: (3, M) -> (M,)."""
    per_interval = max(1, int(np.ceil(curve.step / spacing)))
    places = (np.arange(per_interval) + 0.5) / per_interval
    # Contiguous rows, since the query is slow on others.
    samples = np.ascontiguousarray(curve.everywhere(places).T)
    index = cKDTree(samples).query(np.ascontiguousarray(points.T))[1]
    foot: Array = (index + 0.5) / per_interval
    return foot


def nearest_by_cells(curve: TubeCurve, points: Array, spacing: float) -> Array:
    """`nearest` for many points: looked up for cubes of half that size; (3, M) -> (M,).

    Points near the border between two strands may be taken for the other one's; it is for points that a few Newton
    steps follow.
    """
    if points.shape[1] < _CELLS_FROM:
        return nearest(curve, points, spacing)
    size = 0.5 * spacing
    low = points.min(axis=1)
    shape = ((points.max(axis=1) - low) / size).astype(np.int64) + 1
    x = np.empty(points.shape[1])
    for first in range(0, len(x), _CELLS_FROM):
        part = slice(first, first + _CELLS_FROM)
        cell = ((points[:, part] - low[:, None]) / size).astype(np.int64)
        keys, back = np.unique((cell[0] * shape[1] + cell[1]) * shape[2] + cell[2], return_inverse=True)
        rest, z = np.divmod(keys, shape[2])
        centres = (np.stack([*np.divmod(rest, shape[1]), z]) + 0.5) * size + low[:, None]
        x[part] = nearest(curve, centres, spacing)[back]
    return x


def foot_points(curve: TubeCurve, points: Array, x: Array, steps: int = 1) -> tuple[Array, IntArray, Array, Array]:
    """Newton's method for the foot points: (p - f(x)) . f'(x) = 0, near given x.

    Args:
        curve: the curve.
        points: (3, M), metres.
        x: (M,) parameters to start from, in [0, n].
        steps: number of Newton steps, at least one.

    Returns:
        x (M,), an interval (M,), t with x = interval + t (M,) and the vectors p - f(x) (3, M). Feet are kept within the
        curve. After the last step t may lie just outside [0, 1]: the interval is the one before it, and the polynomial
        of that interval is followed beyond its end, which saves another look-up.
    """
    last = float(curve.intervals)
    for step in range(steps):
        k = np.minimum(x.astype(np.intp), curve.intervals - 1)
        t = x - k
        # Horner's scheme for f, f' and f'' / 2 at once (Knuth 4.6.4).
        a0, a1, a2, a3 = np.take(curve.pieces, k, axis=2)
        a3t = a3 * t
        a2 += a3t
        a1 += a2 * t
        a0 += a1 * t
        offset = np.subtract(points, a0, out=a0)
        a2 += a3t
        a1 += a2 * t
        a2 += a3t
        first, half = a1, a2
        speed = column_dots(first, first)
        # Inside a bend, far from the curve, the second derivative of the distance vanishes: keep the step finite.
        slope = np.maximum(speed - 2.0 * column_dots(offset, half), 0.25 * speed)
        move = np.clip(column_dots(offset, first) / np.maximum(slope, 1e-300), -1.0, 1.0)
        moved = np.clip(x + move, 0.0, last)
        if step == steps - 1:
            move = moved - x
            a3 *= move
            a3 += half
            a3 *= move
            a3 += first
            a3 *= move
            offset -= a3
            t += move
        x = moved
    return x, k, t, offset
