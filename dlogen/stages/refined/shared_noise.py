"""How much noise neighbouring points share: what many of them are worth."""

from __future__ import annotations

import numpy as np

from dlogen.types import Array, BoolArray, IntArray

#: Lengths of the blocks whose means are looked at, in radii.
_BLOCKS = (0.5, 1.0, 2.0, 4.0, 8.0)

#: Blocks that are needed to tell a variance, and points that a block needs.
_FEWEST_BLOCKS, _FEWEST = 12, 3


def inflation(s: Array, residual: Array, radius: float) -> float:
    """Variance of means of residuals along a line, over that of means of as many independent ones.

    Independent residuals have means over n of them with 1 / n of their variance. Those of a depth camera do not:
    neighbouring pixels are off by the same. Blocks longer than what they share show all of it.

    Args:
        s: (K,) places along the line, metres.
        residual: (K,) metres.
        radius: of the object, metres.

    Returns:
        The largest ratio over blocks of half a radius to eight radii: one for independent residuals.
    """
    if len(s) < _FEWEST_BLOCKS * _FEWEST:
        return 1.0
    residual = residual - np.median(residual)
    limit = 4.0 * 1.4826 * float(np.median(np.abs(residual)))
    residual = np.clip(residual, -limit, limit)
    variance = float(np.mean(residual**2))
    if not variance > 0.0:
        return 1.0
    largest = 1.0
    for length in _BLOCKS:
        block = ((s - s.min()) / (length * radius)).astype(np.intp)
        count = np.bincount(block)
        total = np.bincount(block, residual)
        full = count >= _FEWEST
        if full.sum() < _FEWEST_BLOCKS:
            break
        largest = max(largest, float(np.mean(total[full] ** 2 / count[full])) / variance)
    return largest


#: Size of the patches of a surface, in radii.
PATCH = 0.7


def patch_inflation(patch: IntArray, residual: Array, inside: BoolArray) -> float:
    """The same for patches of a surface: variance of their means over that of means of independent residuals.

    Args:
        patch: (M,) the patch that each point belongs to.
        residual: (M,) metres.
        inside: (M,) which points count.

    Returns:
        At least one.
    """
    patch, residual = patch[inside], residual[inside]
    residual = residual - np.median(residual)
    variance = float(np.mean(residual**2))
    count = np.bincount(patch)
    full = count >= _FEWEST
    if full.sum() < _FEWEST_BLOCKS or not variance > 0.0:
        return 1.0
    means = np.bincount(patch, residual)[full] ** 2 / count[full]
    return max(1.0, float(np.mean(means)) / variance)
