"""From nodes near the axis to pieces of the centre line whose order is certain, and from pieces to one path.

Nodes are linked where both position and direction fit, so that strands that cross stay apart. Pieces are shortest paths
through the links, cut wherever something else touches them. Their ends are joined again by the least bending energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.stages.refined.medial import Nodes, squared_distances
from dlogen.types import Array, BoolArray, IntArray

#: Pieces shorter than this, in radii, are taken for strays.
SHORTEST = 2.5
#: A piece that ends nearer to another than this, in radii, may belong to it there.
_JUNCTION = 3.0
#: A join that bends tighter than this, in radii, is none.
_TIGHTEST_BEND = 1.0
#: A gap longer than this share of everything that was seen is not bridged.
_LONGEST_GAP = 0.15
#: Nor is one longer than this, in radii, whose bridge would turn by more than this, in radians.
_BLIND = 8.0
_BLIND_TURN = 1.8


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the centre line in order.

    Attributes:
        points: (K, 3) about one radius apart, metres.
        weight: (K,) number of surface points that each stands for.
    """

    points: Array
    weight: Array

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def end_densities(self) -> tuple[float, float]:
        """Surface points per metre near the first and near the last end."""
        along = arc_lengths(self.points)
        few = min(6, len(along) - 1)
        return (
            float(self.weight[: few + 1].sum() / max(along[few], 1e-300)),
            float(self.weight[-few - 1 :].sum() / max(along[-1] - along[-few - 1], 1e-300)),
        )

    @property
    def density(self) -> float:
        """Surface points per metre."""
        return float(self.weight.sum()) / max(self.length, 1e-300)


@dataclass(frozen=True)
class Join:
    """Two ends of pieces that belong together.

    Attributes:
        ends: numbers of the ends: 2 i is the first point of piece i, 2 i + 1 its last.
        gap: distance between the two, metres.
        cost: bending energy times radius, plus a little for the distance.
        margin: how much more the next best way to join would cost.
    """

    ends: tuple[int, int]
    gap: float
    cost: float
    margin: float


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


def string_beads(points: Array) -> Array:
    """Order points that are beads on a string, too few to see its width: (M, 3) -> (K, 3).

    The shortest links are taken first, two for each point at most and none that closes a ring. Beads at the ends that
    are far from all others are left out.
    """
    count = len(points)
    distance = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
    links: list[tuple[int, int]] = []
    degree, group = np.zeros(count, dtype=int), np.arange(count)
    for flat in np.argsort(distance, axis=None, kind="stable"):
        i, j = divmod(int(flat), count)
        if degree[i] < 2 and degree[j] < 2 and group[i] != group[j]:
            links.append((i, j))
            degree[[i, j]] += 1
            group[group == group[j]] = group[i]
    neighbours: dict[int, list[int]] = {i: [] for i in range(count)}
    for i, j in links:
        neighbours[i].append(j)
        neighbours[j].append(i)
    order = [int(np.flatnonzero(degree == 1)[0])]
    while len(order) < count:
        order.append(next(i for i in neighbours[order[-1]] if i not in order[-2:-1]))
    string = points[order]
    steps = np.linalg.norm(np.diff(string, axis=0), axis=1)
    while len(string) > 4 and max(steps[0], steps[-1]) > 3.0 * np.median(steps):
        string, steps = (string[1:], steps[1:]) if steps[0] > steps[-1] else (string[:-1], steps[:-1])
    return string


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
    alike = np.abs(np.einsum("pi,pi->p", one, other)) > 0.75
    for direction in (one, other):
        alike &= np.einsum("pi,pi->p", offset, direction) ** 2 > limit
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
        return by_distance[np.append(np.searchsorted(label[by_distance], np.arange(1, count)), len(label)) - 1]

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
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-300)
    distance, nearest = cKDTree(line).query(nodes.position[members])
    alike = np.abs(np.einsum("ni,ni->n", nodes.direction[members], tangent[nearest])) > 0.6
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
    return Piece(np.stack([np.interp(even, along, column) for column in rough.T], axis=1), weights)


