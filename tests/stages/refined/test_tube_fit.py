"""The parts of the tube fit: curve, foot points, normal equations, penalty, ends and gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.stages.refined.ends import find_ends, find_gaps
from dlogen.stages.refined.linearisation import Linearisation
from dlogen.stages.refined.normal_equations import normal_equations
from dlogen.stages.refined.tube import expected_distance, tukey
from dlogen.stages.refined.tube_curve import (
    TubeCurve,
    arc_table,
    foot_points,
    from_polyline,
    nearest,
    nearest_by_cells,
    reparametrised,
    through,
)


def helix(t, radius=0.3, rise=0.1):
    return np.stack([radius * np.cos(t), radius * np.sin(t), rise * t])


@pytest.fixture
def curve():
    t = np.linspace(0.0, 5.0, 6 * 40 + 1)
    return through(helix(t), 40, 5.0 * np.hypot(0.3, 0.1) / 40)


def test_curve_and_derivatives(curve):
    x = np.linspace(0.0, 40.0, 333)
    t, speed = x / 8.0, np.hypot(0.3, 0.1)
    assert np.allclose(curve(x), helix(t).T, atol=1e-6)
    first = np.stack([-0.3 * np.sin(t), 0.3 * np.cos(t), 0.1 + 0 * t], axis=1) / speed
    assert np.allclose(curve(x, 1), first, atol=1e-4)
    second = np.stack([-0.3 * np.cos(t), -0.3 * np.sin(t), 0 * t], axis=1) / speed**2
    assert np.allclose(curve(x, 2), second, atol=0.03)
    assert np.allclose(curve.curvature(np.array([0.25, 0.75])), 0.3 / speed**2, rtol=5e-3)
    places = np.array([0.2, 0.7])
    x = (np.arange(40)[:, None] + places).ravel()
    for derivative in (0, 1, 2):
        assert np.allclose(curve.everywhere(places, derivative).T, curve(x, derivative), atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), intervals=st.integers(8, 60))
def test_reparametrised_is_the_same_curve_by_arc_length(seed, intervals):
    rng = np.random.default_rng(seed)
    knots = np.arange(15.0)[:, None] * [0.1, 0.0, 0.0] + rng.uniform(-0.03, 0.03, (15, 3))
    curve = TubeCurve(knots, 0.1)
    even = reparametrised(curve, 60 + intervals)
    _, arc, _ = arc_table(even)
    assert np.abs(arc / arc[-1] - np.linspace(0.0, 1.0, len(arc))).max() < 2e-4
    x = np.linspace(0.0, curve.intervals, 50)
    foot = nearest(even, curve(x).T, 0.005)
    assert np.linalg.norm(foot_points(even, curve(x).T, foot, 3)[3], axis=0).max() < 2e-4
    assert np.allclose(even([0.0, even.intervals]), curve([0.0, curve.intervals]), atol=2e-4)


def test_extension_goes_on_straight(curve):
    longer = reparametrised(curve, 60, -0.1, 1.7)
    start, tangent = curve([0.0])[0], curve([0.0], 1)[0]
    assert np.allclose(longer([0.0])[0], start - 0.1 * tangent, atol=2e-4)
    assert longer.length == pytest.approx(1.8)


def test_polyline_with_repeated_vertices():
    points = np.repeat(np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 11), 2, axis=0)
    line = from_polyline(points, 0.05, 0.1, 1.0)
    assert np.allclose(line([0.0, line.intervals]), [[-0.1, 0, 0], [1.1, 0, 0]], atol=1e-9)


def test_foot_points_against_brute_force(curve):
    rng = np.random.default_rng(0)
    points = curve(rng.uniform(1.0, 39.0, 300)).T + rng.normal(scale=0.02, size=(3, 300))
    x, k, t, offset = foot_points(curve, points, nearest(curve, points, 0.02), 3)
    dense = np.linspace(0.0, 40.0, 40001)
    distance = np.linalg.norm(points.T[:, None] - curve(dense)[None, ::20], axis=2).min(axis=1)
    assert np.allclose(np.linalg.norm(offset, axis=0), distance, atol=1e-4)
    assert np.allclose(offset, points - curve(x).T, atol=1e-9)
    assert np.allclose(k + t, x)
    assert np.abs(np.sum(offset * curve(x, 1).T, axis=0)).max() < 1e-9


def test_cells_find_the_same_feet(curve):
    rng = np.random.default_rng(1)
    points = curve(rng.uniform(1.0, 39.0, 140_000)).T + rng.normal(scale=0.01, size=(3, 140_000))
    exact = foot_points(curve, points, nearest(curve, points, 0.02), 3)[0]
    by_cells = foot_points(curve, points, nearest_by_cells(curve, points, 0.02), 3)[0]
    assert np.allclose(exact, by_cells, atol=1e-6)


def system(curve, points, rho, weight=None):
    x, k, t, offset = foot_points(curve, points, nearest(curve, points, 0.02), 6)
    distance = np.linalg.norm(offset, axis=0)
    weight = np.ones(len(x)) if weight is None else weight
    return normal_equations(k, t, offset / distance, distance - rho, weight, curve.intervals), distance


def test_normal_equations_are_the_derivatives_of_the_distances(curve):
    rng = np.random.default_rng(2)
    points = curve(rng.uniform(3.0, 37.0, 200)).T + rng.normal(scale=0.03, size=(3, 200))
    weight = rng.uniform(0.2, 1.0, 200)
    sums, distance = system(curve, points, 0.02, weight)
    problem = Linearisation(curve, sums, True)
    assert sums.weight == pytest.approx(weight.sum())
    assert sums.squares == pytest.approx(np.sum(weight * (distance - 0.02) ** 2))
    step = 1e-6
    for j, c in ((0, 0), (7, 1), (20, 2), (42, 0), (33, 1)):
        changed = curve.coefficients.copy()
        changed[j, c] += step
        other, moved = system(TubeCurve(changed, curve.step), points, 0.02, weight)
        # The gradient of half the squares is minus the right-hand side.
        assert (other.squares - sums.squares) / (2.0 * step) == pytest.approx(
            -problem.right[3 * j + c], rel=1e-3, abs=1e-5
        )
        assert np.sum(weight * (moved - distance)) / step == pytest.approx(
            -problem.radius[3 * j + c], rel=1e-3, abs=1e-3
        )
        assert problem.data[0, 3 * j + c] == pytest.approx(
            np.sum(weight * ((moved - distance) / step) ** 2), rel=1e-3, abs=1e-5
        )


def test_penalty_leaves_circles_and_lines_alone():
    angle = np.linspace(0.0, 2.0, 6 * 30 + 1)
    points = np.random.default_rng(0).normal(size=(3, 50))
    circle = through(np.stack([np.cos(angle), np.sin(angle), 0 * angle]), 30, 2.0 / 30)
    spiral = through(np.stack([np.cos(angle) * (1 + angle), np.sin(angle) * (1 + angle), 0 * angle]), 30, 4.0 / 30)
    line = through(np.stack([angle, 2 * angle, 0 * angle]), 30, 2.0 * np.sqrt(5.0) / 30)
    energy = {
        name: Linearisation(curve, system(curve, points, 0.1)[0], False).energy
        for name, curve in (("circle", circle), ("spiral", spiral), ("line", line))
    }
    assert energy["line"] < 1e-12
    assert energy["circle"] < 1e-2 * energy["spiral"]


def test_expected_distance_against_random_points():
    rng = np.random.default_rng(0)
    for noise in (0.05, 0.15, 0.3):
        distance = np.hypot(1.0 + noise * rng.normal(size=400_000), noise * rng.normal(size=400_000))
        assert expected_distance(1.0, distance.std()) == pytest.approx(distance.mean(), abs=0.0025)


def test_weights_vanish_far_away():
    weight = tukey(np.array([0.0, 1.0, 3.0, 6.0, -6.0, 100.0]), 1.0)
    assert weight[0] == 1.0
    assert np.all(np.diff(weight[:4]) < 0.0)
    assert np.all(weight[3:] == 0.0)


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("strays", [0, 30])
def test_ends_are_unbiased(noise, strays):
    rng = np.random.default_rng(5)
    off = []
    for _ in range(60):
        s = rng.uniform(0.2, 1.2, 1500) + noise * rng.normal(size=1500)
        s = np.append(s, rng.uniform(0.0, 1.4, strays // 10))
        deviation = np.concatenate([np.abs(rng.normal(size=1500)), rng.uniform(5.0, 15.0, strays // 4)])
        first, last = find_ends(s, deviation, noise)
        off += [(0.2 - first.position) / first.std, (last.position - 1.2) / last.std]
    # In units of the reported standard deviation. A stray point just beyond an end cannot be told from the object.
    assert abs(np.mean(np.clip(off, -3.0, 3.0))) < (0.6 if strays else 0.3)
    assert 0.5 < np.std(np.clip(off, -3.0, 3.0)) < (1.8 if strays else 1.4)


def test_gaps():
    rng = np.random.default_rng(6)
    s = rng.uniform(0.0, 1.0, 4000)
    assert find_gaps(s, 0.0, 1.0, 0.012) == ()
    s = s[((s < 0.3) | (s > 0.33)) & ((s < 0.34) | (s > 0.4))]
    assert np.allclose(find_gaps(s, 0.0, 1.0, 0.012), [(0.3, 0.33), (0.34, 0.4)], atol=2e-3)
    # The same holes are nothing unusual among few points, nor for a thick object.
    assert find_gaps(np.sort(s)[::60], 0.0, 1.0, 0.012) == ()
    assert find_gaps(s, 0.0, 1.0, 0.08) == ()
