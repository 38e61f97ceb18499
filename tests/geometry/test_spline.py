"""The B-splines of an interval: three ways to write the same functions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from dlogen.geometry.basis import CubicBSpline
from dlogen.geometry.spline import MONOMIALS, THIRD_DIFFERENCE, spline_values

places = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20).map(np.array)


@given(places)
def test_values_are_those_of_the_basis(t: np.ndarray) -> None:
    # One interval: four functions over [0, 1].
    assert pytest.approx(CubicBSpline(4)(t), abs=1e-15) == spline_values(t).T


@given(places)
def test_values_are_those_of_scipy(t: np.ndarray) -> None:
    knots = np.arange(-3.0, 5.0)
    for q in range(4):
        weights = np.eye(4)[q]
        assert spline_values(t)[q] == pytest.approx(BSpline(knots, weights, 3)(t), abs=1e-14)


@given(places)
def test_monomials_are_the_same_functions(t: np.ndarray) -> None:
    powers = t[:, None] ** np.arange(4)
    assert pytest.approx(spline_values(t), abs=1e-15) == (powers @ MONOMIALS).T


@given(places)
def test_they_add_up_to_one_and_are_mirror_images(t: np.ndarray) -> None:
    values = spline_values(t)
    assert values.sum(axis=0) == pytest.approx(1.0, abs=1e-15)
    assert values[::-1] == pytest.approx(spline_values(1.0 - t), abs=1e-15)


def test_third_differences_are_the_third_derivative() -> None:
    coefficients = np.array([[0.3, 1.0, 0.0], [-2.0, 0.5, 1.0], [0.7, 0.0, 4.0], [1.1, -3.0, 2.0]])
    expected = CubicBSpline(4).combine(np.array([0.4]), coefficients, 3)[0]
    assert THIRD_DIFFERENCE @ coefficients == pytest.approx(expected, abs=1e-12)
    # The coefficient of t^3, times 3!.
    assert 6.0 * MONOMIALS[3] == pytest.approx(THIRD_DIFFERENCE, abs=1e-15)
