"""Whether points come in the order of a curve."""

from __future__ import annotations

import numpy as np

from dlogen.errors import InputError
from dlogen.geometry.polyline import segment_lengths
from dlogen.types import Array
from dlogen.types.texts import millimetres

#: A step along an ordered polyline is about as long as the way to the nearest vertex, in a cloud it is far longer.
_DISORDER = 20.0


_FEWEST_TO_JUDGE = 100


def in_order(points: Array) -> Array:
    """The points, unless they jump about like those of a cloud."""
    if len(points) < _FEWEST_TO_JUDGE or not np.isfinite(points).all():
        return points
    from scipy.spatial import cKDTree

    step = float(np.median(segment_lengths(points)))
    nearest = float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))
    if step > _DISORDER * nearest:
        raise InputError(
            f"the points are in no order: from one to the next it is {millimetres(step)}, to the nearest "
            f"{millimetres(nearest)} (medians)",
            "a curve needs its points in order; of a point cloud make a chain first: dlogen fit",
        )
    return points
