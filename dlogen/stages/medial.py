"""From surface points to points near the axis, and from those to nodes on it: no order yet.

Where the surface is sampled densely enough for normals, points are projected by the radius (paper III.B, Eq. 4), which
brings strands apart that touch each other. Then the points, gathered in small cells, contract across the local
direction until they lie on a line (a mean shift across the line, in the manner of the L1-medial skeleton of Huang et
al., ACM TOG 32, 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from dlogen.model import Array, BoolArray, IntArray
from dlogen.stages.symmetric import smallest_axes

#: Reach of the neighbourhoods in radii, round by round: of nodes of projected points, which are near the axis from the
#: start, and of others, which are anywhere around the tube.
_SHARP = (2.0, 2.0, 2.0)
_BLUNT = (3.5, 2.5, 2.5)

#: Size of the cells that points are gathered in, in radii: projected points and others.
_SHARP_CELL, _BLUNT_CELL = 1.0, 1.5

#: Projected points for each radius of length that make others unnecessary.
_PLENTY = 5.0
#: Fewest points, itself included, that a point's normal is taken from.
_PATCH = 6


@dataclass(frozen=True, eq=False)
class Nodes:
    """Places near the axis.

    Attributes:
        position: (N, 3) metres.
        direction: (N, 3) unit tangents, of any sign.
        weight: (N,) number of points that each stands for.
        density: (N,) points for each radius of length around it.
    """

    position: Array
    direction: Array
    weight: Array
    density: Array


def axis_votes(points: Array, tree: cKDTree, radius: float, spacing: float) -> tuple[Array, BoolArray]:
    """Project points to the axis by the radius along their normals (Eq. 4), where they have enough neighbours.

    Args:
        points: (M, 3) metres.
        tree: of the points.
        radius: of the tube, metres.
        spacing: median distance between nearest neighbours, metres.

    Returns:
        votes: (M, 3) projected points, or the points themselves.
        projected: (M,) which.
    """
    # A disc of 4 spacings has some 11 points of a random surface; beyond 0.9 radii it is no plane any more.
    reach = float(np.clip(4.0 * spacing, 0.35 * radius, 0.9 * radius))
    moments = _sums(tree.query_pairs(reach, output_type="ndarray"), _moments(points))
    projected = moments[:, 0] >= _PATCH
    if projected.mean() < 0.5:
        # What they are in such a cloud is chance.
        projected[:] = False
        return points, projected
    normals = smallest_axes(_covariances(moments[projected]))
    inward = _local_centroids(points, radius, 2.0 * radius)[projected] - points[projected]
    normals *= np.where(np.einsum("mi,mi->m", normals, inward) > 0.0, -1.0, 1.0)[:, None]
    votes = points.copy()
    votes[projected] -= radius * normals
    return votes, projected


def contract(votes: Array, projected: BoolArray, radius: float, per_radius: float) -> Nodes:
    """Gather votes in cells and let these move across the local direction until they lie on a line.

    Votes without company, which strays are, become no nodes.

    Args:
        votes: (M, 3) what `axis_votes` gave, metres.
        projected: (M,) the same.
        radius: of the tube, metres.
        per_radius: points for each radius of length, of these M.
    """
    position, weight = cells(votes[projected], _SHARP_CELL * radius)[1:]
    blunt = np.zeros(len(position), dtype=bool)
    if not projected.all():
        # Points without a normal say nothing more where enough others have one.
        rest = votes[~projected]
        if len(position):
            enough = _density(position, weight, radius) > _PLENTY
            tree = cKDTree(position[enough]) if enough.any() else None
            if tree is not None:
                rest = rest[np.isinf(tree.query(rest, distance_upper_bound=1.5 * radius)[0])]
        dull, dull_weight = cells(rest, _BLUNT_CELL * radius)[1:]
        blunt = np.arange(len(position) + len(dull)) >= len(position)
        position, weight = np.concatenate([position, dull]), np.concatenate([weight, dull_weight])

    density = _density(position, weight, radius)
    kept = density > max(0.05 * per_radius, min(0.1 * per_radius, 0.6))
    position, weight, blunt, density = position[kept], weight[kept], blunt[kept], density[kept]
    if len(position) == 0:
        return Nodes(position, position, weight, density)

    # Where points are few, reach farther; but no farther than 98 in 100 nodes need, for every pair is looked at.
    stretch = np.clip(4.0 / density, 1.0, 2.0)
    stretch = np.minimum(stretch, np.quantile(stretch, 0.98)) * radius
    rounds = [np.where(blunt, b, s) for b, s in zip(_BLUNT, _SHARP, strict=True)]
    if not blunt.any():
        rounds = []
    # Nodes move by a radius or so: the pairs of the first round serve for all.
    widest = rounds[0] if rounds else np.full(len(position), _SHARP[-1])
    half = cKDTree(position).query_pairs(float((widest * stretch).max()), output_type="ndarray")
    pairs = np.concatenate([half, half[:, ::-1]])
    for factor in rounds:
        distance = _distances(position, pairs)
        direction = _directions(position, weight, pairs, distance, factor * stretch)
        shift = _local_means(position, weight, pairs, distance, (0.6 * factor + 0.1) * stretch) - position
        position = position + shift - np.einsum("ni,ni->n", shift, direction)[:, None] * direction
    distance = _distances(position, pairs)
    last = np.where(blunt, _BLUNT[-1], _SHARP[-1]) * stretch
    direction = _directions(position, weight, pairs, distance, last)
    return Nodes(position, direction, weight, density)


def recentre(line: Array, points: Array, tree: cKDTree, radius: float, per_radius: float) -> Array:
    """Move the vertices of a line across it so that the surface points around are one radius away.

    For clouds too sparse for normals: means of their points are off by 0.7 r / sqrt(count), and by 0.6 r where one side
    only was seen; this is neither. Each step solves the normal equations of sum w (|x| - r)^2 for the shift, x being
    the offset of a point across the line.

    Args:
        line: (K, 3) vertices about one radius apart, metres.
        points: (M, 3) surface points, metres.
        tree: of the points.
        radius: of the tube, metres.
        per_radius: points for each radius of length.

    Returns:
        (K, 3) vertices.
    """
    sparse = np.arange(len(line))
    if per_radius > 10.0:
        step = int(per_radius / 10.0)
        few = points[::step]
        line, count = _centring_steps(line, sparse, few, cKDTree(few) if step > 1 else tree, radius, 1.2, 1, 1)
        sparse = np.flatnonzero(count < 20.0)
    if len(sparse):
        reach = float(np.clip(6.0 / per_radius, 1.2, 2.0))
        line, _ = _centring_steps(line, sparse, points, tree, radius, reach, 4, 3)
    if per_radius < 10.0 and len(line) >= 8:
        # The last two vertices have points on one side of them only. Where these are few, straight on is better.
        for end in (line, line[::-1]):
            step = (end[5] - end[2]) / 3.0
            end[1], end[0] = end[2] - step, end[2] - 2.0 * step
    return line


def _centring_steps(
    line: Array, moving: IntArray, points: Array, tree: cKDTree, radius: float, reach: float, steps: int, pooling: int
) -> tuple[Array, Array]:
    """`recentre` for some of the vertices, by the points within `reach` radii along the line; and their numbers."""
    half = reach * radius
    near = cKDTree(line[moving]).sparse_distance_matrix(
        tree, float(np.hypot(half, 1.7 * radius)), output_type="ndarray"
    )
    row, column = moving[near["i"]], near["j"]
    count = len(line)
    line = line.copy()
    for _ in range(steps):
        tangent = np.gradient(line, axis=0)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-300)
        offset = points[column] - line[row]
        along = np.einsum("pi,pi->p", offset, tangent[row])
        offset -= along[:, None] * tangent[row]
        distance = np.sqrt(np.einsum("pi,pi->p", offset, offset))
        residual = distance - radius
        weight = np.maximum(1.0 - (along / half) ** 2, 0.0) ** 2 * np.maximum(1.0 - (residual / radius) ** 2, 0.0) ** 2
        offset /= np.maximum(distance, 1e-300)[:, None]
        x, y, z = offset.T
        wx, wy, wz = (weight * component for component in (x, y, z))
        sums = [np.bincount(row, term, count) for term in (wx * x, wx * y, wy * y, wx * z, wy * z, wz * z)]
        pulls = [np.bincount(row, term * residual, count) for term in (wx, wy, wz)]
        right: Array = np.array(pulls, dtype=float).T
        normal: Array = np.array(sums, dtype=float).T[:, [0, 1, 3, 1, 2, 4, 3, 4, 5]].reshape(-1, 3, 3)
        # Neighbours share what they know, which matters most where points are few. Half a point at rest holds what no
        # point does; along the line nothing is known at all.
        for _ in range(pooling):
            normal, right = _with_neighbours(normal), _with_neighbours(right)
        normal += 0.5 * np.eye(3) + 1e3 * tangent[:, :, None] * tangent[:, None, :]
        shift = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
        length = np.linalg.norm(shift, axis=1, keepdims=True)
        line += shift * np.minimum(1.0, 0.5 * radius / np.maximum(length, 1e-300))
    return line, np.bincount(row, minlength=count).astype(float)


def _with_neighbours(rows: Array) -> Array:
    """Weighted means 1 2 1 over neighbouring rows; the ends count twice."""
    padded = np.concatenate([rows[:1], rows, rows[-1:]])
    result: Array = 0.25 * (padded[:-2] + 2.0 * rows + padded[2:])
    return result


def cells(points: Array, size: float) -> tuple[IntArray, Array, Array]:
    """Group points by the cubes of a grid.

    Returns:
        of_point: (M,) the cell of each point.
        mean: (N, 3) centroid of each cell's points.
        count: (N,) how many there are.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros(0)
    grid = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    shape = grid.max(axis=0) + 1
    key = (grid[:, 0] * shape[1] + grid[:, 1]) * shape[2] + grid[:, 2]
    _, of_point, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(of_point, points[:, i]) for i in range(3)], axis=1) / count[:, None]
    return of_point, mean, count.astype(float)


