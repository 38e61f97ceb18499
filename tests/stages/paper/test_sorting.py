from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kendalltau

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.stages.paper.normals import choose_neighbours, estimate_normals, orient_normals
from dlogen.stages.paper.projection import project
from dlogen.stages.paper.sorting import choose_start, local_direction, sort_points

LINES = [centre_line("bent"), centre_line("straight"), centre_line("helical"), random_centre_line(3, clearance=0.08)]


def on_axis(cloud: SyntheticCloud) -> tuple[np.ndarray, np.ndarray]:
    """Projected points and normals as a perfect normal estimation gives them."""
    return project(cloud.points, cloud.normals, cloud.radius), cloud.normals


def estimated(cloud: SyntheticCloud) -> tuple[np.ndarray, np.ndarray]:
    """The same from the points alone."""
    k = choose_neighbours(cloud.points, cloud.radius)
    normals = estimate_normals(cloud.points, neighbours=k)
    normals = orient_normals(cloud.points, normals, cloud.radius)
    return project(cloud.points, normals, cloud.radius), normals


def agreement(order, true_s) -> float:
    """Kendall's tau of the order found with the true one: 1 the same, -1 the opposite, 0 none."""
    return float(kendalltau(order.s, true_s[order.index]).statistic)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(3, 40))
def test_local_direction_is_the_last_right_singular_vector(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3)) * [1.0, 0.6, 0.2]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    direction = local_direction(normals)
    singular = np.linalg.svd(normals)[2][-1]
    assert abs(direction @ singular) == pytest.approx(1.0, abs=1e-9)
    # Eq. 6: nothing of unit length does better.
    others = rng.normal(size=(200, 3))
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    assert np.linalg.norm(normals @ direction) <= np.linalg.norm(others @ normals.T, axis=1).min() + 1e-12


def test_local_direction_on_a_tube_is_its_tangent(tube) -> None:
    piece = (tube.s > 0.48) & (tube.s < 0.5)
    tangent = tube.truth.tangents([0.49])[0]
    assert abs(local_direction(tube.normals[piece]) @ tangent) > np.cos(np.radians(1))


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.name)
def test_perfect_points_are_sorted_perfectly(line) -> None:
    cloud = sample_tube(line, 0.015, 2000, 7)
    order = sort_points(*on_axis(cloud), search_radius=0.06)
    assert len(order.unreached) == 0
    assert abs(agreement(order, cloud.s)) > 0.9999
    # Each step of the walk is a chord, seen along the tangent at its start: never longer than the line.
    assert 0.97 * line.length < order.length <= line.length


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.name)
def test_estimated_normals_are_enough(line) -> None:
    cloud = sample_tube(line, 0.02, 5000, 7)
    order = sort_points(*estimated(cloud), search_radius=0.16)
    assert len(order.unreached) == 0
    tau = agreement(order, cloud.s)
    assert abs(tau) > 0.99
    # Medians of 100 bins must grow: no stretch is out of place, as a permutation of pieces would have it.
    medians = np.array([np.median(part) for part in np.array_split(cloud.s[order.index], 100)])
    assert (np.diff(np.sign(tau) * medians) > 0).all()
    # And the coordinate itself, not only the order.
    s = order.s if tau > 0 else 1 - order.s
    assert np.abs(s - cloud.s[order.index]).max() < 0.05


@settings(deadline=None, max_examples=40)
@given(start=st.integers(0, 4999), search_radius=st.floats(0.045, 0.07))
def test_any_start_point_will_do(tube, start: int, search_radius: float) -> None:
    # The clearance of this line is 80 mm between axes; the whole of it is reached from anywhere.
    order = sort_points(*on_axis(tube), search_radius, start)
    assert len(order.unreached) == 0
    assert abs(agreement(order, tube.s)) > 0.999
    assert order.length == pytest.approx(tube.truth.length, rel=0.03)
    assert order.s[0] == 0.0
    assert order.s[-1] == 1.0
    assert (np.diff(order.s) >= 0).all()


