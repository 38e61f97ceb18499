"""Straight segments: the foot points of other points on them, and the distances.

Not here are the nearest of many segments (`dlogen.geometry.polyline`, which skips those that are far away) and the
squared distances of millions of places, which are worked out in place (`dlogen.stages.segmentation.curve_table`).
"""

from __future__ import annotations

import numpy as np

from dlogen.geometry.vectors import dots
from dlogen.types import Array


def places(offset: Array, axis: Array) -> Array:
    """Where on segments the foot points are: 0 is the start, 1 the end. Arrays that broadcast to (..., 3) -> (...,).

    Args:
        offset: from the start of the segment to the point, metres.
        axis: from the start to the end, metres. On a segment without length the foot is its start.
    """
    place: Array = np.clip(dots(offset, axis) / np.maximum(dots(axis, axis), 1e-300), 0.0, 1.0)
    return place


def feet(points: Array, start: Array, axis: Array) -> tuple[Array, Array]:
    """Foot points on segments from start to start + axis. All broadcast to (..., 3), metres.

    Columns, (3, ...), may be given as views with the coordinates last (`np.moveaxis`); the results are such views then.

    Returns:
        place: (...,) on the segment: 0 is the start, 1 the end.
        offset: (..., 3) from the foot to the point, metres.
    """
    offset = points - start
    place = places(offset, axis)
    offset -= place[..., None] * axis
    return place, offset


def distances(points: Array, start: Array, end: Array) -> Array:
    """Distances of points to segments, metres: arrays that broadcast to (..., 3) -> (...,)."""
    distance: Array = np.linalg.norm(feet(points, start, end - start)[1], axis=-1)
    return distance
