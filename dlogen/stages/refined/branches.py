"""From nodes near the axis to pieces of the centre line whose order is certain, and from pieces to one path.

Nodes are linked where both position and direction fit, so that strands that cross stay apart. Pieces are shortest paths
through the links, cut wherever something else touches them. Their ends are joined again by the least bending energy.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from dlogen.geometry.polyline import arc_lengths, at_arc_lengths, resample
from dlogen.geometry.runs import runs
from dlogen.geometry.vectors import dots, unit
from dlogen.stages.refined.medial import Nodes, squared_distances
from dlogen.stages.refined.piece import Piece, end_direction
from dlogen.types import Array, BoolArray, IntArray

#: Pieces shorter than this, in radii, are taken for strays.
SHORTEST = 2.5
#: A piece that ends nearer to another than this, in radii, may belong to it there.
_JUNCTION = 3.0
#: Vertices of strands in a view that are nearer to each other than this, in radii, lie one over the other; those of one
#: piece are two strands from this distance along it on.
_CROSSED, _SAME_STRAND = 1.3, 8.0
#: A piece has a kink where its directions over so many vertices before and after have a smaller cosine than this.
_ARM, _KINK = 3, 0.35


def trace_pieces(nodes: Nodes, radius: float, per_radius: float) -> list[Piece]:
    """Find the pieces. Longest paths come first; what lies along them is used up, and so on with the rest.

    Args:
        nodes: what `medial.contract` gave.
        radius: of the tube, metres.
        per_radius: points for each radius of length.
    """
    graph = _link(nodes, radius)
    alive = np.arange(len(nodes.weight))
    pieces: list[Piece] = []
    while len(alive) > 1:
        part = graph[alive][:, alive] if len(alive) < len(nodes.weight) else graph
        paths, label = _longest_paths(part)
        used = np.zeros(len(alive), dtype=bool)
        for number, (path, length) in enumerate(paths):
            members = np.flatnonzero(label == number)
            if length < SHORTEST * radius:
                used[members] = True
                continue
            line = nodes.position[alive[path]]
            along = resample(line, max(2, int(np.ceil(2.0 * length / radius)) + 1))
            own = _near(nodes, alive[members], along, radius)
            used[members[own]] = True
            used[path] = True
            pieces.append(_piece(nodes, alive[members[own]], line, radius))
        alive = alive[~used]
    typical = per_radius / radius
    return [piece for piece in pieces if piece.weight.sum() >= 6 and piece.density > 0.04 * typical]


def _link(nodes: Nodes, radius: float) -> csr_matrix:
    """Graph of nodes that lie in each other's direction; the links are as long as they are in space."""
    # With few points there are holes by chance: one of this length is as rare as e^-15.
    reach = radius * np.clip(15.0 / nodes.density, 2.0, 6.0)
    pairs = cKDTree(nodes.position).query_pairs(float(reach.max()), output_type="ndarray").T
    squared = squared_distances(nodes.position, pairs)
    near = np.flatnonzero(squared < np.minimum(*(reach**2)[pairs]))
    (i, j), squared = pairs[:, near], squared[near]
    offset = np.take(nodes.position, j, axis=0) - np.take(nodes.position, i, axis=0)
    limit = squared - (0.5 * radius + 0.4 * np.sqrt(squared)) ** 2
    one, other = np.take(nodes.direction, i, axis=0), np.take(nodes.direction, j, axis=0)
    alike = np.abs(dots(one, other)) > 0.75
    for direction in (one, other):
        alike &= dots(offset, direction) ** 2 > limit
    i, j, length = i[alike], j[alike], np.sqrt(squared[alike])
    # Zero would mean no link.
    length = np.maximum(length, 1e-9 * radius)
    count = len(nodes.weight)
    return csr_matrix((np.tile(length, 2), (np.append(i, j), np.append(j, i))), shape=(count, count))


