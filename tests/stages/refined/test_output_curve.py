"""The fitted curve as it is given out, on curves that are known."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.linearisation import Solution
from dlogen.stages.refined.output_curve import curvature_std, output_curve, sharpest_bend, sufficient_spacing
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import TubeCurve, arc_table, through

#: The helix of the fixture `curve`: radius, rise a radian, arc length a radian.
A, B = 0.3, 0.1
SPEED = float(np.hypot(A, B))
LENGTH = 5.0 * SPEED


def helix(arc: np.ndarray) -> np.ndarray:
    """Points of the helix at these arc lengths."""
    t = np.asarray(arc) / SPEED
    return np.stack([A * np.cos(t), A * np.sin(t), B * t], axis=-1)


def parabola(intervals: int, peak: float = 0.0) -> TubeCurve:
    """(u, u^2, 0) for u from -1 - peak to 1 - peak: curvature 2 where u = 0, which is at x / n = (1 + peak) / 2.

    Its parameter is not arc length: at the vertex the speed is 2.
    """
    u = np.linspace(-1.0 - peak, 1.0 - peak, 6 * intervals + 1)
    return through(np.stack([u, u**2, 0 * u]), intervals, 1.0 / intervals)


class TestOutputCurve:
    @pytest.mark.parametrize(("start", "end"), [(0.0, LENGTH), (0.2, 1.1), (0.5, 0.6)])
    def test_follows_the_curve_between_two_arc_lengths(self, curve: TubeCurve, start: float, end: float) -> None:
        radius = 0.01
        made = output_curve(curve, start, end, radius)
        share = np.linspace(0.0, 1.0, 301)
        expected = helix(start + share * (end - start))
        away = np.linalg.norm(made(share * made.intervals) - expected, axis=1)
        # Its own deviation, 1e-4 radii, with that of an uneven parameter: 5e-5 of the length.
        assert away.max() < 2e-4 * radius + 5e-5 * (end - start)
        assert made.length == pytest.approx(end - start, rel=1e-9)
        assert made.intervals <= 2 * curve.intervals

    def test_goes_on_straight_beyond_the_ends(self, curve: TubeCurve) -> None:
        made = output_curve(curve, -0.05, LENGTH + 0.05, 0.01)
        tangent = np.array([0.0, A, B]) / SPEED
        assert made([0.0])[0] == pytest.approx(helix(0.0) - 0.05 * tangent, abs=5e-4)
        assert made.length == pytest.approx(LENGTH + 0.1, rel=1e-9)

    def test_the_parameter_is_arc_length(self) -> None:
        """Also of a curve whose own is not, by a factor of two."""
        curve = parabola(30)
        total = float(arc_table(curve)[1][-1])
        made = output_curve(curve, 0.0, total, 0.05)
        grid, arc, _ = arc_table(made)
        uneven = np.abs(arc / arc[-1] - grid / grid[-1]).max()
        assert uneven < 5e-5 or made.intervals == 60
        grid, arc, _ = arc_table(curve)
        assert np.abs(arc / arc[-1] - grid / grid[-1]).max() > 0.05

    def test_no_more_intervals_than_it_takes(self, curve: TubeCurve) -> None:
        """A thick object needs fewer than a thin one."""
        counts = [output_curve(curve, 0.0, LENGTH, radius).intervals for radius in (1.0, 1e-2, 1e-5)]
        assert counts[0] < counts[-1] <= 80


def test_the_spacing_is_that_of_the_theory(curve: TubeCurve) -> None:
    """D H^4 / 384 for the deviation and D H^2 / 12 for the curvature, D = a / c^4 of a helix."""
    fourth = A / SPEED**4
    for radius in (1e-4, 1e-3):
        by_place = (384.0 * 1e-4 * radius / fourth) ** 0.25
        by_bend = (12.0 * 0.01 * (A / SPEED**2) / fourth) ** 0.5
        assert sufficient_spacing(curve, radius) == pytest.approx(min(by_place, by_bend), rel=0.1)
    # So thick that only the bend matters.
    assert sufficient_spacing(curve, 1e3) == pytest.approx((12.0 * 0.01 * (A / SPEED**2) / fourth) ** 0.5, rel=0.1)


class TestSharpestBend:
    def test_of_a_helix_it_is_the_same_everywhere(self, curve: TubeCurve) -> None:
        bend, place = sharpest_bend(curve)
        assert bend == pytest.approx(A / SPEED**2, rel=0.01)
        assert 0.0 <= place <= 1.0

    @pytest.mark.parametrize("peak", [-0.7, -0.123, 0.0, 0.31, 0.6])
    def test_of_a_parabola_it_is_the_vertex(self, peak: float) -> None:
        bend, place = sharpest_bend(parabola(60, peak))
        assert bend == pytest.approx(2.0, rel=1e-3)
        assert place == pytest.approx((1.0 + peak) / 2.0, abs=1e-3)

    @pytest.mark.parametrize(("peak", "end"), [(-1.0, 0.0), (1.0, 1.0)])
    def test_may_be_at_an_end(self, peak: float, end: float) -> None:
        bend, place = sharpest_bend(parabola(40, peak))
        assert bend == pytest.approx(2.0, rel=5e-3)
        assert place == pytest.approx(end, abs=5e-3)


#: How much x, y and z of a coefficient scatter, so that it matters which way the bend points.
SHARES = np.array([1.0, 0.3, 4.0])


def tube_of(curve: TubeCurve, sigma: float, solution: Solution | None) -> Tube:
    nothing = np.zeros(0)
    return Tube(curve, 0.01, sigma, nothing, nothing, solution=solution)


class TestCurvatureStd:
    @staticmethod
    def solution(curve: TubeCurve, deviation: float) -> Solution:
        """As if all coefficients were uncertain by that much times `SHARES`, independently of one another."""
        size = curve.coefficients.size
        factor = np.zeros((12, size))
        factor[0] = 1.0 / (deviation * np.tile(SHARES, size // 3))
        return Solution(curve, 0.0, 0.0, 0.0, 0.0, factor, np.zeros(size), 1.0, np.zeros(size))

    def test_without_a_solution_there_is_none(self, curve: TubeCurve) -> None:
        assert curvature_std(tube_of(curve, 0.1, None), 3.0) == 0.0

    @pytest.mark.parametrize("x", [0.0, 36.3, 102.5, 199.99, 200.0])
    def test_against_random_curves(self, x: float) -> None:
        """The spread of the curvature of curves whose coefficients scatter so.

        The intervals are short, so that a coefficient changes the second derivative much more than the first.
        """
        curve = through(helix(np.linspace(0.0, LENGTH, 6 * 200 + 1)).T, 200, LENGTH / 200)
        sigma, deviation = 0.5, 1e-7
        found = curvature_std(tube_of(curve, sigma, self.solution(curve, deviation)), x)
        rng = np.random.default_rng(7)
        bends = []
        for _ in range(3000):
            moved = TubeCurve(
                curve.coefficients + sigma * deviation * SHARES * rng.normal(size=curve.coefficients.shape), curve.step
            )
            first, second = moved([x], 1)[0], moved([x], 2)[0]
            bends.append(np.linalg.norm(np.cross(first, second)) / np.linalg.norm(first) ** 3)
        # 3,000 tell a standard deviation to 1.3 %.
        assert found == pytest.approx(np.std(bends), rel=0.05)

    def test_grows_with_the_noise(self, curve: TubeCurve) -> None:
        solution = self.solution(curve, 1e-4)
        one, two = (curvature_std(tube_of(curve, sigma, solution), 11.2) for sigma in (0.1, 0.2))
        assert two == pytest.approx(2.0 * one, rel=1e-12)
        assert one > 0.0
