"""From nodes to pieces: nodes laid on known lines, graphs with known longest paths, and cuts at known places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.stages.refined.branches import (
    _coordinates,
    _extent,
    _link,
    _longest_paths,
    _smoothed,
    cut_at_junctions,
    trace_pieces,
)
from dlogen.stages.refined.medial import Nodes
from dlogen.stages.refined.piece import Piece

Array = np.ndarray
RADIUS = 0.01


def nodes_on(*lines: tuple[Array, Array], seed: int = 0, weight: float = 6.0) -> Nodes:
    """Nodes at points with tangents (of any sign), shuffled; each stands for six points, a dozen for a radius."""
    rng = np.random.default_rng(seed)
    position = np.concatenate([points for points, _ in lines])
    direction = np.concatenate([tangents for _, tangents in lines])
    order = rng.permutation(len(position))
    sign = rng.choice([-1.0, 1.0], len(position))[:, None]
    count = len(position)
    return Nodes(position[order], (sign * direction)[order], np.full(count, weight), np.full(count, 2.0 * weight))


def straight(start: list[float], end: list[float], step: float = 0.5 * RADIUS) -> tuple[Array, Array]:
    along = np.subtract(end, start)
    length = np.linalg.norm(along)
    points = np.linspace(start, end, round(length / step) + 1)
    return points, np.broadcast_to(along / length, points.shape)


def on_random(seed: int) -> tuple[Array, Array]:
    line = random_centre_line(seed, clearance=0.08)
    s = np.linspace(0.0, 1.0, round(2 * line.length / RADIUS))
    return line(s), line.tangents(s)


class TestTrace:
    @pytest.mark.parametrize("seed", range(4))
    def test_one_line_is_one_piece_from_end_to_end(self, seed: int) -> None:
        line = random_centre_line(seed, clearance=0.08)
        nodes = nodes_on(on_random(seed), seed=seed)
        (piece,) = trace_pieces(nodes, RADIUS, 12.0)
        s, off = line.nearest(piece.points)
        assert (np.diff(s) > 0).all() or (np.diff(s) < 0).all()
        # Means over a radius cut bends of 0.1 m by less than a hundredth of a radius.
        assert off.max() < 0.05 * RADIUS
        assert min(s[0], s[-1]) * line.length < RADIUS and (1 - max(s[0], s[-1])) * line.length < RADIUS
        steps = np.linalg.norm(np.diff(piece.points, axis=0), axis=1)
        assert steps == pytest.approx(np.full(len(steps), RADIUS), rel=0.1)
        # Every point that a node stands for is counted, evenly along the piece.
        assert piece.weight.sum() == pytest.approx(nodes.weight.sum())
        # The vertices at the ends stand for half a radius.
        assert piece.weight[[0, -1]] == pytest.approx([6.0, 6.0], abs=2.5)
        assert piece.weight[3:-3] == pytest.approx(np.full(len(s) - 6, 12.0), rel=0.15)

    def test_where_nodes_are_dense_the_piece_is_heavy(self) -> None:
        points, tangents = straight([0, 0, 0], [0.6, 0, 0])
        weight = np.where(points[:, 0] < 0.3, 6.0, 18.0)
        (piece,) = trace_pieces(Nodes(points, tangents, weight, 2 * weight), RADIUS, 20.0)
        light = piece.points[:, 0] < 0.3
        assert np.median(piece.weight[light]) == pytest.approx(12.0, rel=0.1)
        assert np.median(piece.weight[~light]) == pytest.approx(36.0, rel=0.1)

    def test_strands_that_cross_are_two(self) -> None:
        nodes = nodes_on(straight([-0.2, 0, 0], [0.2, 0, 0]), straight([0, -0.15, 0.012], [0, 0.15, 0.012]))
        pieces = sorted(trace_pieces(nodes, RADIUS, 12.0), key=lambda piece: piece.length)
        assert [piece.length for piece in pieces] == pytest.approx([0.3, 0.4], abs=RADIUS)
        assert np.abs(pieces[1].points[:, 1]).max() < 0.1 * RADIUS
        assert np.abs(pieces[0].points[:, 0]).max() < 0.1 * RADIUS

    def test_apart_they_are_as_many_as_there_are_and_stubs_are_none(self) -> None:
        nodes = nodes_on(
            straight([0, 0, 0], [0.3, 0, 0]),
            straight([0, 0.1, 0], [0.2, 0.1, 0]),
            straight([0, 0.2, 0], [0.02, 0.2, 0]),
        )
        lengths = sorted(piece.length for piece in trace_pieces(nodes, RADIUS, 12.0))
        assert lengths == pytest.approx([0.2, 0.3], abs=RADIUS)

    def test_what_hardly_has_points_is_none(self) -> None:
        points, tangents = straight([0, 0, 0], [0.3, 0, 0])
        thin = Nodes(points, tangents, np.full(len(points), 0.1), np.full(len(points), 12.0))
        assert trace_pieces(thin, RADIUS, 12.0) == []
        assert len(trace_pieces(thin, RADIUS, 2.0)) == 1

    def test_units_do_not_matter(self) -> None:
        nodes = nodes_on(on_random(1))
        (one,) = trace_pieces(nodes, RADIUS, 12.0)
        (other,) = trace_pieces(
            Nodes(1e3 * nodes.position, nodes.direction, nodes.weight, nodes.density), 1e3 * RADIUS, 12.0
        )
        assert np.allclose(other.points, 1e3 * one.points, atol=1e-6)
        assert np.allclose(other.weight, one.weight)

    def test_a_helix_is_followed_around(self) -> None:
        line = centre_line("helical")
        s = np.linspace(0.0, 1.0, 400)
        (piece,) = trace_pieces(nodes_on((line(s), line.tangents(s))), 0.03, 12.0)
        feet, off = line.nearest(piece.points)
        assert np.abs(np.diff(feet)).max() < 0.02 and off.max() < 0.1 * 0.03


class TestLinks:
    def test_nodes_are_linked_along_their_direction_only(self) -> None:
        x, y = np.eye(3)[:2]
        position = np.array([0 * x, 1.5 * RADIUS * x, 1.5 * RADIUS * y, 3.2 * RADIUS * x])
        graph = _link(Nodes(position, np.tile(x, (4, 1)), np.ones(4), np.full(4, 10.0)), RADIUS).toarray()
        # With ten points for each radius the reach is two radii: 0 and 1, and 1 and 3; 2 lies beside.
        assert graph[0, 1] == graph[1, 0] == pytest.approx(1.5 * RADIUS)
        assert graph[1, 3] == pytest.approx(1.7 * RADIUS)
        assert np.count_nonzero(graph) == 4

    def test_a_node_across_is_not_linked(self) -> None:
        position = np.array([[0.0, 0, 0], [0.5 * RADIUS, 0, 0]])
        for direction, links in ((np.eye(3)[[0, 0]], 2), (-np.eye(3)[[0, 0]], 2), (np.eye(3)[[0, 1]], 0)):
            assert _link(Nodes(position, direction, np.ones(2), np.full(2, 10.0)), RADIUS).nnz == links
        for degrees, links in ((35.0, 2), (50.0, 0)):
            angle = np.radians(degrees)
            turned = np.array([[1.0, 0, 0], [np.cos(angle), np.sin(angle), 0]])
            assert _link(Nodes(position, turned, np.ones(2), np.full(2, 10.0)), RADIUS).nnz == links

    def test_where_points_are_few_the_reach_is_longer(self) -> None:
        position, direction = np.array([[0.0, 0, 0], [5.0 * RADIUS, 0, 0]]), np.eye(3)[[0, 0]]
        assert _link(Nodes(position, direction, np.ones(2), np.array([2.0, 2.0])), RADIUS).nnz == 2
        # Both have to be few.
        assert _link(Nodes(position, direction, np.ones(2), np.array([2.0, 10.0])), RADIUS).nnz == 0


def test_longest_paths_of_trees() -> None:
    # 0 - 1 - 2 - 3 with a side branch 1 - 4, and 5 - 6 apart from it, 7 alone.
    links = [(0, 1, 1.0), (1, 2, 2.0), (2, 3, 1.5), (1, 4, 0.5), (5, 6, 4.0)]
    graph = np.zeros((8, 8))
    for i, j, length in links:
        graph[i, j] = graph[j, i] = length
    paths, label = _longest_paths(csr_matrix(graph))
    found = {tuple(path) if path[0] <= path[-1] else tuple(path[::-1]): length for path, length in paths}
    assert found == {(0, 1, 2, 3): 4.5, (5, 6): 4.0, (7,): 0.0}
    for number, (path, _) in enumerate(paths):
        assert (label[path] == number).all()
    assert label[4] == label[0]


def test_coordinates_along_a_line() -> None:
    line = np.arange(6.0)[:, None] * [0.0, 2.0, 0.0]
    points = np.array([[0.3, 0.0, 0], [0.1, 3.0, 0], [0, 6.4, 0.5], [0, -3.0, 0], [1.0, 13.0, 0]])
    # Steps of two, counted in steps; the ends go on.
    assert _coordinates(points, line) == pytest.approx(np.array([0.0, 1.5, 3.2, -1.5, 6.5]))


def test_extent_without_strays() -> None:
    s = np.append(np.linspace(0.0, 100.0, 1001), [150.0, -50.0])
    low, high = _extent(np.random.default_rng(0).permutation(s), np.ones(1003))
    # A tenth of what is due on one radius is half a point here: one whole stray is more than that.
    assert (low, high) == (-50.0, 150.0)
    weight = np.where((s < 0.0) | (s > 100.0), 0.05, 1.0)
    low, high = _extent(s, weight)
    assert low == pytest.approx(0.0, abs=0.11)
    assert high == pytest.approx(100.0, abs=0.11)


def test_smoothing_leaves_even_lines_and_weighs() -> None:
    line = np.arange(8.0)[:, None] * [1.0, -2.0, 0.5]
    assert np.allclose(_smoothed(line, np.ones(8)), line)
    bump = np.zeros((5, 3))
    bump[2, 1] = 4.0
    assert _smoothed(bump, np.ones(5))[:, 1].tolist() == [0, 1, 2, 1, 0]
    # (1 * 2 * 4) / (1 + 2 * 1 + 2) with the neighbours' own weights 1 and 2.
    assert _smoothed(bump, np.array([1.0, 1.0, 1.0, 2.0, 2.0]))[2, 1] == pytest.approx(8.0 / 5.0)
    assert np.array_equal(_smoothed(bump[1:3], np.ones(2)), bump[1:3])


class TestCuts:
    @staticmethod
    def piece(start: list[float], end: list[float]) -> Piece:
        points = straight(start, end, RADIUS)[0]
        return Piece(points, np.arange(len(points), dtype=float))

    def test_a_branch_cuts_the_trunk_where_it_comes_near(self) -> None:
        trunk, branch = self.piece([0, 0, 0], [0.4, 0, 0]), self.piece([0.15, 0.02, 0], [0.15, 0.3, 0])
        first, second, third = cut_at_junctions([trunk, branch], RADIUS)
        # Three vertices around x = 0.15 are left out, and their weights.
        assert first.points[[0, -1], 0] == pytest.approx([0.0, 0.13])
        assert second.points[[0, -1], 0] == pytest.approx([0.17, 0.4])
        assert first.weight.tolist() == list(range(14))
        assert second.weight.tolist() == list(range(17, 41))
        assert np.array_equal(third.points, branch.points)

    def test_ends_that_meet_ends_cut_nothing(self) -> None:
        pieces = [self.piece([0, 0, 0], [0.2, 0, 0]), self.piece([0.22, 0, 0], [0.4, 0.1, 0])]
        cut = cut_at_junctions(pieces, RADIUS)
        assert [len(piece.points) for piece in cut] == [len(piece.points) for piece in pieces]

    def test_what_passes_at_a_distance_cuts_nothing(self) -> None:
        pieces = [self.piece([0, 0, 0], [0.4, 0, 0]), self.piece([0.2, 0.031, 0], [0.2, 0.3, 0])]
        assert len(cut_at_junctions(pieces, RADIUS)) == 2

    def test_an_end_that_comes_back_cuts_its_own_piece(self) -> None:
        angle = np.linspace(0.0, 2.0 * np.pi, 64)
        ring = 0.1 * np.stack([np.sin(angle), np.cos(angle) - 1.0, 0 * angle], axis=1)
        lead = straight([-0.2, 0.0, 0], [-0.01, 0.0, 0], RADIUS)[0]
        points = np.concatenate([lead, ring])
        pieces = cut_at_junctions([Piece(points, np.ones(len(points)))], RADIUS)
        # A lasso: the lead, and the ring.
        assert len(pieces) == 2
        assert pieces[0].length == pytest.approx(0.2, abs=3 * RADIUS)
        assert pieces[1].length == pytest.approx(0.2 * np.pi, abs=3 * RADIUS)
