"""From surface points to points near the axis, and from those to nodes on it: no order yet.

Where the surface is sampled densely enough for normals, points are projected by the radius (paper III.B, Eq. 4), which
brings strands apart that touch each other. Then the points, gathered in small cells, contract across the local
direction until they lie on a line (a mean shift across the line, in the manner of the L1-medial skeleton of Huang et
al., ACM TOG 32, 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from dlogen.model import Array, BoolArray, IntArray

#: Reach of the neighbourhoods in radii, round by round: of nodes of projected points, which are near the axis from the
#: start, and of others, which are anywhere around the tube.
_SHARP = (2.0, 1.6, 1.6, 1.6)
_BLUNT = (3.5, 3.0, 2.5, 2.5)

#: Fewest points, itself included, that a point's normal is taken from.
_PATCH = 6


@dataclass(frozen=True, eq=False)
class Nodes:
    """Places near the axis.

    Attributes:
        position: (N, 3) metres.
        direction: (N, 3) unit tangents, of any sign.
        weight: (N,) number of points that each stands for.
        linearity: (N,) share of the variance around the node that is along the direction: 1 on a line, 1/2 on a
            crossing.
        of_point: (M,) the node of each point, -1 for none.
    """

    position: Array
    direction: Array
    weight: Array
    linearity: Array
    of_point: IntArray


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
    near = _neighbours(tree, reach)
    moments = near @ _moments(points)
    projected = moments[:, 0] >= _PATCH
    if not projected.any():
        return points, projected
    normals = smallest_axes(_covariances(moments[projected]))
    inward = _local_centroids(points, 1.0 * radius, 2.0 * radius)[projected] - points[projected]
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
    sparse = float(projected.mean()) < 0.5
    size = 0.8 * radius * float(np.clip(8.0 / per_radius, 1.0, 1.8)) if sparse else 0.5 * radius
    of_point, position, weight = cells(votes, size)
    blunt = np.bincount(of_point, projected) < 0.5 * weight

    # How many points there are for each radius of length, seen from each node.
    density = (_neighbours(cKDTree(position), 2.0 * radius) @ weight) / 4.0
    lonely = density < max(0.05 * per_radius, 0.6)
    number = np.cumsum(~lonely) - 1
    of_point = np.where(lonely, -1, number)[of_point]
    position, weight, blunt, density = position[~lonely], weight[~lonely], blunt[~lonely], density[~lonely]
    if len(position) == 0:
        return Nodes(position, position, weight, weight, of_point)

    stretch = np.where(blunt, np.clip(8.0 / density, 1.0, 2.5), 1.0) * radius
    rounds = [np.where(blunt, b, s) for b, s in zip(_BLUNT, _SHARP, strict=True)]
    if not blunt.any():
        rounds = rounds[:2]
    # Nodes move by a radius or so: the pairs of the first round serve for all.
    pairs = _pairs(position, float((rounds[0] * stretch).max()))
    for factor in rounds:
        distance = _distances(position, pairs)
        direction, _ = _directions(position, weight, pairs, distance, factor * stretch)
        kernel = _kernel(pairs, distance, np.minimum(factor, 0.6 * factor + 0.2) * stretch, weight)
        sums = kernel @ np.column_stack([position, np.ones(len(position))])
        shift = sums[:, :3] / sums[:, 3:] - position
        position = position + shift - np.einsum("ni,ni->n", shift, direction)[:, None] * direction
    distance = _distances(position, pairs)
    direction, linearity = _directions(position, weight, pairs, distance, rounds[-1] * stretch)
    return Nodes(position, direction, weight, linearity, of_point)


def cells(points: Array, size: float) -> tuple[IntArray, Array, Array]:
    """Group points by the cubes of a grid.

    Returns:
        of_point: (M,) the cell of each point.
        mean: (N, 3) centroid of each cell's points.
        count: (N,) how many there are.
    """
    grid = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    shape = grid.max(axis=0) + 1
    key = (grid[:, 0] * shape[1] + grid[:, 1]) * shape[2] + grid[:, 2]
    _, of_point, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(of_point, points[:, i]) for i in range(3)], axis=1) / count[:, None]
    return of_point, mean, count.astype(float)


def smallest_axes(covariance: Array) -> Array:
    """Unit eigenvectors of the smallest eigenvalues of symmetric matrices: (N, 3, 3) -> (N, 3).

    In closed form, which is five times faster than `numpy.linalg.eigh` and as good where the smallest eigenvalue is
    apart from the others; where it is not, any vector will come out.
    """
    a, b, c = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 2, 2]
    d, e, f = covariance[:, 0, 1], covariance[:, 0, 2], covariance[:, 1, 2]
    mean = (a + b + c) / 3.0
    ra, rb, rc = a - mean, b - mean, c - mean
    size = np.sqrt((ra * ra + rb * rb + rc * rc + 2.0 * (d * d + e * e + f * f)) / 6.0)
    det = ra * (rb * rc - f * f) - d * (d * rc - f * e) + e * (d * f - rb * e)
    half = np.clip(det / np.maximum(2.0 * size**3, 1e-300), -1.0, 1.0)
    smallest = 2.0 * size * np.cos(np.arccos(half) / 3.0 + 2.0 * np.pi / 3.0)
    # The rows of A - lambda I span the plane across the vector: take the largest of their cross products.
    ra, rb, rc = ra - smallest, rb - smallest, rc - smallest
    products = np.stack(
        [
            np.stack([d * f - e * rb, e * d - ra * f, ra * rb - d * d], axis=1),
            np.stack([d * rc - e * f, e * e - ra * rc, ra * f - d * e], axis=1),
            np.stack([rb * rc - f * f, f * e - d * rc, d * f - rb * e], axis=1),
        ],
        axis=1,
    )
    squared = np.einsum("nij,nij->ni", products, products)
    each, best = np.arange(len(covariance)), np.argmax(squared, axis=1)
    norm = np.sqrt(squared[each, best])
    axis: Array = products[each, best] / np.maximum(norm, 1e-300)[:, None]
    axis[norm == 0.0] = (0.0, 0.0, 1.0)
    return axis


def _neighbours(tree: cKDTree, reach: float) -> csr_matrix:
    """(N, N) ones for pairs within reach, the diagonal included."""
    pairs = tree.query_pairs(reach, output_type="ndarray")
    each = np.arange(tree.n)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], each])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], each])
    return csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(tree.n, tree.n))


def _pairs(points: Array, reach: float) -> IntArray:
    """(P, 2) indices of pairs within reach, both ways, and each with itself."""
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    each = np.arange(len(points))
    return np.concatenate([pairs, pairs[:, ::-1], np.stack([each, each], axis=1)])


def _distances(points: Array, pairs: IntArray) -> Array:
    offset = points[pairs[:, 0]] - points[pairs[:, 1]]
    return np.sqrt(np.einsum("pi,pi->p", offset, offset))


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


def _local_centroids(points: Array, size: float, reach: float) -> Array:
    """Centroid of the points around each point, by cells of the given size whose means lie within reach."""
    of_point, mean, count = cells(points, size)
    near = _neighbours(cKDTree(mean), reach)
    total = near @ count
    return ((near @ (mean * count[:, None])) / total[:, None])[of_point]


def _kernel(pairs: IntArray, distance: Array, reach: Array, weight: Array) -> csr_matrix:
    """Weights (1 - (d / reach)^2)^2 of the neighbours within the reach of each node, times their number of points."""
    ratio = distance / reach[pairs[:, 0]]
    inside = np.flatnonzero(ratio < 1.0)
    rows, columns = pairs[inside].T
    value = (1.0 - ratio[inside] ** 2) ** 2 * weight[columns]
    return csr_matrix((value, (rows, columns)), shape=(len(weight), len(weight)))


def _directions(position: Array, weight: Array, pairs: IntArray, distance: Array, reach: Array) -> tuple[Array, Array]:
    """Principal directions of the neighbourhoods, and their share of the variance."""
    covariance = _covariances(_kernel(pairs, distance, reach, weight) @ _moments(position))
    values, vectors = np.linalg.eigh(covariance)
    return vectors[:, :, 2], values[:, 2] / np.maximum(values.sum(axis=1), 1e-300)
