"""The fitted curve as it is given out: few knots that follow it, and its sharpest bend."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.output_curve import curvature_std, output_curve, sharpest_bend, sufficient_spacing
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import TubeCurve, through

RADIUS, RISE = 0.3, 0.1
SPEED = float(np.hypot(RADIUS, RISE))


def test_fewer_intervals_follow_a_smooth_curve(curve: TubeCurve) -> None:
    out = output_curve(curve, 0.2, 1.2, 0.01)
    assert out.intervals < 40
    assert out.length == pytest.approx(1.0)
    for share in np.linspace(0.0, 1.0, 30):
        t = (0.2 + share) / SPEED
        expected = [RADIUS * np.cos(t), RADIUS * np.sin(t), RISE * t]
        assert np.linalg.norm(out([share * out.intervals])[0] - expected) < 2e-4 * 0.01 + 5e-6
    speeds = np.linalg.norm(out(np.linspace(0.0, out.intervals, 100), 1), axis=1)
    assert speeds == pytest.approx(np.ones(100), abs=1e-3)


def test_spacing_scales_with_the_curve_and_shrinks_with_the_tube(curve: TubeCurve) -> None:
    spacing = sufficient_spacing(curve, 0.01)
    large = TubeCurve(100.0 * curve.coefficients, 100.0 * curve.step)
    assert sufficient_spacing(large, 1.0) == pytest.approx(100.0 * spacing)
    # Where the deviation decides: a ten-thousandth of the radius, to the fourth root.
    assert sufficient_spacing(curve, 1.6e-3) == pytest.approx(2.0 * sufficient_spacing(curve, 1e-4))


def test_the_sharpest_bend_and_where_it_is() -> None:
    # (u, u^2): curvature 2 at u = 0, which is 0.3 of the way by the parameter.
    u = np.linspace(-0.3, 0.7, 6 * 40 + 1)
    kappa, place = sharpest_bend(through(np.stack([u, u**2, 0 * u]), 40, 1.0 / 40))
    assert kappa == pytest.approx(2.0, rel=1e-4)
    assert place == pytest.approx(0.3, abs=0.002)


def test_a_helix_bends_the_same_everywhere(curve: TubeCurve) -> None:
    assert sharpest_bend(curve)[0] == pytest.approx(RADIUS / SPEED**2, rel=0.02)


def test_without_a_solution_nothing_is_known_of_its_uncertainty(curve: TubeCurve) -> None:
    assert curvature_std(Tube(curve, 0.01, 1e-3, np.zeros(1), np.zeros(1)), 3.0) == 0.0
