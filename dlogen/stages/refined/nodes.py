"""Points that are on the axis already, as trackers give them: recognised and put in order.

A few dozen points on a line show no width, so that no tube can be fitted to them. The order comes from the shortest
links, improved by exchanging links until length and bends are the smallest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.polyline import arc_lengths, distance_to_polyline, segment_lengths
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import dots, unit
from dlogen.types import Array, BoolArray, IntArray

#: The most nodes; of more points a part is taken.
MOST_NODES = 1000
#: The fewest.
_FEWEST = 8
#: Scatter about the line, over the distance of neighbours, below which points clearly have no width, and from which on
#: they cannot be put in order. A tube of which a point is seen every three radii has 0.25.
_CLEAR, _ORDERED = 0.12, 0.45
#: Scatter below which nodes may come near one another in more places than one.
_SHARP = 0.06
#: Another strand that is nearer than this, in distances of neighbours, may have been mixed up; share of the nodes that
#: may have one so near, and share that may have one within `_BUNDLE` if points are clearly nodes: the points of scan
#: lines along a tube lie on lines, too.
_NEAR, MAY_BE_NEAR, _IF_SHARP, _BUNDLE, _MAY_BE_BUNDLED = 1.5, 0.15, 0.5, 8.0, 0.5
#: The longest step of an even line, over the usual one, and the cosine of its sharpest turn.
_EVEN, _TURN = 2.0, 0.5
#: Size of the subset whose neighbourhoods are looked at, how many of them, their points, and the width of a line over
#: its length.
_LOOKED_AT, _PATCHES, _PATCH, _THIN = 4000, 200, 8, 0.05
#: Neighbours of a node that it may be linked to, and rounds of exchanges.
_NEIGHBOURS, _ROUNDS = 10, 200
#: Points are by themselves if their nearest neighbour is so many times as far away as usual; the share that may be.
_ALONE, _MAY_BE_ALONE = 4.0, 0.05
#: What a bend costs beside a link: twice the squared length of the shorter link and one minus the cosine of the turn
#: (the squared second difference, where links are alike), beside the squared length.
_BEND = 1.0


@dataclass(frozen=True, eq=False)
class NodeOrder:
    """Nodes in order.

    Attributes:
        points: (K, 3) nodes along the line, metres.
        spacing: median distance of neighbours, metres.
        scatter: standard deviation of the nodes about a smooth line through them, on each axis across it, metres.
        near: share of the nodes that have another strand so near that it may have been mixed up.
        bundled: share that have one at a few spacings.
        doubtful: (K,) which nodes are at a place where another order would be nearly as good.
    """

    points: Array
    spacing: float
    scatter: float
    near: float
    bundled: float
    doubtful: IntArray

    @property
    def likely(self) -> bool:
        """Whether these are nodes on a line, unless they are those of scan lines along a surface."""
        return self.scatter < _CLEAR * self.spacing and self.possible

    @property
    def certain(self) -> bool:
        """Whether these clearly are nodes on a line, and no points of a surface."""
        return self.likely and (self.bundled <= _MAY_BE_BUNDLED or self._unbroken)

    @property
    def _unbroken(self) -> bool:
        """Whether the line goes on evenly, without the jumps and turns that lead from one scan line to the next."""
        steps = np.diff(self.points, axis=0)
        straight = dots(unit(steps[:-1]), unit(steps[1:]))
        return bool(segment_lengths(self.points).max() < _EVEN * self.spacing and straight.min() > _TURN)

    @property
    def possible(self) -> bool:
        """Whether they can be nodes on a line."""
        near = _IF_SHARP if self.scatter < _SHARP * self.spacing else MAY_BE_NEAR
        # A way through a plane comes back beside itself everywhere.
        most = _ORDERED if self.bundled <= _MAY_BE_BUNDLED else _CLEAR
        return self.scatter < most * self.spacing and self.near <= near


def order_nodes(points: Array, *, clear: bool = False) -> NodeOrder | None:
    """Put points in the order that they have on a line, whatever order they come in.

    Args:
        points: (M, 3) metres.
        clear: give up early where they are not clearly nodes on a line.

    Returns:
        None where there are too few, or clearly no nodes.
    """
    everything, points = points, points[spatial_sample(points, MOST_NODES)]
    if len(points) < _FEWEST:
        return None
    points = points[_company(points)]
    path = _path(points)
    spacing = float(np.median(segment_lengths(points[path])))
    if not spacing > 0.0:
        return None
    scatter = _scatter(points[path]) / spacing
    mixed = float(np.mean(_other_strands(points[path]) < _NEAR * spacing))
    # Exchanges take long where there is no line, and do not make one.
    if scatter > 2.0 * (_CLEAR if clear else _ORDERED) or (scatter > _SHARP and mixed > 2.0 * MAY_BE_NEAR):
        return None
    path, doubtful = _exchanged(points, path, spacing)
    line = points[path]
    if len(everything) > MOST_NODES:
        line = _even_part(everything, line)
        # At the corners of the polyline, points may have changed places.
        path, doubtful = _exchanged(line, np.arange(len(line)), float(np.median(segment_lengths(line))))
        line = line[path]
    difference = line[-1] - line[0]
    if difference[np.argmax(np.abs(difference))] < 0.0:
        line, doubtful = line[::-1], len(line) - 1 - doubtful[::-1]
    spacing = float(np.median(segment_lengths(line)))
    apart = _other_strands(line)
    return NodeOrder(
        line,
        spacing,
        _scatter(line),
        float(np.mean(apart < _NEAR * spacing)),
        float(np.mean(apart < _BUNDLE * spacing)),
        doubtful,
    )


def _company(points: Array) -> BoolArray:
    """(M,) which points are not all by themselves."""
    nearest = cKDTree(points).query(points, 2)[0][:, 1]
    alone: BoolArray = nearest > _ALONE * float(np.median(nearest))
    return ~alone if alone.mean() <= _MAY_BE_ALONE else np.ones(len(points), dtype=bool)


def is_thin(points: Array) -> bool:
    """Whether the neighbourhoods of points are lines, as those of nodes are and those of a surface are not: (M, 3)."""
    sample = points[spatial_sample(points, _LOOKED_AT)]
    if len(sample) <= _PATCH:
        return False
    index = cKDTree(sample).query(sample[:: -(-len(sample) // _PATCHES)], _PATCH)[1]
    patch = sample[index] - sample[index].mean(axis=1, keepdims=True)
    size = np.linalg.svd(patch, compute_uv=False)
    return bool(np.median(size[:, 1] / np.maximum(size[:, 0], 1e-300)) < _THIN)


def _even_part(points: Array, line: Array) -> Array:
    """As many of the points as one can work with, in order and evenly picked, the first and the last among them.

    Args:
        points: (M, 3) many.
        line: (K, 3) some of them in order.
    """
    _, segment, parameter = distance_to_polyline(points, line)
    # Beyond the ends, too, they are in order.
    start, along = line[segment], line[segment + 1] - line[segment]
    beyond = dots(points - start, along) / np.maximum(dots(along, along), 1e-300)
    outside = ((segment == 0) & (parameter == 0.0)) | ((segment == len(line) - 2) & (parameter == 1.0))
    order = np.argsort(segment + np.where(outside, beyond, parameter), kind="stable")
    picked: Array = points[order[np.linspace(0, len(points) - 1, MOST_NODES).astype(np.intp)]]
    return picked


def _path(points: Array) -> IntArray:
    """Indices of all points along a path of short links: the shortest first, two for each point, and no ring."""
    count = len(points)
    few = min(_NEIGHBOURS, count - 1)
    distance, neighbour = cKDTree(points).query(points, few + 1)
    first, second = np.repeat(np.arange(count), few), neighbour[:, 1:].ravel()
    length = distance[:, 1:].ravel()
    group, links = list(range(count)), [list[int]() for _ in range(count)]

    def root(of: int) -> int:
        while group[of] != of:
            group[of] = group[group[of]]
            of = group[of]
        return of

    def join(candidates: IntArray) -> None:
        for i, j in zip(first[candidates].tolist(), second[candidates].tolist(), strict=True):
            if len(links[i]) < 2 and len(links[j]) < 2 and root(i) != root(j):
                links[i].append(j)
                links[j].append(i)
                group[root(i)] = root(j)

    join(np.lexsort([second, first, length]))
    # What is left are fragments, whose ends are far from one another.
    while len(ends := np.array([i for i in range(count) if len(links[i]) < 2])) > 2:
        roots = np.array([root(int(i)) for i in ends])
        apart = np.linalg.norm(points[ends, None] - points[None, ends], axis=2)
        apart[roots[:, None] == roots[None]] = np.inf
        if not np.isfinite(apart).any():
            break
        a, b = np.unravel_index(np.argsort(apart, axis=None, kind="stable"), apart.shape)
        kept = np.isfinite(apart[a, b])
        first, second = ends[a[kept]], ends[b[kept]]
        join(np.arange(len(first)))
    at = next(i for i in range(count) if len(links[i]) < 2)
    path, before = [at], -1
    while len(path) < count:
        at, before = next(i for i in links[at] if i != before), at
        path.append(at)
    return np.array(path)


def _exchanged(points: Array, path: IntArray, spacing: float) -> tuple[IntArray, IntArray]:
    """The path after exchanges of links that make it shorter and smoother, and places where one nearly would.

    Turning round the stretch between two links exchanges them for the two that lead across (2-opt: Croes, Operations
    Research 6, 1958).
    """
    count = len(path)
    for _ in range(_ROUNDS):
        line = points[path]
        pairs = cKDTree(line).query_pairs(3.0 * spacing, output_type="ndarray")
        # Links (i - 1, i) and (j, j + 1) become (i - 1, j) and (i, j + 1); at an end there is one link only.
        i, j = np.sort(pairs, axis=1).T
        i, j = np.concatenate([i, i + 1, np.zeros_like(j), i + 1]), np.concatenate([j - 1, j, j - 1, 0 * j + count - 1])
        usable = (j > i) & (i < count) & (j < count) & ((i > 0) | (j < count - 1))
        i, j = i[usable], j[usable]
        if not len(i):
            return path, np.empty(0, dtype=np.intp)
        gain = _turned(line, i, j, spacing)
        best = int(np.argmin(gain))
        if gain[best] >= -1e-9:
            # Exchanges of nodes next to each other, within the scatter, are no other way to go.
            close = np.flatnonzero((gain < 0.5) & (j - i > 3))
            return path, np.unique(np.concatenate([i[close], j[close]]))
        path = np.concatenate([path[: i[best]], path[i[best] : j[best] + 1][::-1], path[j[best] + 1 :]])
    return path, np.arange(count)


def _turned(line: Array, i: IntArray, j: IntArray, spacing: float) -> Array:
    """What the cost of a path changes by when the stretch from i to j is turned round: (P,), in squared spacings."""
    count = len(line)

    def cost(*nodes: IntArray) -> Array:
        """Of the links and bends of nodes in a row; those beyond the ends have none."""
        there = [(node >= 0) & (node < count) for node in nodes]
        place = [line[np.clip(node, 0, count - 1)] for node in nodes]
        total = np.zeros(len(i))
        for a in range(len(nodes) - 1):
            step = place[a + 1] - place[a]
            total += np.where(there[a] & there[a + 1], dots(step, step), 0.0)
        for a in range(len(nodes) - 2):
            first, second = place[a + 1] - place[a], place[a + 2] - place[a + 1]
            shorter = np.minimum(dots(first, first), dots(second, second))
            bend = 2.0 * shorter * (1.0 - dots(unit(first), unit(second)))
            total += np.where(there[a] & there[a + 1] & there[a + 2], _BEND * bend, 0.0)
        return total

    # A stretch of one or two nodes has the nodes after it in its own place.
    inner, last = np.minimum(i + 1, j), np.maximum(j - 1, i)
    before = cost(i - 2, i - 1, i, inner) + cost(last, j, j + 1, j + 2)
    after = cost(i - 2, i - 1, j, last) + cost(inner, i, j + 1, j + 2)
    change: Array = (after - before) / spacing**2
    return change


def _scatter(line: Array) -> float:
    """Standard deviation of nodes about a smooth line through them, on each axis across it, metres."""
    windows = np.lib.stride_tricks.sliding_window_view(line, 5, axis=0)
    # The middle one of five against the parabola through all: (-3, 12, 17, 12, -3) / 35.
    residual = windows @ (np.array([3.0, -12.0, 18.0, -12.0, 3.0]) / 35.0)
    tangent = unit(windows[..., 3] - windows[..., 1], 1e-300)
    across = residual - tangent * dots(residual, tangent)[:, None]
    # Of a variance of 18/35; the median of the sum of two squares is 2 ln 2.
    return float(np.sqrt(np.median(dots(across, across)) / (18.0 / 35.0) / (2.0 * np.log(2.0))))


def _other_strands(line: Array) -> Array:
    """(K,) distance of each node to the nearest that is much farther along the line than in space, metres."""
    along = arc_lengths(line)
    apart = np.linalg.norm(line[:, None] - line[None], axis=2)
    apart[np.abs(along[:, None] - along[None]) < 3.0 * apart + 1e-12 * along[-1]] = np.inf
    nearest: Array = apart.min(axis=1)
    return nearest
