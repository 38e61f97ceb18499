"""Points spread evenly over triangles."""

from __future__ import annotations

import numpy as np

from dlogen.types import Array, IntArray

#: Steps of the additive sequence with the least discrepancy in two dimensions (Roberts 2018, R2): 1 / g and 1 / g^2 of
#: the plastic number g.
_R2 = 0.7548776662466927, 0.5698402909980532


def fan(corners: IntArray, counts: IntArray) -> IntArray:
    """Polygons cut into triangles that share the first corner of each.

    Args:
        corners: (sum of counts,) indices of vertices, polygon after polygon.
        counts: (P,) corners of each polygon; those with fewer than three make no triangle.

    Returns:
        (T, 3) indices of vertices.
    """
    pieces = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), pieces)
    start = (np.cumsum(counts) - counts)[polygon]
    within = np.arange(len(polygon)) - (np.cumsum(pieces) - pieces)[polygon]
    return np.stack([corners[start], corners[start + within + 1], corners[start + within + 2]], axis=1)


def triangle_areas(vertices: Array, triangles: IntArray) -> Array:
    """(T,) areas of triangles: (V, 3) vertices, (T, 3) indices of them."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    areas: Array = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas


def longest_edges(vertices: Array, triangles: IntArray) -> Array:
    """(T,) length of the longest edge of each triangle: (V, 3) vertices, (T, 3) indices of them."""
    corners = vertices[triangles]
    longest: Array = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return longest


def sample_triangles(vertices: Array, triangles: IntArray, count: int) -> Array:
    """Points spread evenly over triangles, as many on each as its area asks for; the same ones every time.

    Args:
        vertices: (V, 3) corners.
        triangles: (T, 3) indices of them.
        count: how many points.

    Returns:
        (count, 3) points on the triangles.

    Raises:
        ValueError: the triangles have no area.
    """
    area = np.cumsum(triangle_areas(vertices, triangles))
    if not (len(area) and area[-1] > 0.0):
        raise ValueError("the triangles have no area")
    index = np.arange(count)
    chosen = np.searchsorted(area, (index + 0.5) * (area[-1] / count), side="right")
    chosen = np.minimum(chosen, len(area) - 1)
    u, v = ((step * (index + 1.0)) % 1.0 for step in _R2)
    # The other half of the parallelogram is folded back.
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u)[:, None], np.where(over, 1.0 - v, v)[:, None]
    a, b, c = (vertices[triangles[chosen, corner]] for corner in range(3))
    points: Array = a + u * (b - a) + v * (c - a)
    return points
