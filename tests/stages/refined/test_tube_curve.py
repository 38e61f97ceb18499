"""The curve of the tube fit: values, derivatives, arc length and foot points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from dlogen.geometry.vectors import column_dots
from dlogen.stages.refined.tube_curve import (
    TubeCurve,
    arc_at,
    arc_table,
    evened,
    foot_points,
    from_polyline,
    nearest,
    nearest_by_cells,
    reparametrised,
    spline_values,
    through,
)

Array = np.ndarray


def helix(t: Array, radius: float = 0.3, rise: float = 0.1) -> Array:
    return np.stack([radius * np.cos(t), radius * np.sin(t), rise * t])


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


def test_the_four_b_splines_are_those_of_the_literature() -> None:
    t = np.linspace(0.0, 1.0, 21)[:-1]
    # The uniform cubic B-splines that are not zero on [3, 4] of the knots 0, 1, 2, ...
    expected = [BSpline.basis_element(np.arange(q, q + 5.0), extrapolate=False)(3.0 + t) for q in range(4)]
    assert np.allclose(spline_values(t), expected, atol=1e-14)


def test_values_are_the_weighted_sum_of_the_b_splines() -> None:
    rng = np.random.default_rng(4)
    curve = TubeCurve(rng.normal(size=(12, 3)), 0.2)
    x = rng.uniform(0.0, 9.0, 50)
    k = x.astype(int)
    expected = sum(spline_values(x - k)[q][:, None] * curve.coefficients[k + q] for q in range(4))
    assert np.allclose(curve(x), expected, atol=1e-13)
    assert np.allclose(curve.at(k, x - k).T, expected, atol=1e-13)
    assert (curve.intervals, curve.length) == (9, pytest.approx(1.8))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), intervals=st.integers(4, 30), step=st.floats(0.01, 10.0))
def test_cubics_are_met_exactly_with_all_derivatives(seed: int, intervals: int, step: float) -> None:
    polynomial = [np.polynomial.Polynomial(c) for c in np.random.default_rng(seed).normal(size=(3, 4))]
    length = step * intervals
    at = np.linspace(0.0, length, 6 * intervals + 1)
    curve = through(np.stack([p(at / length) for p in polynomial]), intervals, step)
    x = np.linspace(0.0, intervals, 41)
    for derivative in (0, 1, 2):
        # With respect to arc length: one unit of x is `step` metres.
        expected = [p.deriv(derivative)(x / intervals) / length**derivative for p in polynomial]
        assert np.allclose(
            curve(x, derivative).T * length**derivative, np.multiply(expected, length**derivative), atol=1e-6
        )


def test_smoothing_leaves_parabolas_and_takes_wiggles() -> None:
    at = np.linspace(0.0, 1.0, 6 * 20 + 1)
    plain = np.stack([at, at**2, 1.0 - at])
    wiggle = plain + 0.01 * np.sin(60.0 * at)
    x = np.linspace(0.0, 20.0, 101)
    assert np.allclose(through(plain, 20, 0.05, 1e3)(x), through(plain, 20, 0.05)(x), atol=1e-9)
    parabola = np.stack([x / 20, (x / 20) ** 2, 1 - x / 20], axis=1)
    rough, smooth = (np.abs(through(wiggle, 20, 0.05, weight)(x) - parabola).max() for weight in (0.0, 1e6))
    assert rough > 0.009
    assert smooth < 0.005


def test_dot_is_by_columns() -> None:
    a, b = np.random.default_rng(0).normal(size=(2, 3, 20))
    assert np.allclose(column_dots(a, b), np.einsum("cm,cm->m", a, b), atol=1e-14)


def test_arc_table_of_a_parabola() -> None:
    # (x, x^2, 0): s = (2 x sqrt(1 + 4 x^2) + asinh(2 x)) / 4.
    at = np.linspace(0.0, 2.0, 6 * 16 + 1)
    curve = through(np.stack([at, at**2, 0 * at]), 16, 1.0)
    x, length, speed = arc_table(curve)
    assert np.array_equal(x, np.arange(4 * 16 + 1) / 4)
    u = x / 8
    assert np.allclose(length, (2 * u * np.sqrt(1 + 4 * u**2) + np.arcsinh(2 * u)) / 4, atol=1e-8)
    assert np.allclose(speed, np.sqrt(1 + 4 * u**2) / 8, atol=1e-9)
    assert arc_at(length, x[:-1]) == pytest.approx(length[:-1])
    # Between the table's places the speed is taken for even.
    assert arc_at(length, x[:-1] + 0.05) == pytest.approx(length[:-1] + 0.2 * np.diff(length))


def test_between_other_ends_it_is_that_part(curve: TubeCurve) -> None:
    part = reparametrised(curve, 50, 0.3, 0.9)
    assert part.intervals == 50
    assert part.length == pytest.approx(0.6)
    speed = np.hypot(0.3, 0.1)
    for x in (0.0, 20.0, 50.0):
        assert np.allclose(part([x])[0], helix((0.3 + 0.6 * x / 50) / speed), atol=1e-5)


def test_evened_only_if_the_speed_differs(curve: TubeCurve) -> None:
    assert evened(curve) is curve
    # Along the helix at a speed that grows.
    u = np.linspace(0.0, 1.0, 6 * 40 + 1)
    uneven = through(helix(5.0 * (0.7 * u + 0.3 * u**2)), 40, curve.step)
    even = evened(uneven)
    assert even is not uneven
    assert np.allclose(np.linalg.norm(even(np.linspace(0, 40, 201), 1), axis=1), 1.0, atol=1e-4)
    assert np.allclose(even(np.linspace(0, 40, 201)), curve(np.linspace(0, 40, 201)), atol=1e-5)
    for share, is_even in ((1e-2, False), (1e-4, True)):
        little = through(helix(5.0 * ((1.0 - share) * u + share * u**2)), 40, curve.step)
        assert (evened(little) is little) == is_even


def test_feet_stay_on_the_curve(curve: TubeCurve) -> None:
    tangents = curve([0.0, 40.0], 1)
    beyond = curve([0.0, 40.0]) + np.array([[-0.05], [0.05]]) * tangents
    x, _, _, offset = foot_points(curve, beyond.T, np.array([1.0, 39.0]), 6)
    assert x.tolist() == [0.0, 40.0]
    assert np.allclose(np.linalg.norm(offset, axis=0), 0.05, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_feet_do_not_depend_on_place_turn_and_units(curve: TubeCurve, scale: float) -> None:
    rng = np.random.default_rng(7)
    points = curve(rng.uniform(1.0, 39.0, 100)).T + rng.normal(scale=0.02, size=(3, 100))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = TubeCurve(scale * curve.coefficients @ turn.T + [3.0, -2.0, 1.0], scale * curve.step)
    feet = foot_points(curve, points, nearest(curve, points, 0.02), 4)[0]
    there = scale * turn @ points + np.array([[3.0], [-2.0], [1.0]])
    again = foot_points(moved, there, nearest(moved, there, scale * 0.02), 4)[0]
    assert np.allclose(feet, again, atol=1e-7)


def test_nearest_is_within_half_a_sample(curve: TubeCurve) -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(0.0, 40.0, 200)
    for spacing in (0.1, 0.02, 0.005):
        assert np.abs(nearest(curve, curve(x).T, spacing) - x).max() * curve.step <= 0.5 * spacing + 1e-4