def test_it_goes_both_ways_from_the_middle_and_one_way_from_the_ends(tube) -> None:
    points, normals = on_axis(tube)
    for start in (np.argmin(tube.s), np.argmax(tube.s), np.argmin(np.abs(tube.s - 0.5))):
        order = sort_points(points, normals, 0.06, int(start))
        assert len(order.index) == 5000
        assert {int(order.index[0]), int(order.index[-1])} == {int(np.argmin(tube.s)), int(np.argmax(tube.s))}


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 10_000))
def test_the_order_of_the_input_does_not_show(tube, seed: int) -> None:
    points, normals = estimated(tube)
    permutation = np.random.default_rng(seed).permutation(len(points))
    straight = sort_points(points, normals, 0.06)
    permuted = sort_points(points[permutation], normals[permutation], 0.06)
    assert np.array_equal(permutation[permuted.index], straight.index)
    assert permuted.s == pytest.approx(straight.s, abs=1e-12)
    assert permuted.length == pytest.approx(straight.length, rel=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_the_direction_does_not_hang_on_rounding(axis: int) -> None:
    # Along an axis the matrix of the normals is diagonal but for rounding, and the eigenvector's sign a toss-up.
    rng = np.random.default_rng(0)
    angle = rng.integers(0, 8, 1000) * np.pi / 4
    points, normals = np.zeros((2, 1000, 3))
    points[:, axis] = rng.random(1000)
    normals[:, axis - 1], normals[:, axis - 2] = np.cos(angle), np.sin(angle)
    for start in range(50):
        order = sort_points(points, normals, 0.1, start)
        assert points[order.index[0], axis] < points[order.index[-1], axis]


def test_coincident_points_are_ordered_by_place() -> None:
    points = np.array([[x, y, 0.0] for x in (0.0, 0.01, 0.02) for y in (0.001, 0.0, -0.001)])
    normals = np.tile([[0, 0, 1.0], [0, 1.0, 0], [0, -1.0, 0]], (3, 1))
    permutation = np.random.default_rng(1).permutation(9)
    a = sort_points(points, normals, 0.05, 4)
    b = sort_points(points[permutation], normals[permutation], 0.05, int(np.flatnonzero(permutation == 4)[0]))
    assert np.array_equal(points[a.index], points[permutation][b.index])


def test_a_gap_ends_the_walk(tube) -> None:
    whole = on_axis(tube)
    for low, high in ((0.3, 0.36), (0.7, 0.76)):  # 84 mm against r_n = 60 mm
        kept = np.flatnonzero((tube.s < low) | (tube.s > high))
        points, normals, s = whole[0][kept], whole[1][kept], tube.s[kept]
        for at in (0.1, 0.9):
            order = sort_points(points, normals, 0.06, int(np.argmin(np.abs(s - at))))
            here = s < low if at < low else s > high
            assert set(order.index) == set(np.flatnonzero(here))
            assert set(order.unreached) == set(np.flatnonzero(~here))
            assert (np.diff(order.unreached) > 0).all()
            assert order.s[[0, -1]] == pytest.approx([0, 1])


def test_a_narrow_gap_is_crossed(tube) -> None:
    points, normals = on_axis(tube)
    kept = (tube.s < 0.48) | (tube.s > 0.51)
    order = sort_points(points[kept], normals[kept], 0.06)
    assert len(order.unreached) == 0
    assert abs(agreement(order, tube.s[kept])) > 0.999


def test_a_second_object_is_not_reached(tube) -> None:
    points, normals = on_axis(tube)
    far = points + np.array([0, 0, 3.0])
    order = sort_points(np.vstack([points, far]), np.vstack([normals, normals]), 0.06, 100)
    assert set(order.index) == set(range(5000))
    assert np.array_equal(order.unreached, np.arange(5000, 10_000))


def test_all_in_one_place_has_no_length() -> None:
    order = sort_points(np.zeros((40, 3)), np.tile([0, 0, 1.0], (40, 1)), 0.1)
    assert order.length == 0.0
    assert (order.s == 0).all()


def test_default_start_is_in_the_middle_and_does_not_depend_on_the_order() -> None:
    points = np.random.default_rng(0).normal(size=(501, 3)) + np.array([5, 6, 7])
    start = choose_start(points)
    assert np.linalg.norm(points[start] - [5, 6, 7]) < 0.5
    assert choose_start(points[::-1]) == 500 - start


def test_units_do_not_matter(tube) -> None:
    points, normals = on_axis(tube)
    metres = sort_points(points, normals, 0.06, 5)
    millimetres = sort_points(1000 * points, normals, 60.0, 5)
    assert np.array_equal(metres.index, millimetres.index)
    assert millimetres.length == pytest.approx(1000 * metres.length)
