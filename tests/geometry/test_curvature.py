"""Curvature of known curves (Eq. 16)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import centre_line, hose_centre_line, random_centre_line
from dlogen.geometry.curvature import curvature, max_curvature


@settings(deadline=None, max_examples=30)
@given(st.floats(0.01, 5.0), st.floats(0.1, 6.0))
def test_circle(circle, radius: float, angle: float) -> None:
    line = circle(radius, angle)
    s = np.linspace(0, 1, 11)
    assert curvature(line, s) == pytest.approx(np.full(11, 1 / radius), rel=1e-9)
    assert max_curvature(line)[0] == pytest.approx(1 / radius, rel=1e-9)


@settings(deadline=None, max_examples=30)
@given(st.floats(0.01, 2.0), st.floats(-2.0, 2.0), st.floats(0.5, 20.0))
def test_helix(helix, a: float, b: float, angle: float) -> None:
    kappa = curvature(helix(a, b, angle), np.linspace(0, 1, 11))
    assert kappa == pytest.approx(np.full(11, a / (a * a + b * b)), rel=1e-9)


def test_straight(straight) -> None:
    line = straight([0.1, 0.2, 0.3], [1.0, -2.0, 0.5])
    assert (curvature(line, np.linspace(0, 1, 11)) == 0).all()
    assert max_curvature(line)[0] == 0.0


@pytest.mark.parametrize("name", ["bent", "helical"])
def test_curves_at_uneven_speed(exact_line, name: str) -> None:
    truth = centre_line(name)
    s = np.linspace(0, 1, 101)
    assert curvature(exact_line(truth), truth.parameter(s)) == pytest.approx(truth.curvature(s), rel=1e-9)


def test_the_largest_is_found_and_where_it_is(exact_line) -> None:
    # The paper's hose: 14.5 cm at s = 0.33.
    kappa, s = max_curvature(exact_line(hose_centre_line()))
    assert 1 / kappa == pytest.approx(0.145, rel=1e-6)
    assert s == pytest.approx(0.33, abs=1e-3)
    # Half an ellipse with the half axes 1 and 2, vertex at both ends: a / b^2 = 2.
    assert max_curvature(exact_line(centre_line("bent")))[0] == pytest.approx(2.0, rel=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 1000))
def test_the_largest_on_random_lines(exact_line, seed: int) -> None:
    truth = random_centre_line(seed)
    assert max_curvature(exact_line(truth))[0] == pytest.approx(truth.max_curvature(), rel=1e-6)


def test_a_narrow_peak_between_the_samples(exact_line) -> None:
    # A hyperbola (u, sqrt(u^2 + a^2)) with its vertex between two samples; curvature 1 / a there.
    a, vertex = 0.002, 0.50023

    def curve(s, derivative):
        u = s - vertex
        root = np.sqrt(u * u + a * a)
        x, y = ((u, root), (np.ones_like(u), u / root), (np.zeros_like(u), a * a / root**3))[derivative]
        return np.stack([x, y, np.zeros_like(u)], axis=-1)

    kappa, s = max_curvature(exact_line(curve))
    assert kappa == pytest.approx(1 / a, rel=1e-4)
    assert s == pytest.approx(vertex, abs=1e-4)


def test_a_cusp_is_no_division_by_zero(exact_line) -> None:
    def cusp(s, derivative):
        t = 2 * s - 1
        x, y = ((t**3, t**2), (6 * t**2, 4 * t), (24 * t, np.full_like(t, 8.0)))[derivative]
        return np.stack([x, y, np.zeros_like(t)], axis=-1)

    kappa, _ = max_curvature(exact_line(cusp))
    assert np.isfinite(kappa)
    assert kappa > 1e3
