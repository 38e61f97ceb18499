"""Distance of the cloud's points to the tube around the skeleton line: how well the model explains the data."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.segments import feet
from dlogen.types import Array, Residual, Skeleton


def foot_points(points: Array, line: Skeleton, samples: int = 1000) -> tuple[Array, Array]:
    """The nearest place of the skeleton line for each point.

    The nearest of many samples, then its neighbouring pieces as chords; with 1,000 samples on a cable the chords are
    within micrometres of the line.

    Args:
        points: (M, 3) metres.
        line: the skeleton line.
        samples: number of samples, even in arc length.

    Returns:
        (M,) coordinates s in [0, 1] and (M,) distances to the line, metres.
    """
    s = even_parameters(line, samples)
    vertices = line(s)
    nearest = cKDTree(vertices).query(points)[1]
    best = np.full(len(points), np.inf)
    where = np.zeros(len(points))
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, samples - 2)):
        t, offset = feet(points, vertices[first], vertices[first + 1] - vertices[first])
        distance = np.linalg.norm(offset, axis=1)
        closer = distance < best
        best[closer] = distance[closer]
        where[closer] = (s[first] + t * (s[first + 1] - s[first]))[closer]
    return where, best


def tube_residual(distance: Array, radius: float) -> Residual:
    """Root mean square and median of | distance to the line - radius |.

    Args:
        distance: (M,) distances of the points to the skeleton line, metres.
        radius: of the tube, metres.
    """
    error = np.abs(distance - radius)
    return Residual(float(np.sqrt(np.mean(error**2))), float(np.median(error)), radius)
