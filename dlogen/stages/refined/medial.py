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

from dlogen.geometry.eigen3 import products, smallest_axes
from dlogen.geometry.vectors import dots, unit
from dlogen.stages.refined.orientation import alike
from dlogen.types import Array, BoolArray, IntArray

#: Reach of the neighbourhoods in radii, round by round: of nodes of projected points, which are near the axis from the
#: start, and of others, which are anywhere around the tube.
_SHARP = (2.0, 2.0)
_BLUNT = (3.5, 2.5)

#: Size of the cells that points are gathered in, in radii: projected points and others.
_SHARP_CELL, _BLUNT_CELL = 1.0, 1.5

#: Projected points for each radius of length that make others unnecessary.
_PLENTY = 5.0
#: Root mean square of the shifts, in radii, below which a line is centred.
_STILL = 0.05
#: Fewest points, itself included, that a point's normal is taken from.
_PATCH = 6

#: Votes are believed if their distance from the line through them is less than this share of that of the points; at so
#: many places it is looked at, over so many radii, with so many points at most.
_AGREE, _JUDGED, _AROUND, _COMPANY = 0.5, 60, 1.5, 200


#: Votes are believed, too, if their distance from the line is less than this, in radii.
_BUNCHED = 0.2

#: How far inside the tube, in radii, the centroid around a point is, where the side of its normal is sure; and the
#: share of points beyond which all are looked at again where it is not.
_UNSURE, _FEW_UNSURE = 0.15, 0.3


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


def axis_votes(
    points: Array, tree: cKDTree, radius: float, spacing: float, viewpoint: Array | None = None
) -> tuple[Array, BoolArray]:
    """Project points to the axis by the radius along their normals (Eq. 4), where they have enough neighbours.

    Args:
        points: (M, 3) metres.
        tree: of the points.
        radius: of the tube, metres.
        spacing: median distance between nearest neighbours, metres.
        viewpoint: (3,) where the points were seen from, if that is known, metres.

    Returns:
        votes: (M, 3) projected points, or the points themselves.
        projected: (M,) which.
    """
    # A disc of 4 spacings has some 11 points of a random surface; beyond 0.9 radii it is no plane any more.
    reach = float(np.clip(4.0 * spacing, 0.35 * radius, 0.9 * radius))
    # The nearest neighbour of half of the points on a surface is within a disc where ln 2 others are due.
    if np.log(2.0) * (reach / spacing) ** 2 < _PATCH - 2:
        return points, np.zeros(len(points), dtype=bool)
    pairs = _pairs(tree, reach)
    moments = _sums(pairs, _moments(points))
    projected = moments[:, 0] >= _PATCH
    if projected.mean() < 0.5:
        # What they are in such a cloud is chance.
        projected[:] = False
        return points, projected
    normals = smallest_axes(_covariances(moments[projected]))
    outward = (points - _local_centroids(points, radius, 2.0 * radius))[projected]
    sides = [np.where(dots(normals, outward) < 0.0, -1.0, 1.0)]
    if float(np.mean(np.abs(dots(normals, outward)) < _UNSURE * radius)) > _FEW_UNSURE:
        # Less of the circumference was seen than tells the side of each normal by itself.
        number = np.cumsum(projected) - 1
        among = number[pairs[:, projected[pairs].all(axis=0)]]
        sides.append(alike(points[projected], normals, outward, among))
        if viewpoint is not None:
            sides.append(np.where(dots(normals, viewpoint - points[projected]) < 0.0, -1.0, 1.0))
    candidates = [points.copy() for _ in sides]
    for votes, side in zip(candidates, sides, strict=True):
        votes[projected] -= radius * side[:, None] * normals
    if len(candidates) == 1:
        return candidates[0], projected
    places = _places(projected)
    # Votes on the wrong side are two radii from the others.
    reach = 2.0 * _AROUND * radius
    spreads = [float(np.mean(_spread(votes[projected], votes[places], reach))) for votes in candidates]
    return candidates[int(np.argmin(spreads))], projected


def votes_agree(points: Array, votes: Array, projected: BoolArray, radius: float) -> bool:
    """Whether projecting points has brought them together, as it does where their normals are those of a tube.

    Normals of noise point anywhere: the votes of a strip whose depth is noise lie a radius above and below it, and
    look like two strands. How far neighbours are from the line through them tells the two apart: it shrinks to a
    quarter on a clean surface, and stays as it is where the normals mean nothing. The points of a narrow arc are near
    a line themselves; votes that are as near to one, a radius away, are no chance either.

    Args:
        points: (M, 3) metres.
        votes, projected: what `axis_votes` gave for them.
        radius: of the tube, metres.
    """
    index = np.flatnonzero(projected)
    if len(index) < _PATCH:
        return False
    places = _places(projected)
    before, after = (_spread(cloud[index], cloud[places], _AROUND * radius) for cloud in (points, votes))
    return float(np.median(after)) < max(_AGREE * float(np.median(before)), _BUNCHED * radius)


