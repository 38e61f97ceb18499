from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.geometry.basis import CubicBSpline, InverseQuadratic, basis_from_dict

BASES = [
    InverseQuadratic(21, 21 / 4),
    InverseQuadratic(1, 2.0),
    InverseQuadratic(7, 30.0),
    CubicBSpline(4),
    CubicBSpline(40),
]


def test_inverse_quadratic_is_equation_8() -> None:
    basis = InverseQuadratic(21, 5.25)
    for s in (0.0, 0.123, 1.0):
        by_hand = [1.0 / (1.0 + 5.25**2 * abs(s - j / 20) ** 2) for j in range(21)]
        assert basis(np.array([s]))[0] == pytest.approx(by_hand, abs=1e-15)


@pytest.mark.parametrize("basis", BASES, ids=repr)
@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_derivatives_match_differences_of_the_one_below(basis, derivative: int) -> None:
    # Off the knots of the splines, where the third derivative jumps.
    s, h = np.linspace(0.003, 0.997, 77) + 1e-4, 1e-6
    numeric = (basis(s + h, derivative - 1) - basis(s - h, derivative - 1)) / (2 * h)
    exact = basis(s, derivative)
    assert np.allclose(exact, numeric, atol=1e-6 * max(1.0, np.abs(exact).max()))


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_shapes_and_unknown_derivatives(basis) -> None:
    assert basis(np.linspace(0, 1, 5)).shape == (5, basis.size)
    assert basis(np.empty(0)).shape == (0, basis.size)
    with pytest.raises(ValueError, match="derivative 4"):
        basis(np.array([0.5]), 4)


@pytest.mark.parametrize("basis", BASES, ids=repr)
@pytest.mark.parametrize("derivative", range(4))
def test_combine_is_the_weighted_sum(basis, derivative: int) -> None:
    s = np.linspace(0, 1, 23)
    weights = np.random.default_rng(0).normal(size=(basis.size, 3))
    assert basis.combine(s, weights, derivative) == pytest.approx(basis(s, derivative) @ weights, rel=1e-12, abs=1e-9)


def test_cubic_b_splines_are_those_of_scipy() -> None:
    from scipy.interpolate import BSpline

    size, intervals = 12, 9
    knots = np.arange(-3, intervals + 4) / intervals
    s = np.linspace(0, 1, 101)
    for derivative in range(3):
        for j in range(size):
            coefficients = np.eye(size)[j]
            expected = BSpline(knots, coefficients, 3)(s, nu=derivative)
            assert CubicBSpline(size)(s, derivative)[:, j] == pytest.approx(expected, abs=1e-10 * intervals**derivative)


@settings(deadline=None, max_examples=50)
@given(st.integers(4, 200), st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_cubic_b_splines_are_a_partition_of_unity(size: int, s: list[float]) -> None:
    values = CubicBSpline(size)(np.array(s))
    assert (values >= 0).all()
    assert values.sum(axis=1) == pytest.approx(np.ones(len(s)), abs=1e-12)
    assert (np.count_nonzero(values, axis=1) <= 4).all()


def test_cubic_b_splines_reproduce_a_straight_line() -> None:
    # Greville abscissae as coefficients give s itself.
    basis = CubicBSpline(10)
    greville = (np.arange(10) - 1) / 7
    s = np.linspace(0, 1, 33)
    assert basis(s) @ greville == pytest.approx(s, abs=1e-14)
    assert basis(s, 1) @ greville == pytest.approx(np.ones(33), abs=1e-12)


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_round_trip_through_a_dictionary(basis) -> None:
    assert basis_from_dict(basis.to_dict()) == basis


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown basis 'fourier'"):
        basis_from_dict({"kind": "fourier", "size": 3})
