"""Subsets of point sets that are the same for every order of the points."""

from __future__ import annotations

import numpy as np

from dlogen.types import Array, IntArray


def spatial_sample(points: Array, count: int) -> IntArray:
    """Indices of a subset of about `count` points that depends on the points alone, not on their order.

    A point is taken if a hash of its coordinates falls below a threshold. Exact duplicates are taken once. The indices
    are in lexicographic order of the coordinates, so that whatever is computed from them in sequence is the same for
    every order of the input, to the last bit.

    Args:
        points: (M, 3) the cloud.
        count: about how many; all if there are not more.

    Returns:
        (K,) indices.
    """
    index = thinned(points, count)
    first = points[index, 0]
    order = np.argsort(first)
    first = first[order]
    if (first[1:] != first[:-1]).all():
        return index[order]
    chosen = points[index]
    order = np.lexsort(chosen.T[::-1])
    chosen = chosen[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (chosen[1:] != chosen[:-1]).any(axis=1)
    return index[order[fresh]]


def thinned(points: Array, count: int) -> IntArray:
    """Indices, ascending, of about `count` points; which ones depends on each point alone, not on their order.

    Args:
        points: (M, 3) the cloud.
        count: about how many; all if there are not more.
    """
    if len(points) <= count:
        return np.arange(len(points))
    share, block = count / len(points), 65536
    return np.concatenate(
        [
            start + np.flatnonzero(position_hash(points[start : start + block]) < share)
            for start in range(0, len(points), block)
        ]
    )


def position_hash(points: Array) -> Array:
    """A number in [0, 1) for each point, as good as random, from the bits of its coordinates (splitmix64 finaliser)."""
    # Adding zero turns -0.0 into 0.0, which has other bits.
    bits = (np.ascontiguousarray(points, dtype=np.float64) + 0.0).view(np.uint64)
    value = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for column, factor in ((1, 0xBF58476D1CE4E5B9), (2, 0x94D049BB133111EB)):
        value ^= value >> np.uint64(31)
        value += bits[:, column]
        value *= np.uint64(factor)
    value ^= value >> np.uint64(29)
    value *= np.uint64(0xBF58476D1CE4E5B9)
    value ^= value >> np.uint64(32)
    shares: Array = (value >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return shares


def middle(points: Array) -> Array:
    """The middle of the box around points: (M, 3) -> (3,)."""
    columns = points.T.copy()  # numpy is slow along short rows
    result: Array = 0.5 * (columns.min(axis=1) + columns.max(axis=1))
    return result