def _places(projected: BoolArray) -> IntArray:
    """Indices of some of the projected points, evenly over all of them."""
    index = np.flatnonzero(projected)
    places: IntArray = index[np.unique(np.linspace(0, len(index) - 1, _JUDGED).astype(np.intp))]
    return places


def _spread(points: Array, places: Array, reach: float) -> Array:
    """(P,) root mean square distance of the points around places from the line through them, metres."""
    near = cKDTree(points).query(places, min(_COMPANY, len(points)), distance_upper_bound=reach)[1]
    near = near[:, : max(int((near < len(points)).sum(axis=1).max()), 1)]
    inside = (near < len(points)).astype(float)
    around = points[np.minimum(near, len(points) - 1)] - places[:, None]
    total = inside.sum(axis=1)
    mean = np.einsum("pk,pkc->pc", inside, around) / total[:, None]
    around -= mean[:, None]
    weighted = around * inside[:, :, None]
    covariance = weighted.transpose(0, 2, 1) @ around / total[:, None, None]
    values = np.linalg.eigvalsh(covariance)
    spread: Array = np.sqrt(np.maximum(values[:, 0] + values[:, 1], 0.0))
    return spread


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
    half = _pairs(cKDTree(position), float((widest * stretch).max()))
    for factor in rounds:
        squared = squared_distances(position, half)
        direction = _directions(position, weight, half, squared, factor * stretch)
        shift = _local_means(position, weight, half, squared, (0.6 * factor + 0.1) * stretch) - position
        position = position + shift - dots(shift, direction)[:, None] * direction
    last = np.where(blunt, _BLUNT[-1], _SHARP[-1]) * stretch
    direction = _directions(position, weight, half, squared_distances(position, half), last)
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
    of_point = points[column].T.copy()
    for _ in range(steps):
        tangent = unit(np.gradient(line, axis=0))
        vertex, along_line = line.T.copy(), tangent.T.copy()
        offset = [of_point[c] - vertex[c][row] for c in range(3)]
        forward = [along_line[c][row] for c in range(3)]
        along = offset[0] * forward[0] + offset[1] * forward[1] + offset[2] * forward[2]
        x, y, z = (offset[c] - along * forward[c] for c in range(3))
        distance = np.maximum(np.sqrt(x * x + y * y + z * z), 1e-300)
        residual = distance - radius
        weight = np.maximum(1.0 - (along / half) ** 2, 0.0) * np.maximum(1.0 - (residual / radius) ** 2, 0.0)
        weight *= weight
        x, y, z = x / distance, y / distance, z / distance
        wx, wy, wz = weight * x, weight * y, weight * z
        terms = [wx * x, wx * y, wy * y, wx * z, wy * z, wz * z, wx * residual, wy * residual, wz * residual]
        # Neighbours share what they know, which matters most where points are few.
        sums = _pooled(np.stack([np.bincount(row, term, count) for term in terms]), pooling)
        normal = np.ascontiguousarray(sums[[0, 1, 3, 1, 2, 4, 3, 4, 5]].T).reshape(-1, 3, 3)
        # Half a point at rest holds what no point does; along the line nothing is known at all.
        normal += 0.5 * np.eye(3) + 1e3 * tangent[:, :, None] * tangent[:, None, :]
        shift = np.linalg.solve(normal, np.ascontiguousarray(sums[6:].T)[:, :, None])[:, :, 0]
        length = np.linalg.norm(shift, axis=1, keepdims=True)
        line += shift * np.minimum(1.0, 0.5 * radius / np.maximum(length, 1e-300))
        if float((length[moving] ** 2).mean()) < (_STILL * radius) ** 2:
            break
    return line, np.bincount(row, minlength=count).astype(float)


def _pooled(columns: Array, times: int) -> Array:
    """Weighted means 1 2 1 over neighbouring columns; the ends count twice: (F, K) -> (F, K)."""
    for _ in range(times):
        inner = 0.5 * (columns[:, 1:] + columns[:, :-1])
        columns = columns.copy()
        columns[:, 1:-1] = 0.5 * (inner[:, 1:] + inner[:, :-1])
        columns[:, 0] = 0.5 * (columns[:, 0] + inner[:, 0])
        columns[:, -1] = 0.5 * (columns[:, -1] + inner[:, -1])
    return columns


