"""Normal equations of the tube fit, summed over points, in band storage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np

from dlogen.geometry.spline import spline_values
from dlogen.types import Array, IntArray

#: Points that are summed at a time: they stay in the processor's cache.
_CHUNK = 1 << 13


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of one linearisation, summed over points.

    Attributes:
        blocks: (n, 12, 12) of the coefficients of each interval: sum of w a a^T, a_(j, c) = B_j(t) e_c.
        right: (n, 12) sum of w a d, with d = |p - f| - rho.
        radius: (n, 12) sum of w a.
        weight: sum of w.
        residual: sum of w d.
        squares: sum of w d^2.
        count: number of observations that they are worth: sum of w, unless neighbours share their noise.
    """

    blocks: Array
    right: Array
    radius: Array
    weight: float
    residual: float
    squares: float
    count: float

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(
            self.blocks + other.blocks,
            self.right + other.right,
            self.radius + other.radius,
            self.weight + other.weight,
            self.residual + other.residual,
            self.squares + other.squares,
            self.count + other.count,
        )

    def scaled(self, weight: float, count: float) -> NormalEquations:
        """With all weights times one factor, and the number of observations times another."""
        return NormalEquations(
            self.blocks * weight,
            self.right * weight,
            self.radius * weight,
            self.weight * weight,
            self.residual * weight,
            self.squares * weight,
            self.count * count,
        )


def normal_equations(
    k: IntArray, t: Array, direction: Array, residual: Array, weight: Array, intervals: int
) -> NormalEquations:
    """Sum the normal equations of points: see `NormalEquations`. Directions (3, M), the others (M,)."""
    if len(k) > 2 * _CHUNK:
        chunks = [slice(first, first + _CHUNK) for first in range(0, len(k), _CHUNK)]
        parts = (normal_equations(k[c], t[c], direction[:, c], residual[c], weight[c], intervals) for c in chunks)
        return reduce(NormalEquations.__add__, parts)
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
    return NormalEquations(
        np.ascontiguousarray(sums[:, :12, :12]),
        sums[:, :12, 13].copy(),
        sums[:, :12, 12].copy(),
        float(total[0, 0]),
        float(total[0, 1]),
        float(total[1, 1]),
        float(total[0, 0]),
    )


@lru_cache(maxsize=32)
def _band_index(intervals: int) -> tuple[IntArray, IntArray, IntArray]:
    """Where the lower triangles of the blocks go in LAPACK's lower band storage, and the entries of a vector."""
    a, b = np.tril_indices(12)
    start = 3 * np.arange(intervals)[:, None]
    size = 3 * (intervals + 3)
    return a * 12 + b, ((a - b) * size + start + b).ravel(), (start + np.arange(12)).ravel()


def band(blocks: Array) -> Array:
    """(12, 3 N) lower band storage of the sum of overlapping blocks (n, 12, 12)."""
    inside, at, _ = _band_index(len(blocks))
    size = 3 * (len(blocks) + 3)
    band = np.bincount(at, blocks.reshape(-1, 144)[:, inside].ravel(), minlength=12 * size)
    return band.reshape(12, size).astype(float, copy=False)


def vector(parts: Array) -> Array:
    """(3 N,) sum of overlapping parts (n, 12)."""
    return np.bincount(_band_index(len(parts))[2], parts.ravel(), minlength=3 * (len(parts) + 3)).astype(
        float, copy=False
    )
