"""The skeleton line as a function: what it takes, what it gives, where it ends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.geometry.basis import CubicBSpline, InverseQuadratic
from dlogen.types import Basis, Skeleton

OFFSET = np.array([10.0, -20.0, 30.0])
BASES = [InverseQuadratic(9, 2.25), CubicBSpline(12)]


def line_on(basis: Basis) -> Skeleton:
    """With weights of size 1 and an offset that is seen if it is in the wrong place."""
    return Skeleton(basis, np.random.default_rng(5).normal(size=(basis.size, 3)), OFFSET, 1.0)


@pytest.fixture(params=BASES, ids=lambda basis: type(basis).__name__)
def line(request: pytest.FixtureRequest) -> Skeleton:
    return line_on(request.param)


@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_one_place_gives_a_point_and_several_give_rows(line: Skeleton, derivative: int) -> None:
    several = line([0.0, 0.3, 1.0], derivative)
    assert several.shape == (3, 3)
    for place in (0.3, np.float64(0.3), np.array(0.3)):
        assert line(place, derivative).shape == (3,)
        np.testing.assert_array_equal(line(place, derivative), line([0.3], derivative)[0])
        np.testing.assert_allclose(line(place, derivative), several[1], rtol=1e-12)
    assert line([0.3], derivative).shape == (1, 3)
    assert line([], derivative).shape == (0, 3)
    # Whole numbers are places, too.
    np.testing.assert_allclose(line(1, derivative), several[2], rtol=1e-12)
    np.testing.assert_allclose(line((0, 1), derivative), several[[0, 2]], rtol=1e-12)


def test_it_is_the_weighted_sum_of_equation_7(line: Skeleton) -> None:
    s = np.linspace(0.0, 1.0, 33)
    assert line(s) == pytest.approx(line.basis(s) @ line.weights + OFFSET, abs=1e-12)


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_derivatives_are_those_of_differences(line: Skeleton, derivative: int) -> None:
    # Places between the knots of the splines, whose third derivative jumps there.
    s, h = (np.arange(9) + 0.5) / 9, 1e-5
    numeric = (line(s + h, derivative - 1) - line(s - h, derivative - 1)) / (2 * h)
    exact = line(s, derivative)
    assert np.abs(exact).max() > 1.0
    np.testing.assert_allclose(exact, numeric, atol=1e-6 * np.abs(exact).max())


@given(
    st.sampled_from(BASES),
    st.floats(allow_nan=True, allow_infinity=True).filter(lambda s: not -1e-6 <= s <= 1.0 + 1e-6),
    st.lists(st.floats(0.0, 1.0), max_size=4),
    st.integers(0, 3),
)
def test_there_is_no_line_beyond_its_ends(basis: Basis, wrong: float, right: list[float], derivative: int) -> None:
    line = line_on(basis)
    with pytest.raises(ValueError, match="defined for s from 0 to 1") as caught:
        line(wrong, derivative)
    assert str(caught.value).endswith(f"not at {wrong:g}")
    with pytest.raises(ValueError, match="defined for s from 0 to 1") as caught:
        line([*right, wrong], derivative)
    assert str(caught.value).endswith(f"not at {wrong:g}")


@given(st.sampled_from(BASES), st.floats(0.0, 1.0))
def test_everywhere_between_there_is(basis: Basis, s: float) -> None:
    assert np.isfinite(line_on(basis)(s)).all()


def test_rounding_may_lead_a_little_beyond(line: Skeleton) -> None:
    for end, beyond in ((0.0, -1e-10), (1.0, 1.0 + 1e-10)):
        assert line(beyond) == pytest.approx(line(end), abs=1e-6)
    for too_far in (-1e-8, 1.0 + 1e-8):
        with pytest.raises(ValueError, match="from 0 to 1"):
            line(too_far)


def test_there_is_no_fourth_derivative(line: Skeleton) -> None:
    with pytest.raises(ValueError, match="derivative 4 is not available"):
        line(0.5, 4)