def cells(points: Array, size: float) -> tuple[IntArray, Array, Array]:
    """Group points by the cubes of a grid.

    Returns:
        of_point: (M,) the cell of each point.
        mean: (N, 3) centroid of each cell's points.
        count: (N,) how many there are.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros(0)
    # Columns, since numpy is slow along short rows.
    columns = points.T.copy()
    grid = ((columns - columns.min(axis=1)[:, None]) / size).astype(np.int64)
    shape = grid.max(axis=1) + 1
    key = (grid[0] * shape[1] + grid[1]) * shape[2] + grid[2]
    total = int(shape.prod())
    if total < 16 * len(points):
        # Few enough cells to count them all, which is faster than sorting.
        count = np.bincount(key, minlength=total)
        occupied = count > 0
        of_point, count = (np.cumsum(occupied) - 1)[key], count[occupied]
    else:
        _, of_point, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(of_point, column) for column in columns], axis=1) / count[:, None]
    return of_point, mean, count.astype(float)


def _moments(points: Array) -> Array:
    """Columns 1, x, y, z, xx, xy, yy, xz, yz, zz: (M, 3) -> (M, 10)."""
    x, y, z = points.T.copy()
    moments = np.empty((len(points), 10))
    for column, values in enumerate((1.0, x, y, z, *products(x, y, z))):
        moments[:, column] = values
    return moments


def _covariances(sums: Array) -> Array:
    """Covariances xx, xy, yy, xz, yz, zz from sums of `_moments`: (M, 10) -> (6, M)."""
    scaled = sums.T.copy()
    scaled /= np.maximum(scaled[0], 1e-300)
    second: Array = scaled[4:]
    for row, product in zip(second, products(*scaled[1:4]), strict=True):
        row -= product
    return second


def _pairs(tree: cKDTree, reach: float) -> IntArray:
    """Pairs of points within reach, each once: (2, P)."""
    return np.ascontiguousarray(tree.query_pairs(reach, output_type="ndarray").T)


def _sums(half: IntArray, features: Array) -> Array:
    """Sums of the rows of `features` over each point's neighbours and itself; pairs are listed once: (N, F)."""
    count = len(features)
    near = coo_matrix((np.ones(half.shape[1]), (half[0], half[1])), shape=(count, count))
    result: Array = near @ features + near.T @ features + features
    return result


def _density(position: Array, weight: Array, radius: float) -> Array:
    """Points for each radius of length around each node."""
    i, j = _pairs(cKDTree(position), 2.0 * radius)
    count = len(weight)
    return (weight + np.bincount(i, weight[j], count) + np.bincount(j, weight[i], count)) / 4.0


def _local_centroids(points: Array, size: float, reach: float) -> Array:
    """Centroid of the points around each point, by cells of the given size whose means lie within reach."""
    of_point, mean, count = cells(points, size)
    sums = _sums(_pairs(cKDTree(mean), reach), np.column_stack([mean, np.ones(len(mean))]) * count[:, None])
    return (sums[:, :3] / sums[:, 3:])[of_point]


def squared_distances(points: Array, pairs: IntArray) -> Array:
    """Of pairs of points: (M, 3), (2, P) -> (P,)."""
    i, j = pairs
    squared = np.zeros(len(i))
    for column in points.T.copy():
        # Gathering from a column is several times faster than gathering rows.
        squared += (column[i] - column[j]) ** 2
    return squared


def _weighted_sums(features: Array, weight: Array, half: IntArray, squared: Array, reach: Array) -> Array:
    """Sums with the weights (1 - (d / reach)^2)^2 of the neighbours, times their number of points; and of itself."""
    weighted = features * weight[:, None]
    result: Array = weighted.copy()
    scale = 1.0 / reach**2
    for rows, columns in (half, half[::-1]):
        value = 1.0 - squared * scale[rows]
        inside = np.flatnonzero(value > 0.0)
        value = value[inside] ** 2
        result += coo_matrix((value, (rows[inside], columns[inside])), shape=(len(weight), len(weight))) @ weighted
    return result


def _directions(position: Array, weight: Array, half: IntArray, squared: Array, reach: Array) -> Array:
    """Principal directions of the neighbourhoods, (N, 3)."""
    return smallest_axes(-_covariances(_weighted_sums(_moments(position), weight, half, squared, reach)))


def _local_means(position: Array, weight: Array, half: IntArray, squared: Array, reach: Array) -> Array:
    sums = _weighted_sums(np.column_stack([position, np.ones(len(position))]), weight, half, squared, reach)
    return sums[:, :3] / sums[:, 3:]
