"""Centre lines against what is known of them by other means."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from dlogen.evaluation.centre_line import CentreLine, from_points, from_tangent
from dlogen.evaluation.shapes import (
    centre_line,
)


def test_derivatives_are_those_of_the_curve(line: CentreLine) -> None:
    t, h = np.linspace(0.03, 0.97, 23), 1e-5
    for derivative in (0, 1):
        numeric = (line.curve(t + h, derivative) - line.curve(t - h, derivative)) / (2 * h)
        exact = line.curve(t, derivative + 1)
        # The third derivative of the spline through points jumps at its knots.
        assert np.abs(numeric - exact).max() < 1e-4 * max(1.0, np.abs(exact).max())


def test_arc_length_against_another_quadrature(line: CentreLine) -> None:
    def speed(t: float) -> float:
        return float(np.linalg.norm(line.curve(np.array([t]), 1)))

    for s in (0.13, 0.5, 0.81):
        t = float(line.parameter(s)[0])
        pieces = [0.0, *(float(knot) for knot in line.knots if 0 < knot < t), t]
        arc = sum(quad(speed, a, b, epsabs=1e-13)[0] for a, b in pairwise(pieces))
        assert arc == pytest.approx(s * line.length, abs=1e-10)


def test_points_are_even_in_arc_length(line: CentreLine) -> None:
    steps = np.linalg.norm(np.diff(line.points(20001), axis=0), axis=1)
    # A chord is shorter than its arc by kappa^2 h^2 / 24 of it, which is what is left.
    assert np.ptp(steps) / steps.mean() < line.max_curvature() ** 2 * steps.mean() ** 2 / 24 + 1e-9
    assert steps.sum() == pytest.approx(line.length, rel=1e-6)


def test_from_points_goes_through_the_points_in_order() -> None:
    given_points = centre_line("helical").points(60)
    line = from_points(given_points)
    s, distance = line.nearest(given_points)
    assert distance.max() < 1e-9
    assert (np.diff(s) > 0).all()
    assert line.length == pytest.approx(centre_line("helical").length, rel=1e-4)
    np.testing.assert_allclose(from_points([[0, 0, 0], [0, 3, 4]])(0.5), [[0, 1.5, 2]], atol=1e-12)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[0, 0, 0]], "two points"),
        ([[0, 0], [1, 1]], "two points"),
        ([[0, 0, 0], [np.nan, 0, 0]], "finite"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0]], "point 3"),
    ],
)
def test_from_points_refuses(points: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        from_points(points)


def test_nearest_finds_foot_points_of_points_off_the_line(line: CentreLine) -> None:
    rng = np.random.default_rng(0)
    s = rng.uniform(0.02, 0.98, 200)
    tangents = line.tangents(s)
    across = np.cross(tangents, rng.normal(size=(200, 3)))
    points = line(s) + 0.015 * across / np.linalg.norm(across, axis=1, keepdims=True)
    found, distance = line.nearest(points)
    np.testing.assert_allclose(distance, 0.015, atol=1e-12)
    np.testing.assert_allclose(found, s, atol=1e-9)


def test_a_moved_line_is_the_same_line_elsewhere() -> None:
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([5e5, 5e6, 100.0])
    line = centre_line("bent")
    moved = line.moved(turn, shift)
    np.testing.assert_allclose(moved.points(50), line.points(50) @ turn.T + shift, rtol=0, atol=2e-9)
    assert moved.length == pytest.approx(line.length, rel=1e-14)


def test_from_tangent_is_the_integral_of_its_tangent() -> None:
    # An arc of 2 m and radius 0.5 m that starts at the origin along x.
    def tangent(s, derivative):
        angle = 4.0 * s + derivative * np.pi / 2
        return 4.0**derivative * np.stack([np.cos(angle), np.sin(angle), 0.0 * s], axis=-1)

    arc = from_tangent("arc", 2.0, tangent)
    s = np.linspace(0.0, 1.0, 101)
    assert arc.length == pytest.approx(2.0, rel=1e-12)
    assert arc(s) == pytest.approx(0.5 * np.stack([np.sin(4 * s), 1 - np.cos(4 * s), 0 * s], axis=1), abs=1e-12)
    assert arc.tangents(s) == pytest.approx(tangent(s, 0), abs=1e-12)
    assert arc.curvature(s) == pytest.approx(np.full(101, 2.0))
    assert arc.max_curvature() == pytest.approx(2.0)


def test_the_largest_curvature_is_found_between_samples() -> None:
    # An ellipse with the half axes 1 and 2: a / b^2 = 2 at its vertices.
    assert centre_line("bent").max_curvature() == pytest.approx(2.0, rel=1e-9)
    assert centre_line("straight").max_curvature() == pytest.approx(0.0, abs=1e-9)
