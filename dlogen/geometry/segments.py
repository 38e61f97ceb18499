"""Straight segments: the foot points of other points on them, and the distances.

`dlogen.geometry.polyline` finds the nearest of many segments; `dlogen.stages.segmentation.curve_table` has the squared
distances of millions of places in place, for the cache.
"""

from __future__ import annotations

import numpy as np

from dlogen.geometry.vectors import dots
from dlogen.types import Array


def feet(points: Array, start: Array, axis: Array) -> tuple[Array, Array]:
    """Nearest places of segments, each from its start to start + axis, to points. All broadcast to (..., 3).

    Columns, (3, ...), may be given as views (`np.moveaxis`); they are as fast then, and so are the results.

    Args:
        points: metres.
        start: metres.
        axis: from the first to the last end, metres. A segment without length is its start.

    Returns:
        t: (...,) the place on the segment: 0 is its start, 1 its end.
        offset: (..., 3) from the foot to the point, metres.
    """
    offset = points - start
    t = np.clip(dots(offset, axis) / np.maximum(dots(axis, axis), 1e-300), 0.0, 1.0)
    offset -= t[..., None] * axis
    return t, offset


def distances(points: Array, start: Array, end: Array) -> Array:
    """Distances of points to segments, metres: arrays that broadcast to (..., 3) -> (...,)."""
    distance: Array = np.linalg.norm(feet(points, start, end - start)[1], axis=-1)
    return distance
