"""Pieces in order as one line, with the bridges between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.geometry.runs import runs
from dlogen.geometry.vectors import as_place
from dlogen.stages.refined.joins import Join, bridge
from dlogen.stages.refined.piece import Piece, end_direction
from dlogen.types import Array


@dataclass(frozen=True)
class Bridge:
    """A place where two pieces were joined.

    Attributes:
        s: (start, end) coordinates on the backbone, arc length over length.
        position: the middle, metres.
        gap: longest part of it without points, metres.
        kind: "gap", "crossing" (another strand passes there) or "touch" (one that nearly touches).
        certainty: 0 to 1: how much better the join is than the next best.
    """

    s: tuple[float, float]
    position: tuple[float, float, float]
    gap: float
    kind: str
    certainty: float


def runs_backwards(line: Array) -> bool:
    """Whether a line begins at the larger coordinate, on the axis on which its ends differ most."""
    difference = line[-1] - line[0]
    return bool(difference[np.argmax(np.abs(difference))] < 0.0)


@dataclass(frozen=True, eq=False)
class OrderedLine:
    """A chain of pieces with the bridges between them."""

    points: Array
    parts: tuple[Array, ...]
    densities: tuple[tuple[float, float], ...]  # surface points per metre at either end of each part
    joins: tuple[Join, ...]
    spans: tuple[tuple[int, int], ...]  # indices into points of the two ends of each bridge
    path: tuple[int, ...]
    length: float

    @staticmethod
    def of(pieces: list[Piece], path: list[tuple[int, bool]], joins: list[Join], r: float) -> OrderedLine:
        """Pieces along a path, with whether each is reversed, and what fills the gaps between them.

        Args:
            pieces: all there are.
            path: numbers of those of this line in their order, and whether they run backwards.
            joins: between them.
            r: radius, metres.
        """
        parts, densities = [], []
        for number, back in path:
            step = -1 if back else 1
            parts.append(pieces[number].points[::step])
            first, last = pieces[number].end_densities
            densities.append((last, first) if back else (first, last))
        points, spans = [parts[0]], []
        count = len(parts[0])
        for before, after in pairwise(parts):
            fill = bridge(before[-1], end_direction(before[::-1], r), after[0], end_direction(after, r), r)
            spans.append((count - 1, count + len(fill)))
            points += [fill, after]
            count += len(fill) + len(after)
        line = np.concatenate(points)
        length = float(arc_lengths(line)[-1])
        numbers = tuple(number for number, _ in path)
        return OrderedLine(line, tuple(parts), tuple(densities), tuple(joins), tuple(spans), numbers, length)

    def canonical(self) -> OrderedLine:
        """The same line, from the end with the smaller coordinate where the ends differ most."""
        if not runs_backwards(self.points):
            return self
        last = len(self.points) - 1
        return OrderedLine(
            self.points[::-1],
            tuple(part[::-1] for part in self.parts[::-1]),
            tuple((last, first) for first, last in self.densities[::-1]),
            self.joins[::-1],
            tuple((last - b, last - a) for a, b in self.spans[::-1]),
            self.path[::-1],
            self.length,
        )


def longest_of(lines: list[OrderedLine]) -> OrderedLine:
    """The one of the greatest length."""
    return max(lines, key=lambda candidate: candidate.length)


def bridges_of(line: OrderedLine, points: Array, tree: cKDTree, r: float) -> list[Bridge]:
    """The joins of a line as places on it: how long their gaps are, and whether another strand passes there."""
    s = arc_lengths(line.points)
    result = []
    for (a, b), join in zip(line.spans, line.joins, strict=True):
        stretch = line.points[a : b + 1]
        middle = resample(stretch, 3)[1]
        elsewhere = (s < s[a] - 4.0 * r) | (s > s[b] + 4.0 * r)
        kind = "gap"
        if elsewhere.any():
            nearest = float(cKDTree(line.points[elsewhere]).query(resample(stretch, 2 * len(stretch)))[0].min())
            kind = "touch" if nearest < 2.4 * r else "crossing" if nearest < 3.5 * r else "gap"
        certainty = 1.0 if np.isinf(join.margin) else join.margin / (join.margin + join.cost)
        gap = _largest_hole(stretch, points, tree, r)
        result.append(Bridge((s[a] / s[-1], s[b] / s[-1]), as_place(middle), gap, kind, float(certainty)))
    return result


def _largest_hole(stretch: Array, points: Array, tree: cKDTree, r: float) -> float:
    """Longest part of a stretch of the line without points around it, metres."""
    dense = resample(stretch, max(3, int(4.0 * arc_lengths(stretch)[-1] / r)))
    step = arc_lengths(dense)[-1] / (len(dense) - 1)
    # A slice across the line is empty if no point is nearer to its centre than the surface and a little more.
    lonely = np.isinf(tree.query(dense, distance_upper_bound=1.3 * r)[0])
    first, last = runs(lonely)
    longest = int((last - first).max(initial=0))
    # Points up to 0.8 r farther along fill a slice.
    return longest * step + 1.6 * r if longest else 0.0
