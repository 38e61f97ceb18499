"""Polylines, (K, 3) arrays of vertices in order: the piecewise-linear g(u) of the paper, sampling and distances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dlogen.geometry.vectors import dots
from dlogen.types import Array, IntArray

#: Consecutive points, and consecutive segments, that are put into one bounding sphere.
_TOGETHER = 64
#: Point-segment pairs that are worked on at a time: a few megabytes, which stay in the processor's cache.
_PAIRS = 1 << 17


def arc_lengths(points: npt.ArrayLike) -> Array:
    """Arc length from the first vertex to every vertex: (K, 3) -> (K,), metres, starting with 0."""
    return np.concatenate([[0.0], np.cumsum(segment_lengths(_vertices(points)))])


def segment_lengths(points: Array) -> Array:
    """Length of every segment of a polyline, or of many: (..., K, 3) -> (..., K - 1), metres."""
    lengths: Array = np.linalg.norm(np.diff(points, axis=-2), axis=-1)
    return lengths


def at_arc_lengths(points: Array, lengths: Array, at: Array) -> Array:
    """Points of a polyline at given arc lengths, those beyond an end at the end.

    Args:
        points: (K, 3) vertices, metres.
        lengths: (K,) their `arc_lengths`, metres.
        at: (M,) metres.

    Returns:
        (M, 3) metres.
    """
    return np.stack([np.interp(at, lengths, coordinate) for coordinate in points.T], axis=1)


def piecewise_linear(joints: npt.ArrayLike, u: npt.ArrayLike) -> Array:
    """The piecewise-linear curve g(u) through the joints (paper Eq. 12-14).

    Eq. 14 is corrected: the joint coordinates are u_i = sum_{j < i} |x_{j+1} - x_j| / L_sum, so that u_1 = 0. As
    printed it sums one segment more: the curve would start at u = l_1 / L_sum, and its last piece would lie beyond
    u = 1. With these u_i the slope printed in Eq. 13, (x_{i+1} - x_i) L_sum / |x_{i+1} - x_i|, is right:
    g_i(u_{i+1}) = x_{i+1}, and |dg/du| = L_sum everywhere, so that u is the arc length divided by L_sum.

    Args:
        joints: (n + 1, 3) the joints x_i, metres. Joints that coincide are passed over.
        u: (M,) coordinates, clamped to [0, 1].

    Returns:
        (M, 3) points, metres. The ends are exactly the first and the last joint.
    """
    joints = _vertices(joints)
    lengths = arc_lengths(joints)
    return at_arc_lengths(joints, lengths, np.atleast_1d(np.asarray(u, dtype=float)) * lengths[-1])


def resample(points: npt.ArrayLike, count: int) -> Array:
    """Points on a polyline, even in arc length: (K, 3) -> (count, 3), metres.

    The ends are those of the polyline, exactly; its inner vertices are in general not among the points, so the result
    is a little shorter where the polyline bends. A polyline without length gives `count` times its point.

    Raises:
        ValueError: `count` is less than 2.
    """
    if count < 2:
        raise ValueError(f"a polyline cannot be sampled by {count} points: at least 2 are needed")
    return piecewise_linear(points, np.linspace(0.0, 1.0, count))


def distance_to_polyline(points: npt.ArrayLike, polyline: npt.ArrayLike) -> tuple[Array, IntArray, Array]:
    """Distance of points to a polyline, and the foot points.

    Runs of segments and runs of points are kept in bounding spheres, so that points in order along a curve are tried
    against the segments around them only. Points in no order are tried against all. Memory is bounded.

    Args:
        points: (M, 3), finite, metres.
        polyline: (K, 3) vertices, K >= 1, metres. A single vertex is a segment without length.

    Returns:
        distance: (M,) to the nearest point of the polyline, metres.
        segment: (M,) index i of the segment that the foot point is on; the first of equally near ones.
        parameter: (M,) place t in [0, 1] of the foot point: polyline[i] + t (polyline[i + 1] - polyline[i]).
    """
    points, polyline = np.asarray(points, dtype=float), _vertices(polyline)
    start = polyline[:-1] if len(polyline) > 1 else polyline
    along = np.diff(polyline, axis=0) if len(polyline) > 1 else np.zeros_like(polyline)
    squared = dots(along, along)
    # A segment without length is its start, t = 0.
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > np.finfo(float).tiny)

    edges = np.arange(0, len(start), _TOGETHER)
    centre, radius = _bounding_spheres(np.stack([start, start + along]), edges)

    distance, parameter = np.empty(len(points)), np.empty(len(points))
    segment = np.empty(len(points), dtype=np.intp)
    for first in range(0, len(points), _TOGETHER):
        run = points[first : first + _TOGETHER]
        middle, reach = _bounding_spheres(run[None], np.array([0]))
        gap, spread = np.linalg.norm(centre - middle, axis=1), radius + reach
        possible = gap - spread <= (gap + spread).min() * (1.0 + 1e-9)
        among = np.flatnonzero(np.repeat(possible, _TOGETHER)[: len(start)])
        rows = max(1, _PAIRS // len(among))
        for begin in range(first, first + len(run), rows):
            part = slice(begin, min(begin + rows, first + len(run)))
            squares, t = _squared_distances(points[part], start[among], along[among], inverse[among])
            nearest = np.argmin(squares, axis=1)
            row = np.arange(len(nearest))
            distance[part], parameter[part] = np.sqrt(squares[row, nearest]), t[row, nearest]
            segment[part] = among[nearest]
    return distance, segment, parameter


def _bounding_spheres(ends: Array, edges: IntArray) -> tuple[Array, Array]:
    """Centres (B, 3) and radii (B,) of spheres around ends[:, edges[b]:edges[b + 1]]."""
    low = np.minimum.reduceat(ends.min(axis=0), edges)
    high = np.maximum.reduceat(ends.max(axis=0), edges)
    return (low + high) / 2.0, np.linalg.norm(high - low, axis=1) / 2.0


def _squared_distances(points: Array, start: Array, along: Array, inverse: Array) -> tuple[Array, Array]:
    """Squared distance of every point to every segment, and the foot point's parameter, (M, S) each."""
    # One array per coordinate: contiguous. Differences before squares keep the precision far from the origin.
    x, y, z = (points[:, None, c] - start[:, c] for c in range(3))
    t = np.clip((x * along[:, 0] + y * along[:, 1] + z * along[:, 2]) * inverse, 0.0, 1.0)
    return (x - t * along[:, 0]) ** 2 + (y - t * along[:, 1]) ** 2 + (z - t * along[:, 2]) ** 2, t


def hausdorff(a: npt.ArrayLike, b: npt.ArrayLike, samples: int = 1000) -> float:
    """Hausdorff distance between two polylines, metres: the farthest that a point of one is from the other.

    Measured from the vertices of either and from `samples` points even in arc length, to the segments of the other.
    Exact where the farthest point is a vertex, which it is unless it is equally far from two segments of the other
    polyline; too small by half the sample spacing at the very most.
    """
    return max(float(distance_to_polyline(_densified(x, samples), y)[0].max()) for x, y in ((a, b), (b, a)))


def _densified(points: npt.ArrayLike, samples: int) -> Array:
    return np.concatenate([_vertices(points), resample(points, samples)])


def _vertices(points: npt.ArrayLike) -> Array:
    vertices = np.asarray(points, dtype=float)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
        raise ValueError(f"a polyline is an array of shape (K, 3) with K >= 1, not {vertices.shape}")
    if not np.isfinite(vertices).all():
        raise ValueError("a polyline has coordinates that are not finite")
    return vertices