def _longest_paths(graph: csr_matrix) -> tuple[list[tuple[IntArray, float]], IntArray]:
    """For each connected component the shortest path between the two nodes farthest apart, and its length."""
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    first = order[np.searchsorted(label[order], np.arange(count))]

    def farthest(distance: Array) -> IntArray:
        by_distance = np.lexsort((distance, label))
        farthest: IntArray = by_distance[
            np.append(np.searchsorted(label[by_distance], np.arange(1, count)), len(label)) - 1
        ]
        return farthest

    start = farthest(dijkstra(graph, indices=first, min_only=True))
    distance, before, _ = dijkstra(graph, indices=start, min_only=True, return_predecessors=True)
    end = farthest(distance)
    paths = []
    for node in end:
        path = [int(node)]
        while before[path[-1]] >= 0:
            path.append(int(before[path[-1]]))
        paths.append((np.array(path), float(distance[node])))
    return paths, label


def _near(nodes: Nodes, members: IntArray, line: Array, radius: float) -> BoolArray:
    """Which of the members lie along a path, given by points half a radius apart."""
    tangent = unit(np.gradient(line, axis=0))
    distance, nearest = cKDTree(line).query(nodes.position[members])
    alike = np.abs(dots(nodes.direction[members], tangent[nearest])) > 0.6
    result: BoolArray = (distance < 0.8 * radius) | ((distance < 1.6 * radius) & alike)
    return result


def _piece(nodes: Nodes, members: IntArray, line: Array, radius: float) -> Piece:
    """Average the members radius by radius along the path."""
    position, weight = nodes.position[members], nodes.weight[members]
    smooth = resample(line, max(3, round(arc_lengths(line)[-1] / radius) + 1))
    for _ in range(2):
        smooth[1:-1] = 0.25 * (smooth[:-2] + 2.0 * smooth[1:-1] + smooth[2:])
    s = _coordinates(position, smooth)
    low, high = _extent(s, weight)
    bins = max(2, round(high - low))
    index = np.clip(((s - low) / (high - low) * bins).astype(np.intp), 0, bins - 1)
    total: Array = np.bincount(index, weight, bins).astype(float)
    sums = np.stack([np.bincount(index, weight * column, bins) for column in (*position.T, s)], axis=1)
    # The outermost bins are partly empty: what is too little for a mean joins the next one.
    for end, inner in ((0, 1), (-1, -2)):
        if bins > 4 and total[end] < 0.3 * total[inner]:
            total[inner] += total[end]
            sums[inner] += sums[end]
            total[end] = 0.0
    kept = total > 0
    mean = sums[kept] / total[kept, None]
    total = total[kept]
    # Bins of few points are averaged with their neighbours; their means are uncertain by 0.7 r / sqrt(points).
    for _ in range(int(np.clip(np.ceil(24.0 / np.median(total)) - 1, 0, 6))):
        mean[:, :3] = _smoothed(mean[:, :3], total)
    points, at = mean[:, :3], mean[:, 3] * radius
    # The means of the outermost bins lie half a bin inside.
    tips = [
        points[end] + end_direction(points[::step], radius) * max(reach, 0.0)
        for end, step, reach in ((0, 1, at[0] - low * radius), (-1, -1, high * radius - at[-1]))
    ]
    rough = np.concatenate([tips[:1], points, tips[1:]])
    along = arc_lengths(rough)
    even = np.linspace(0.0, along[-1], max(3, round(along[-1] / radius) + 1))
    counted = np.interp(even, along, np.concatenate([[0.0], np.cumsum(total) - 0.5 * total, [total.sum()]]))
    shares = np.diff(counted)
    weights = 0.5 * (np.append(shares, 0.0) + np.append(0.0, shares))
    return Piece(at_arc_lengths(rough, along, even), weights)


def _coordinates(points: Array, line: Array) -> Array:
    """Places of points along a polyline of even steps, counted in steps; less than 0 or more beyond its ends."""
    _, nearest = cKDTree(line).query(points)
    tangent = np.gradient(line, axis=0)
    ahead = dots(points - line[nearest], tangent[nearest]) / dots(tangent[nearest], tangent[nearest])
    low = np.where(nearest == 0, -np.inf, -0.5)
    high = np.where(nearest == len(line) - 1, np.inf, 0.5)
    result: Array = nearest + np.clip(ahead, low, high)
    return result


