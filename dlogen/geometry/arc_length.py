"""Arc length of parametric curves: lengths, tables and even sampling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlogen.types import Array, IntArray, Skeleton

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
    s = interpolated(grid, slope, *cells(length, target))
    s[0], s[-1] = 0.0, 1.0
    return s


def cells(length: Array, at: Array) -> tuple[IntArray, Array, Array]:
    """Where arc lengths are in a table of them.

    Args:
        length: (K,) the table, not decreasing, metres.
        at: (M,) metres, from the first to the last of the table.

    Returns:
        (M,) the cell of each, its width in metres, and the place in it from 0 to 1.
    """
    k = np.clip(np.searchsorted(length, at, side="right") - 1, 0, len(length) - 2)
    width = np.maximum(length[k + 1] - length[k], 1e-300)
    return k, width, np.clip((at - length[k]) / width, 0.0, 1.0)


def interpolated(parameter: Array, slope: Array, k: IntArray, width: Array, t: Array) -> Array:
    """The parameter of a curve at places in the `cells` of its table of arc lengths, by cubic Hermite polynomials.

    Args:
        parameter: (K,) of the table, increasing.
        slope: (K,) its derivative with respect to the arc length, 1/m.
        k, width, t: (M,) cells, their widths in metres, places in them.

    Returns:
        (M,) parameters. A cusp could make the cubic overshoot its cell: it is kept within.
    """
    low, high = parameter[k], parameter[k + 1]
    value = (
        (1 + 2 * t) * (1 - t) ** 2 * low
        + t * (1 - t) ** 2 * width * slope[k]
        + t * t * (3 - 2 * t) * high
        - t * t * (1 - t) * width * slope[k + 1]
    )
    result: Array = np.clip(value, low, high)
    return result
