"""Pieces in order as one line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dlogen.stages.refined.joins import Join
from dlogen.stages.refined.ordered_line import OrderedLine, bridges_of, longest_of, runs_backwards
from dlogen.stages.refined.piece import Piece
from dlogen.types import Array

R = 0.01


def piece(first: float, last: float, y: float = 0.0, weight: float = 5.0) -> Piece:
    """Along x, a radius apart."""
    x = np.linspace(first, last, round(abs(last - first) / R) + 1)
    points = np.stack([x, np.full_like(x, y), np.zeros_like(x)], axis=1)
    return Piece(points, np.full(len(x), weight))


def joined() -> OrderedLine:
    """From 0 to 0.2 and, the second piece being stored the other way round, from 0.26 to 0.5."""
    pieces = [piece(0.0, 0.2), piece(0.5, 0.26, weight=9.0)]
    return OrderedLine.of(pieces, [(0, False), (1, True)], [Join((1, 3), 0.06, 0.1, 0.3)], R)


def test_parts_bridges_and_densities_are_in_the_order_and_direction_of_the_line() -> None:
    line = joined()
    assert (np.diff(line.points[:, 0]) > 0.0).all()
    assert line.length == pytest.approx(0.5, abs=1e-6)
    assert line.parts[1][0, 0] == pytest.approx(0.26) and line.parts[1][-1, 0] == pytest.approx(0.5)
    ((a, b),) = line.spans
    assert line.points[[a, b], 0] == pytest.approx([0.2, 0.26])
    assert [np.mean(density) for density in line.densities] == pytest.approx([500.0, 900.0], rel=0.2)


def test_the_canonical_line_begins_at_the_smaller_coordinate_with_all_that_belongs_to_it() -> None:
    line = joined()
    assert line.canonical() is line
    pieces = [piece(0.0, 0.2), piece(0.5, 0.26, weight=9.0)]
    back = OrderedLine.of(pieces, [(1, False), (0, True)], [Join((3, 1), 0.06, 0.1, 0.3)], R)
    assert runs_backwards(back.points) and not runs_backwards(line.points)
    turned = back.canonical()
    assert turned.points == pytest.approx(line.points)
    assert turned.spans == line.spans and turned.path == line.path
    assert np.array(turned.densities) == pytest.approx(np.array(line.densities))


def test_the_longest_counts_by_length_and_not_by_vertices() -> None:
    short = OrderedLine.of([piece(0.0, 0.1)], [(0, False)], [], 0.001)
    assert longest_of([short, joined()]).length == pytest.approx(0.5, abs=1e-6)


def cloud(line: Array) -> Array:
    around = np.linspace(0.0, 6.0, 8)
    return np.concatenate([line + np.array([0.0, R * np.cos(t), R * np.sin(t)]) for t in around])


@pytest.mark.parametrize(("y", "kind"), [(None, "gap"), (0.022, "touch"), (0.03, "crossing")])
def test_a_bridge_is_a_gap_unless_another_strand_passes_there(y: float | None, kind: str) -> None:
    pieces = [piece(0.0, 0.2), piece(0.26, 0.5)]
    path, joins = [(0, False), (1, False)], [Join((1, 2), 0.06, 0.1, 0.3)]
    if y is not None:
        pieces.append(piece(0.4, 0.1, y))
        path, joins = [*path, (2, False)], [*joins, Join((3, 4), 0.1, 0.5, np.inf)]
    line = OrderedLine.of(pieces, path, joins, R)
    points = cloud(np.concatenate([part.points for part in pieces]))
    found = bridges_of(line, points, cKDTree(points), R)[0]
    assert found.kind == kind
    assert found.position == pytest.approx((0.23, 0.0, 0.0), abs=0.002)
    if kind != "touch":  # where strands touch, the points of the other fill the gap
        assert found.gap == pytest.approx(0.06, abs=1.2 * R)
    assert found.certainty == pytest.approx(0.75)