def _extent(s: Array, weight: Array) -> tuple[float, float]:
    """Where the object begins and ends, in radii: a few strays beyond its ends count for nothing."""
    order = np.argsort(s)
    passed = np.cumsum(weight[order])
    few = 0.1 * passed[-1] / max(float(s.max() - s.min()), 1.0)
    low, high = np.searchsorted(passed, (few, passed[-1] - few))
    return float(s[order[low]]), float(s[order[min(high, len(s) - 1)]])


def _smoothed(points: Array, weight: Array) -> Array:
    """Means over three neighbours with weights 1 2 1 times theirs. The ends go on by point reflection."""
    if len(points) < 3:
        return points
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    w = np.concatenate([weight[1:2], weight, weight[-2:-1]])[:, None]
    total = w[:-2] + 2 * w[1:-1] + w[2:]
    result: Array = (w[:-2] * padded[:-2] + 2 * w[1:-1] * padded[1:-1] + w[2:] * padded[2:]) / total
    return result


def cut_at_junctions(pieces: list[Piece], radius: float, *, crossings: bool = False) -> list[Piece]:
    """Cut pieces wherever the end of another piece, or their own, comes near.

    Args:
        pieces: as they were traced.
        radius: of the tube, metres.
        crossings: cut pieces as well where they run over one another: in a view, strands that cross are in one place,
            and a path through it may turn from one into the other.

    Returns:
        What is left; the region around a cut is left out.
    """
    kept = [np.ones(len(piece.points), dtype=bool) for piece in pieces]
    for i, piece in enumerate(pieces):
        for end in (0, -1):
            tip = piece.points[end]
            for j, other in enumerate(pieces):
                distance = np.linalg.norm(other.points - tip, axis=1)
                if i == j:
                    along = arc_lengths(other.points)
                    distance[np.abs(along - along[end]) < 3.0 * _JUNCTION * radius] = np.inf
                nearest = int(np.argmin(distance))
                if distance[nearest] < _JUNCTION * radius and 2 < nearest < len(other.points) - 3:
                    kept[j][max(nearest - 1, 0) : nearest + 2] = False
    if crossings:
        for piece, part, over in zip(pieces, kept, _crossed(pieces, radius), strict=True):
            part &= ~(over | _kinked(piece.points))
    result: list[Piece] = []
    for piece, part in zip(pieces, kept, strict=True):
        for first, last in zip(*runs(part), strict=True):
            if last - first >= 3:
                result.append(Piece(piece.points[first:last], piece.weight[first:last]))
    return result


def _crossed(pieces: list[Piece], radius: float) -> list[BoolArray]:
    """Which vertices of pieces lie where another piece, or another part of the same one, runs over them."""
    numbers = np.concatenate([np.full(len(piece.points), number) for number, piece in enumerate(pieces)])
    along = np.concatenate([arc_lengths(piece.points) for piece in pieces])
    points = np.concatenate([piece.points for piece in pieces])
    pairs = cKDTree(points).query_pairs(_CROSSED * radius, output_type="ndarray")
    i, j = pairs.T
    apart = (numbers[i] != numbers[j]) | (np.abs(along[i] - along[j]) > _SAME_STRAND * radius)
    over = np.zeros(len(points), dtype=bool)
    over[pairs[apart].ravel()] = True
    # The vertex on either side is as mixed up.
    result = []
    for part in np.split(over, np.cumsum([len(piece.points) for piece in pieces])[:-1]):
        wider = part.copy()
        wider[1:] |= part[:-1]
        wider[:-1] |= part[1:]
        result.append(wider)
    return result


def _kinked(points: Array) -> BoolArray:
    """Which vertices of a piece lie where it turns so sharply that it left one strand for another."""
    if len(points) < 2 * _ARM + 1:
        return np.zeros(len(points), dtype=bool)
    before = unit(points[_ARM:-_ARM] - points[: -2 * _ARM])
    after = unit(points[2 * _ARM :] - points[_ARM:-_ARM])
    sharp = np.zeros(len(points), dtype=bool)
    sharp[_ARM:-_ARM] = dots(before, after) < _KINK
    return sharp