def _moments(points: Array) -> Array:
    """Rows 1, x, y, z, xx, xy, yy, xz, yz, zz: (M, 3) -> (M, 10)."""
    x, y, z = points.T
    return np.stack([np.ones_like(x), x, y, z, x * x, x * y, y * y, x * z, y * z, z * z], axis=1)


def _covariances(sums: Array) -> Array:
    """Covariances from sums of `_moments`: (M, 10) -> (M, 3, 3)."""
    scaled = sums / np.maximum(sums[:, :1], 1e-300)
    mean = scaled[:, 1:4]
    second = scaled[:, [4, 5, 7, 5, 6, 8, 7, 8, 9]].reshape(-1, 3, 3)
    return second - mean[:, :, None] * mean[:, None, :]


def _sums(half: IntArray, features: Array) -> Array:
    """Sums of the rows of `features` over each point's neighbours and itself; pairs are listed once: (N, F)."""
    count = len(features)
    near = coo_matrix((np.ones(len(half)), (half[:, 0], half[:, 1])), shape=(count, count))
    result: Array = near @ features + near.T @ features + features
    return result


def _density(position: Array, weight: Array, radius: float) -> Array:
    """Points for each radius of length around each node."""
    half = cKDTree(position).query_pairs(2.0 * radius, output_type="ndarray")
    return _sums(half, weight[:, None])[:, 0] / 4.0


