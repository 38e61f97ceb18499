"""The sorting walk: an order of the projected points along the object (paper III.B, Eq. 5-6, Fig. 3)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.types import Array, SortedPoints


def local_direction(normals: Array) -> Array:
    """The direction that is most nearly perpendicular to all normals (Eq. 6).

    It is the right singular vector of the stacked normals with the smallest singular value; taken here from the
    3 x 3 matrix N^T N, which has the same one.

    Args:
        normals: (K, 3) unit normals.

    Returns:
        (3,) unit vector d; its sign is arbitrary.
    """
    direction: Array = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    return direction


def choose_search_radius(points: Array, radius: float) -> float:
    """r_n for `auto`: twice the diameter, more where the points are sparse.

    The paper's experiment has 8 r (Table III); its results do not change between 3 r and 8 r, and the smaller one
    keeps more distance to other strands.

    Args:
        points: (M, 3) the cloud, metres.
        radius: of the object, metres.
    """
    sample = points[:: max(1, len(points) // 1000)]
    spacing = float(np.median(cKDTree(points).query(sample, min(9, len(points)))[0][:, -1]))
    return max(4.0 * radius, 3.0 * spacing)


def choose_start(projected: Array) -> int:
    """The point nearest the median of the cloud: the order of the points in the file has no influence on it."""
    return int(np.argmin(np.sum((projected - np.median(projected, axis=0)) ** 2, axis=1)))


def sort_points(projected: Array, normals: Array, search_radius: float, start: int | None = None) -> SortedPoints:
    """Walk along the object from a start point, in both directions (Eq. 5-6).

    At each stop p_0 the points within `search_radius` (Eq. 5) that are ahead are projected onto the line through
    p_0 along the local direction (Eq. 6), which gives their coordinate; the one farthest ahead is the next stop. The
    walk ends where nothing new is ahead.

    Args:
        projected: (M, 3) projected points, metres.
        normals: (M, 3) their unit normals.
        search_radius: r_n, metres; larger than the diameter.
        start: index of the first stop; `choose_start` if not given.

    Returns:
        The order and the coordinates, scaled to [0, 1] over the points that the walk reached.
    """
    tree = cKDTree(projected)
    start = choose_start(projected) if start is None else start
    coordinate = np.full(len(projected), np.nan)
    ball = np.asarray(tree.query_ball_point(projected[start], search_radius))
    direction = local_direction(normals[ball])
    # Which end comes first is arbitrary, but must not depend on rounding or on the linear algebra library.
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    along = (projected[ball] - projected[start]) @ direction
    coordinate[ball] = along
    for sign in (1.0, -1.0):
        stop = int(ball[np.argmax(sign * along)])
        _walk(tree, projected, normals, search_radius, stop, sign * direction, sign, coordinate)
    reached = np.flatnonzero(np.isfinite(coordinate))
    # Ties are broken by place, not by index: the order of the points in the file must not show.
    order = reached[np.lexsort((*projected[reached].T, coordinate[reached]))]
    first, last = coordinate[order[0]], coordinate[order[-1]]
    length = float(last - first)
    s = (coordinate[order] - first) / length if length > 0.0 else np.zeros(len(order))
    return SortedPoints(order, s, length, np.flatnonzero(np.isnan(coordinate)))


def _walk(
    tree: cKDTree,
    projected: Array,
    normals: Array,
    search_radius: float,
    stop: int,
    heading: Array,
    sign: float,
    coordinate: Array,
) -> None:
    """Go on from `stop` until nothing new is ahead; writes to `coordinate`, which grows in steps of `sign`."""
    while True:
        ball = np.asarray(tree.query_ball_point(projected[stop], search_radius))
        direction = local_direction(normals[ball])
        if direction @ heading < 0.0:
            direction = -direction
        along = (projected[ball] - projected[stop]) @ direction
        new = np.isnan(coordinate[ball])
        coordinate[ball[new]] = coordinate[stop] + sign * along[new]
        ahead = new & (along > 0.0)
        if not ahead.any():
            return
        stop = int(ball[ahead][np.argmax(along[ahead])])
        heading = direction
