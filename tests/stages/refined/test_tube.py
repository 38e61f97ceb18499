"""The tube and the robust statistics of the distances to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.stages.refined.tube import Tube, expected_distance, median, robust_scale, tukey
from dlogen.stages.refined.tube_curve import TubeCurve


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


def test_weights_are_tukeys_biweight() -> None:
    # (1 - (z / 6)^2)^2, whatever the scale.
    assert tukey(np.array([3.0]), 1.0)[0] == pytest.approx(0.75**2)
    assert tukey(np.array([-2.0]), 2.0)[0] == pytest.approx((1.0 - 1.0 / 36.0) ** 2)


def test_expected_distance_without_noise_and_with_much() -> None:
    assert expected_distance(0.012, 0.0) == 0.012
    # Rice: sigma^2 = v - v^2 / (2 r^2) gives v = r^2 (1 - sqrt(1 - 2 sigma^2 / r^2)); the distance is r + v / (2 r).
    v = 1.0 - np.sqrt(1.0 - 2.0 * 0.5**2)
    assert expected_distance(1.0, 0.5) == pytest.approx(1.0 + 0.5 * v)
    assert expected_distance(2.0, 1.0) == pytest.approx(2.0 * (1.0 + 0.5 * v))
    # Noise larger than the radius can explain is cut off.
    assert expected_distance(1.0, 5.0) == pytest.approx(1.5)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_median_is_a_member_with_half_on_either_side(values: list[float]) -> None:
    assert median(np.array(values)) == sorted(values)[len(values) // 2]


def test_robust_scale_is_that_of_the_gaussian_core() -> None:
    rng = np.random.default_rng(0)
    residual = rng.normal(scale=0.3, size=100_000)
    assert robust_scale(residual) == pytest.approx(0.3, rel=0.01)
    assert robust_scale(-residual) == robust_scale(residual)
    residual[:5000] = 1e3
    assert robust_scale(residual) == pytest.approx(0.3, rel=0.1)
    # A shift counts: it is taken about zero, not about the median.
    assert robust_scale(np.full(10, 0.2)) == pytest.approx(1.4826 * 0.2)


def test_residuals_are_to_the_expected_distance(curve: TubeCurve) -> None:
    tube = Tube(curve, 0.02, 0.004, np.array([0.0, 1e-9, 20.0, 40.0]), np.array([0.02, 0.021, 0.03, 0.01]))
    # To second order sigma^2 / (2 r) = 0.4 mm.
    assert tube.residual == pytest.approx(np.array([-0.0004, 0.0006, 0.0096, -0.0104]), abs=2e-5)
    assert tube.on_curve.tolist() == [False, True, True, False]