def _coordinates(points: Array, line: Array) -> Array:
    """Places of points along a polyline of even steps, counted in steps; less than 0 or more beyond its ends."""
    _, nearest = cKDTree(line).query(points)
    tangent = np.gradient(line, axis=0)
    ahead = np.einsum("pi,pi->p", points - line[nearest], tangent[nearest])
    ahead /= np.einsum("pi,pi->p", tangent[nearest], tangent[nearest])
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


def cut_at_junctions(pieces: list[Piece], radius: float) -> list[Piece]:
    """Cut pieces wherever the end of another piece, or their own, comes near.

    Returns:
        What is left; the region around a cut is left out.
    """
    cuts: list[list[int]] = [[] for _ in pieces]
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
                    cuts[j].append(nearest)
    result: list[Piece] = []
    for piece, at in zip(pieces, cuts, strict=True):
        kept = np.ones(len(piece.points), dtype=bool)
        for index in at:
            kept[max(index - 1, 0) : index + 2] = False
        edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(int)))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            if last - first >= 3:
                result.append(Piece(piece.points[first:last], piece.weight[first:last]))
    return result


def join_pieces(pieces: list[Piece], radius: float) -> list[Join]:
    """Join the ends of pieces so that the total cost is small: cheapest joins first, then exchanges.

    No join closes a ring. Ends that nothing fits stay free.
    """
    total = sum(piece.length for piece in pieces)
    cost = np.full((2 * len(pieces), 2 * len(pieces)), np.inf)
    anchors = [_anchor(pieces[end // 2], end % 2, radius) for end in range(2 * len(pieces))]
    for a in range(len(cost)):
        for b in range(a + 1, len(cost)):
            if a // 2 != b // 2 and _gap(pieces, a, b) < _LONGEST_GAP * total:
                cost[a, b] = cost[b, a] = bending_cost(*anchors[a], *anchors[b], radius)
    chosen: list[tuple[int, int]] = []
    for flat in np.argsort(cost, axis=None, kind="stable"):
        a, b = divmod(int(flat), len(cost))
        if not np.isfinite(cost[a, b]):
            break
        if a < b and _is_path([*chosen, (a, b)]):
            chosen.append((a, b))
    while True:
        options = [option for number in range(len(chosen)) for option in _alternatives(chosen, number, cost)]
        gain, better = min(options, key=lambda option: option[0], default=(0.0, chosen))
        if gain > -1e-9:
            break
        chosen = better
    joins = []
    for number, (a, b) in enumerate(chosen):
        margin = min((more for more, _ in _alternatives(chosen, number, cost)), default=np.inf)
        joins.append(Join((a, b), _gap(pieces, a, b), float(cost[a, b]), float(margin)))
    return joins


def _tip(pieces: list[Piece], end: int) -> Array:
    tip: Array = pieces[end // 2].points[-(end % 2)]
    return tip


def _gap(pieces: list[Piece], a: int, b: int) -> float:
    return float(np.linalg.norm(_tip(pieces, a) - _tip(pieces, b)))


def _anchor(piece: Piece, last: int, radius: float) -> tuple[Array, Array]:
    """A point 1.5 radii inside an end, and the outward direction there.

    The tip itself is where points were lost or mixed up with another strand.
    """
    points = piece.points[::-1] if last else piece.points
    return parabola(points, 1.5 * radius, radius)


def end_direction(points: Array, radius: float) -> Array:
    """Unit direction out of the first end of a polyline: (K, 3) -> (3,)."""
    return parabola(points, 0.0, radius)[1]


def parabola(points: Array, at: float, radius: float) -> tuple[Array, Array]:
    """Point and outward direction at a distance from the first end, from a parabola through the first six radii."""
    along = arc_lengths(points)
    fitted = points[: max(int(np.searchsorted(along, 6.0 * radius)), 3)]
    along = along[: len(fitted)]
    degree = 2 if len(fitted) >= 5 else 1
    powers = along[:, None] ** np.arange(degree + 1)
    coefficients = np.linalg.lstsq(powers, fitted, rcond=None)[0]
    at = min(at, 0.5 * float(along[-1]))
    slope = coefficients[1] + (2.0 * at * coefficients[2] if degree == 2 else 0.0)
    return at ** np.arange(degree + 1) @ coefficients, -slope / max(float(np.linalg.norm(slope)), 1e-300)


def bending_cost(a: Array, heading_a: Array, b: Array, heading_b: Array, radius: float) -> float:
    """Bending energy, times the radius, of the thin beam between two ends, plus a little for its turn and its length.

    A beam of length L that leaves its chord by the small angles alpha at one end and beta at the other has the energy
    4 (alpha^2 + alpha beta + beta^2) / L (integral of the squared curvature), which for an arc is its turn squared over
    its length. Infinite if it bends too tightly, or too far where nothing was seen.

    Args:
        a, b: (3,) the ends, metres.
        heading_a, heading_b: (3,) unit directions out of either piece.
        radius: of the tube, metres.
    """
    chord = b - a
    length = max(float(np.linalg.norm(chord)), radius)
    chord = chord / length
    alpha, beta = heading_a - chord, -heading_b - chord
    tightest = max(float(np.linalg.norm(4 * alpha + 2 * beta)), float(np.linalg.norm(2 * alpha + 4 * beta))) / length
    if tightest * _TIGHTEST_BEND * radius > 1.0:
        return np.inf
    turn = 2.0 * max(float(alpha @ alpha + alpha @ beta + beta @ beta), 0.0) ** 0.5
    if length > _BLIND * radius and turn > _BLIND_TURN:
        return np.inf
    return turn**2 * radius / length + 0.05 * turn**2 + 0.02 * length / radius


def _is_path(joins: list[tuple[int, int]]) -> bool:
    """Whether every end is used once at most and nothing is closed to a ring."""
    used: set[int] = set()
    group: dict[int, int] = {}

    def root(piece: int) -> int:
        while piece in group:
            piece = group[piece]
        return piece

    for a, b in joins:
        if a in used or b in used or root(a // 2) == root(b // 2):
            return False
        used |= {a, b}
        group[root(a // 2)] = root(b // 2)
    return True


def _alternatives(chosen: list[tuple[int, int]], number: int, cost: Array) -> list[tuple[float, list[tuple[int, int]]]]:
    """Other ways to join the ends of one join, and how much more they cost: with free ends, or by an exchange."""
    a, b = chosen[number]
    others = chosen[:number] + chosen[number + 1 :]
    busy = {end for join in chosen for end in join}
    options = []
    for free in range(len(cost)):
        if free not in busy:
            options += [(cost[end, free] - cost[a, b], [*others, (end, free)]) for end in (a, b)]
    for position, (c, d) in enumerate(others):
        rest = others[:position] + others[position + 1 :]
        before = cost[a, b] + cost[c, d]
        options.append((cost[a, c] + cost[b, d] - before, [*rest, (a, c), (b, d)]))
        options.append((cost[a, d] + cost[b, c] - before, [*rest, (a, d), (b, c)]))
    return [(float(more), joins) for more, joins in options if np.isfinite(more) and _is_path(joins)]


def chains(count: int, joins: list[Join]) -> list[tuple[list[tuple[int, bool]], list[Join]]]:
    """Follow the joins from end to end.

    Args:
        count: number of pieces.
        joins: between their ends, without rings.

    Returns:
        For each chain its pieces in order, with whether they are reversed, and the joins between them.
    """
    partner = {end: (other, join) for join in joins for end, other in (join.ends, join.ends[::-1])}
    result = []
    done: set[int] = set()
    for end in range(2 * count):
        if end // 2 in done or end in partner:
            continue
        order, between = [], []
        while True:
            order.append((end // 2, end % 2 == 1))
            done.add(end // 2)
            if end ^ 1 not in partner:
                break
            end, join = partner[end ^ 1]
            between.append(join)
        result.append((order, between))
    return result


def bridge(a: Array, heading_a: Array, b: Array, heading_b: Array, step: float) -> Array:
    """Points about a step apart on the cubic between two ends, the ends left out: (J, 3)."""
    length = float(np.linalg.norm(b - a))
    count = max(round(length / step), 1)
    t = (np.arange(1, count) / count)[:, None]
    points: Array = (
        (2 * t**3 - 3 * t**2 + 1) * a
        + (t**3 - 2 * t**2 + t) * length * heading_a
        + (3 * t**2 - 2 * t**3) * b
        + (t**3 - t**2) * length * -heading_b
    )
    return points
