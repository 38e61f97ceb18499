"""From surface points to nodes near the axis: exact tubes, sums written out, and clouds that are seen from one side."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from partly_seen import arc, wave
from scipy.spatial import cKDTree

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.stages.refined.medial import (
    _covariances,
    _density,
    _local_centroids,
    _moments,
    _pairs,
    _pooled,
    _sums,
    _weighted_sums,
    axis_votes,
    cells,
    contract,
    recentre,
    squared_distances,
    votes_agree,
)

Array = np.ndarray


def spacing(tree: cKDTree, points: Array) -> float:
    return float(np.median(tree.query(points, 2)[0][:, 1]))


def per_radius(cloud: SyntheticCloud) -> float:
    return len(cloud.points) * cloud.radius / cloud.truth.length


@pytest.fixture(scope="module")
def sparse() -> SyntheticCloud:
    """The same kind of tube with too few points for normals: about 4 for each radius of length."""
    return sample_tube(random_centre_line(3, clearance=0.08), 0.015, 400, 3)


class TestVotes:
    @pytest.mark.parametrize("name", ["tube", "half_tube"])
    def test_dense_points_come_to_the_axis(self, name: str, request: pytest.FixtureRequest) -> None:
        cloud = request.getfixturevalue(name)
        tree = cKDTree(cloud.points)
        votes, projected = axis_votes(cloud.points, tree, cloud.radius, spacing(tree, cloud.points))
        assert projected.mean() > 0.95
        off = cloud.truth.nearest(votes[projected])[1]
        # A normal turned round would put its point two radii off the axis.
        assert np.median(off) < 0.15 * cloud.radius
        assert np.mean(off < 0.6 * cloud.radius) > 0.99
        # The vote is one radius off its own point, and the others stay where they are.
        assert np.linalg.norm(votes - cloud.points, axis=1)[projected] == pytest.approx(cloud.radius)
        assert np.array_equal(votes[~projected], cloud.points[~projected])

    def test_in_any_order_and_frame(self, tube: SyntheticCloud) -> None:
        rng = np.random.default_rng(0)
        order, turn = rng.permutation(len(tube.points)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
        tree = cKDTree(tube.points)
        near = spacing(tree, tube.points)
        votes, projected = axis_votes(tube.points, tree, tube.radius, near)
        moved = 1e3 * tube.points[order] @ turn.T
        again, which = axis_votes(moved, cKDTree(moved), 1e3 * tube.radius, 1e3 * near)
        assert np.array_equal(which, projected[order])
        # The grid of cells that tell inside from outside is another one, but nobody changes sides.
        assert np.abs(again @ turn / 1e3 - votes[order]).max() < 1e-6

    def test_sparse_points_stay_where_they_are(self, sparse: SyntheticCloud) -> None:
        tree = cKDTree(sparse.points)
        votes, projected = axis_votes(sparse.points, tree, sparse.radius, spacing(tree, sparse.points))
        assert not projected.any()
        assert np.array_equal(votes, sparse.points)


class TestNarrowArcs:
    """Less than half of a half is seen: centroids of the surroundings are as near to the surface as the noise is."""

    @pytest.mark.parametrize("hanging", [False, True])
    @pytest.mark.parametrize(("half", "noise"), [(30.0, 0.01), (30.0, 0.05), (45.0, 0.05), (55.0, 0.1)])
    @pytest.mark.parametrize("seen_from", [None, [0.5, 0.0, 3.0]])
    def test_no_vote_is_on_the_wrong_side(
        self, half: float, noise: float, hanging: bool, seen_from: list[float] | None
    ) -> None:
        points = arc(0.01, half, 5000, noise * 0.01, 1, hanging)
        tree, place = cKDTree(points), None if seen_from is None else np.array(seen_from)
        votes, projected = axis_votes(points, tree, 0.01, spacing(tree, points), place)
        line = wave()[:, [0, 2, 1]] if hanging else wave()
        off = cKDTree(line).query(votes[projected])[0]
        assert projected.mean() > 0.95
        assert (off < 0.01).mean() > 0.998
        assert votes_agree(points, votes, projected, 0.01)

    def test_a_wrong_viewpoint_does_not_turn_a_tube_inside_out(self, tube: SyntheticCloud) -> None:
        tree = cKDTree(tube.points)
        near = spacing(tree, tube.points)
        votes, _ = axis_votes(tube.points, tree, tube.radius, near)
        again, _ = axis_votes(tube.points, tree, tube.radius, near, np.array([0.0, 0.0, 5.0]))
        assert np.array_equal(again, votes)

    def test_votes_of_noise_do_not_agree(self) -> None:
        rng = np.random.default_rng(0)
        strip = np.stack([rng.random(4000), rng.uniform(-0.01, 0.01, 4000), 0.01 * rng.normal(size=4000)], axis=1)
        tree = cKDTree(strip)
        votes, projected = axis_votes(strip, tree, 0.01, spacing(tree, strip))
        assert projected.any()
        assert not votes_agree(strip, votes, projected, 0.01)


class TestContract:
    @pytest.mark.parametrize("name", ["tube", "half_tube"])
    def test_nodes_lie_near_the_axis_and_along_it(self, name: str, request: pytest.FixtureRequest) -> None:
        cloud = request.getfixturevalue(name)
        tree = cKDTree(cloud.points)
        votes, projected = axis_votes(cloud.points, tree, cloud.radius, spacing(tree, cloud.points))
        nodes = contract(votes, projected, cloud.radius, per_radius(cloud))
        s, off = cloud.truth.nearest(nodes.position)
        assert np.mean(off < 0.5 * cloud.radius) > 0.99
        tangents = cloud.truth.tangents(s)
        assert np.linalg.norm(nodes.direction, axis=1) == pytest.approx(1.0)
        assert np.median(np.abs(np.einsum("ni,ni->n", nodes.direction, tangents))) > 0.995
        # All along the object, every point counted once.
        assert np.diff(np.sort(np.concatenate([[0.0], s, [1.0]]))).max() * cloud.truth.length < 2.5 * cloud.radius
        # But for the few points without a normal: where others have one, they say nothing more.
        assert projected.sum() * 0.99 <= nodes.weight.sum() <= len(cloud.points)
        inner = (s > 0.05) & (s < 0.95)
        assert np.median(nodes.density[inner]) == pytest.approx(per_radius(cloud), rel=0.3)

    def test_without_normals_they_contract(self, sparse: SyntheticCloud) -> None:
        nowhere = np.zeros(len(sparse.points), dtype=bool)
        nodes = contract(sparse.points, nowhere, sparse.radius, per_radius(sparse))
        s, off = sparse.truth.nearest(nodes.position)
        assert np.median(off) < 0.4 * sparse.radius
        along = np.abs(np.einsum("ni,ni->n", nodes.direction, sparse.truth.tangents(s)))
        assert np.median(along) > 0.97
        assert nodes.weight.sum() == len(sparse.points)

    def test_nodes_move_across_only(self) -> None:
        rng = np.random.default_rng(4)
        angle = rng.uniform(0.0, 2.0 * np.pi, 800)
        points = np.stack([rng.random(800), 0.02 * np.cos(angle), 0.02 * np.sin(angle)], axis=1)
        nodes = contract(points, np.zeros(800, dtype=bool), 0.02, 16.0)
        before = cells(points, 0.03)[1]
        assert len(nodes.position) == len(before)
        off, was = (np.hypot(*position.T[1:]) for position in (nodes.position, before))
        assert np.median(was) > 0.012 > 0.004 > np.median(off)
        # Plain means of neighbours would move them along by a quarter of a radius, too, and draw the ends in.
        assert np.abs(nodes.position[:, 0] - before[:, 0]).mean() < 0.125 * 0.02

    def test_strays_become_no_nodes(self, tube: SyntheticCloud) -> None:
        rng = np.random.default_rng(1)
        strays = rng.uniform(-1.0, 1.0, (100, 3)) + tube.points.mean(axis=0)
        strays = strays[cKDTree(tube.points).query(strays)[0] > 5 * tube.radius]
        tree = cKDTree(tube.points)
        votes, projected = axis_votes(tube.points, tree, tube.radius, spacing(tree, tube.points))
        nodes = contract(
            np.concatenate([votes, strays]),
            np.append(projected, np.zeros(len(strays), dtype=bool)),
            tube.radius,
            per_radius(tube),
        )
        assert len(strays) > 50
        assert tube.truth.nearest(nodes.position)[1].max() < 3 * tube.radius

    def test_only_strays_are_nothing(self) -> None:
        far = 10.0 * np.arange(20.0)[:, None] * np.ones(3)
        nodes = contract(far, np.zeros(20, dtype=bool), 0.01, 5.0)
        assert nodes.position.shape == nodes.direction.shape == (0, 3)
        assert nodes.weight.shape == nodes.density.shape == (0,)


class TestRecentre:
    @pytest.mark.parametrize("side", [None, (0.0, 0.0, -1.0)])
    @pytest.mark.parametrize("count", [400, 1000, 20_000])
    def test_a_line_beside_the_axis_comes_to_it(self, count: int, side: tuple[float, ...] | None) -> None:
        truth, radius = random_centre_line(3, dimensions=2, clearance=0.08), 0.015
        cloud = sample_tube(truth, radius, count, 5, side=side)
        s = np.linspace(0.02, 0.98, round(0.96 * truth.length / radius))
        wrong = truth(s) + 0.4 * radius * np.array([0.0, 0.0, 1.0])
        line = recentre(wrong, cloud.points, cKDTree(cloud.points), radius, per_radius(cloud))
        assert line.shape == wrong.shape
        feet, off = truth.nearest(line)
        assert np.median(off) < 0.12 * radius
        assert np.quantile(off, 0.95) < 0.35 * radius
        # Across, not along.
        assert np.median(np.abs(feet - s)) * truth.length < 0.1 * radius

    def test_a_centred_line_stays(self, tube: SyntheticCloud) -> None:
        line = tube.truth.points(round(tube.truth.length / tube.radius))[1:-1]
        moved = recentre(line.copy(), tube.points, cKDTree(tube.points), tube.radius, per_radius(tube))
        assert np.abs(moved - line).max() < 0.12 * tube.radius

    def test_turned_it_is_the_same(self, sparse: SyntheticCloud) -> None:
        turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
        line = sparse.truth.points(90)
        results = [
            recentre(move(line), move(sparse.points), cKDTree(move(sparse.points)), sparse.radius, 4.0)
            for move in (lambda p: p.copy(), lambda p: p @ turn.T + 3.0)
        ]
        assert np.allclose(results[1], results[0] @ turn.T + 3.0, atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.05, 3.0))
def test_cells_are_those_of_a_grid(seed: int, size: float) -> None:
    points = np.random.default_rng(seed).normal(size=(60, 3))
    of_point, mean, count = cells(points, size)
    low = points.min(axis=0)
    grid = [tuple(row) for row in ((points - low) / size).astype(int)]
    together = {cube: [m for m in range(60) if grid[m] == cube] for cube in grid}
    assert len(mean) == len(count) == len(together)
    for members in together.values():
        (cell,) = set(of_point[members])
        assert count[cell] == len(members)
        assert np.allclose(mean[cell], points[members].mean(axis=0))


def test_cells_of_nothing() -> None:
    assert [len(part) for part in cells(np.zeros((0, 3)), 1.0)] == [0, 0, 0]


def test_covariances_from_sums() -> None:
    points = np.random.default_rng(0).normal(size=(40, 3))
    xx, xy, yy, xz, yz, zz = _covariances(_moments(points).sum(axis=0)[None])[:, 0]
    assert np.allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], np.cov(points.T, bias=True))


def test_sums_over_neighbours() -> None:
    rng = np.random.default_rng(1)
    points, features = rng.normal(size=(50, 3)), rng.normal(size=(50, 2))
    weight, reach = rng.uniform(1.0, 5.0, 50), rng.uniform(0.3, 1.5, 50)
    half = _pairs(cKDTree(points), 1.5)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert half.shape[1] == ((apart < 1.5).sum() - 50) / 2
    squared = squared_distances(points, half)
    assert np.allclose(squared, apart[half[0], half[1]] ** 2)
    assert np.allclose(_sums(half, features), (apart < 1.5) @ features)
    # The reach is that of the node that sums, not of its neighbour.
    kernel = np.maximum(1.0 - (apart / reach[:, None]) ** 2, 0.0) ** 2
    assert np.allclose(_weighted_sums(features, weight, half, squared, reach), kernel @ (features * weight[:, None]))


def test_density_is_points_for_each_radius() -> None:
    # 3 points every half radius, along a line. Within two radii on either side are 4 nodes, and itself.
    position = 0.5 * 0.01 * np.arange(40.0)[:, None] * [1.0, 0.0, 0.0] * (1 - 1e-9)
    density = _density(position, np.full(40, 3.0), 0.01)
    assert density[10:30] == pytest.approx(9 * 3 / 4)
    assert density[0] == pytest.approx(5 * 3 / 4)
    # Every node counts with its own weight.
    weight = np.arange(40.0)
    assert _density(position, weight, 0.01)[10] == pytest.approx(np.arange(6, 15).sum() / 4)


def test_local_centroids_are_those_of_the_cells_around() -> None:
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.2, 0, 0], [9.0, 0, 0]])
    # Cells of size one: the first two, the third, the last; the means 0.25 and 1.2 are within one of each other.
    expected = np.array([1.7 / 3, 1.7 / 3, 1.7 / 3, 9.0])
    assert _local_centroids(points, 1.0, 1.0)[:, 0] == pytest.approx(expected)
    assert _local_centroids(points, 1.0, 0.5)[:, 0] == pytest.approx(np.array([0.25, 0.25, 1.2, 9.0]))


def test_pooling_keeps_what_is_even_and_spreads_a_peak() -> None:
    assert np.allclose(_pooled(np.ones((2, 7)), 3), 1.0)
    peak = np.zeros((1, 7))
    peak[0, 3] = 4.0
    assert _pooled(peak, 1).tolist() == [[0, 0, 1, 2, 1, 0, 0]]
    assert _pooled(peak, 2).tolist() == [[0, 0.25, 1, 1.5, 1, 0.25, 0]]
    end = np.zeros((1, 4))
    end[0, 0] = 4.0
    # An end counts twice: (3 + 1) / 4 of its own.
    assert _pooled(end, 1).tolist() == [[3, 1, 0, 0]]