def _local_centroids(points: Array, size: float, reach: float) -> Array:
    """Centroid of the points around each point, by cells of the given size whose means lie within reach."""
    of_point, mean, count = cells(points, size)
    half = cKDTree(mean).query_pairs(reach, output_type="ndarray")
    sums = _sums(half, np.column_stack([mean, np.ones(len(mean))]) * count[:, None])
    return (sums[:, :3] / sums[:, 3:])[of_point]


def _distances(points: Array, pairs: IntArray) -> Array:
    offset = points[pairs[:, 0]] - points[pairs[:, 1]]
    return np.sqrt(np.einsum("pi,pi->p", offset, offset))


def _weighted_sums(features: Array, weight: Array, pairs: IntArray, distance: Array, reach: Array) -> Array:
    """Sums with the weights (1 - (d / reach)^2)^2 of the neighbours, times their number of points; and of itself."""
    ratio = distance / reach[pairs[:, 0]]
    inside = np.flatnonzero(ratio < 1.0)
    rows, columns = pairs[inside].T
    value = (1.0 - ratio[inside] ** 2) ** 2
    weighted = features * weight[:, None]
    near = coo_matrix((value, (rows, columns)), shape=(len(weight), len(weight)))
    result: Array = near @ weighted + weighted
    return result


def _directions(position: Array, weight: Array, pairs: IntArray, distance: Array, reach: Array) -> Array:
    """Principal directions of the neighbourhoods, (N, 3)."""
    return smallest_axes(-_covariances(_weighted_sums(_moments(position), weight, pairs, distance, reach)))


def _local_means(position: Array, weight: Array, pairs: IntArray, distance: Array, reach: Array) -> Array:
    sums = _weighted_sums(np.column_stack([position, np.ones(len(position))]), weight, pairs, distance, reach)
    return sums[:, :3] / sums[:, 3:]
