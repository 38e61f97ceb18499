"""Arc length of parametric curves: lengths, tables and even sampling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlogen.types import Array, Skeleton

#: Intervals of [0, 1] for the quadrature; with 5 Gauss points each, cables come out to about 1e-12 of their length.
_INTERVALS = 512


def arc_length_table(line: Skeleton | Callable[..., Array], intervals: int = _INTERVALS) -> tuple[Array, Array]:
    """Arc length from s = 0, by Gauss-Legendre quadrature of |f'(s)|.

    Args:
        line: f with f(s, derivative), s in [0, 1].
        intervals: number of equal intervals of s.

    Returns:
        (intervals + 1,) values of s and the arc length there, metres.
    """
    node, weight = np.polynomial.legendre.leggauss(5)
    width = 1.0 / intervals
    s = (np.arange(intervals)[:, None] + 0.5 + 0.5 * node) * width
    speed = np.linalg.norm(line(s.ravel(), 1), axis=1).reshape(s.shape)
    grid = np.linspace(0.0, 1.0, intervals + 1)
    return grid, np.concatenate([[0.0], np.cumsum(speed @ weight * (0.5 * width))])


def arc_length(line: Skeleton | Callable[..., Array]) -> float:
    """Arc length of f over [0, 1], metres."""
    return float(arc_length_table(line)[1][-1])


def even_parameters(line: Skeleton | Callable[..., Array], count: int) -> Array:
    """(count,) values of s from 0 to 1 whose points are even in arc length.

    Within an interval of the table the inverse is a cubic Hermite one (the slope ds/dl = 1/|f'| is known).
    """
    grid, length = arc_length_table(line)
    target = np.linspace(0.0, length[-1], count)
    if length[-1] <= 0.0:
        return np.linspace(0.0, 1.0, count)
    slope = 1.0 / np.maximum(np.linalg.norm(line(grid, 1), axis=1), 1e-12 * length[-1])
    k = np.clip(np.searchsorted(length, target, side="right") - 1, 0, len(grid) - 2)
    h = np.maximum(length[k + 1] - length[k], 1e-300)
    t = np.clip((target - length[k]) / h, 0.0, 1.0)
    s = (
        (1 + 2 * t) * (1 - t) ** 2 * grid[k]
        + t * (1 - t) ** 2 * h * slope[k]
        + t * t * (3 - 2 * t) * grid[k + 1]
        - t * t * (1 - t) * h * slope[k + 1]
    )
    # A cusp can make the cubic overshoot its interval.
    s = np.clip(s, grid[k], grid[k + 1])
    s[0], s[-1] = 0.0, 1.0
    result: Array = s
    return result
