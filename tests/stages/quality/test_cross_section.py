"""The shape of the cross-section: residuals whose shape is known, and two cables side by side."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.stages.quality.cross_section import _shape, check_cross_section


class TestCrossSection:
    def around(self, kind: str, amplitude: float, noise: float, seed: int, count: int = 6000, half: bool = False):
        """Findings about a tube of radius 20 mm whose residual has a shape: a harmonic, and where it turns."""
        rng = np.random.default_rng(seed)
        line = fit(sample_tube(centre_line("bent"), 0.02, 2000, 1).points).skeleton
        s = rng.uniform(0.0, 1.0, count)
        angle = rng.uniform(-np.pi, 0.0 if half else np.pi, count)
        tangent = line(s, 1)
        side = np.cross(tangent, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        up = np.cross(side, tangent / np.linalg.norm(tangent, axis=1, keepdims=True))
        shape = {
            "round": 0.0 * s,
            "oval": np.cos(2.0 * angle),
            "two humps": np.cos(4.0 * angle),
            "offset": np.cos(angle),
            "thick": np.ones(count),
            "oval here": np.cos(2.0 * angle) * (s < 0.4),
        }[kind]
        residual = 0.02 * (amplitude * shape + noise * rng.normal(size=count))
        away = (0.02 + residual)[:, None]
        points = line(s) + away * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up)
        return check_cross_section(points, s, residual, line, 0.02)

    @pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
    @pytest.mark.parametrize(("kind", "half"), [("oval", False), ("two humps", False), ("two humps", True)])
    def test_what_is_not_round_is_said(self, noise: float, kind: str, half: bool) -> None:
        (finding,) = self.around(kind, 0.3, noise, 1, half=half)
        assert (finding.code, finding.severity) == ("side-by-side", "doubtful")

    @pytest.mark.parametrize("kind", ["round", "offset", "thick", "oval here"])
    @pytest.mark.parametrize("noise", [0.0, 0.1, 0.4])
    @pytest.mark.parametrize("seed", range(3))
    def test_what_is_no_shape_is_not(self, kind: str, noise: float, seed: int) -> None:
        assert self.around(kind, 0.3, noise, seed) == []
        assert self.around(kind, 0.3, noise, seed, count=1200) == []

    def test_too_few_points_say_nothing(self) -> None:
        assert self.around("oval", 0.3, 0.0, 1, count=300) == []

    @pytest.mark.parametrize("noise", [0.001, 0.002])
    def test_two_cables_that_touch_along_their_length(self, noise: float) -> None:
        x = np.linspace(0.0, 0.5, 50)
        line = np.c_[x, 0.1 * np.sin(4.0 * x), 0.0 * x]
        lower, upper = (
            sample_tube(
                from_points(line + np.array([0.0, 0.0, z])), 0.01, 2500, seed, noise=noise, side=[0.3, 0.2, -1.0]
            ).points
            for z, seed in ((0.0, 1), (0.0205, 91))
        )
        quality = fit(np.vstack([lower, upper])).quality
        assert quality.verdict != "good"
        assert "side-by-side" in {finding.code for finding in quality.findings}


class TestShape:
    """One stretch: 16 sectors with known medians."""

    ANGLE = (np.arange(16) + 0.5) * (2.0 * np.pi / 16)

    def test_what_the_fit_makes_up_for_is_no_shape(self) -> None:
        medians = 1.0 + 0.5 * np.cos(self.ANGLE) - 0.3 * np.sin(self.ANGLE)
        assert _shape(np.full(16, 20), medians, np.zeros(320)) == pytest.approx((0.0, 0.0), abs=1e-7)

    @pytest.mark.parametrize("harmonic", [2, 3, 5])
    def test_a_harmonic_counts_with_its_root_mean_square(self, harmonic: int) -> None:
        medians = 1.0 + 0.2 * np.cos(harmonic * self.ANGLE + 0.4)
        assert _shape(np.full(16, 20), medians, np.zeros(320))[0] == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-6)

    def test_noise_is_not_taken_for_shape(self) -> None:
        rng = np.random.default_rng(0)
        shapes = []
        for _ in range(200):
            residual = 0.1 * rng.normal(size=(16, 25))
            medians = np.median(residual, axis=1)
            shape, noise = _shape(np.full(16, 25), medians, np.abs(residual - medians[:, None]).ravel())
            assert noise == pytest.approx(0.1, rel=0.25)
            shapes.append(shape)
        # The uncertainty of the medians is 25 mm of 0.1 m; taken off, about half of all have no shape left.
        assert 0.2 < np.mean(np.array(shapes) == 0.0) < 0.8
        assert np.mean(shapes) < 0.012

    def test_sectors_with_too_few_points_do_not_count(self) -> None:
        counts = np.full(16, 20)
        medians = np.cos(2.0 * self.ANGLE)
        counts[3], medians[3] = 9, 1e3
        assert _shape(counts, medians, np.zeros(309))[0] < 1.0
        counts[5:] = 9
        assert _shape(counts, medians, np.zeros(200)) is None
