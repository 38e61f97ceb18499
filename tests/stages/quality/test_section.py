"""The pooled cross-section: circles, ellipses and arcs around a line that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.vectors import unit
from dlogen.pipeline import fit
from dlogen.stages.quality.section import Section, ellipse_through, misfit, pooled_section
from dlogen.types import Skeleton

Array = np.ndarray


def section(width: float, height: float, half: float, noise: float, count: int = 6000, seed: int = 0) -> Section:
    """An elliptic section of which so many degrees of phase to either side of the top are seen."""
    rng = np.random.default_rng(seed)
    phase = np.radians(rng.uniform(-half, half, count))
    side = 0.5 * width * np.sin(phase) + noise * rng.normal(size=count)
    up = 0.5 * height * np.cos(phase) + noise * rng.normal(size=count)
    return Section(np.arange(count), side, up, np.radians(half), half == 180.0)


@pytest.fixture(scope="module")
def line() -> Skeleton:
    return fit(sample_tube(centre_line("bent"), 0.02, 2000, 1).points).skeleton


class TestEllipse:
    @pytest.mark.parametrize("half", [180.0, 84.0, 70.0])
    @pytest.mark.parametrize("ratio", [1.0, 0.7, 0.4])
    @pytest.mark.parametrize("shift", [0.0, 0.3])
    def test_axes_and_centre(self, half: float, ratio: float, shift: float) -> None:
        seen = section(0.02, 0.02 * ratio, half, 0.0002)
        # The axis of the model is elsewhere.
        found = ellipse_through(replace(seen, up=seen.up + 0.01 * shift))
        assert found is not None
        assert found.width == pytest.approx(0.02, rel=0.02)
        assert found.height == pytest.approx(0.02 * ratio, rel=0.04)
        assert (found.side, found.up) == pytest.approx((0.0, 0.01 * shift), abs=0.0003)
        assert found.noise == pytest.approx(0.0002, rel=0.1)

    def test_the_ratio_is_as_uncertain_as_it_says(self) -> None:
        off = []
        for seed in range(40):
            found = ellipse_through(section(0.02, 0.02, 80.0, 0.0003, 1500, seed))
            assert found is not None
            off.append(np.log(found.height / found.width) / found.ratio_std)
        assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.35)

    def test_too_few_points_and_a_flat_top_show_none(self) -> None:
        assert ellipse_through(section(0.02, 0.02, 180.0, 0.0, 150)) is None
        x = np.random.default_rng(0).uniform(-0.01, 0.01, 1000)
        flat = Section(np.arange(1000), x, np.full(1000, 0.01), 0.8, False)
        found = ellipse_through(flat)
        assert found is None or found.height < 0.2 * found.width


class TestMisfit:
    def test_a_circle_has_none_wherever_its_centre_is(self) -> None:
        for half in (180.0, 80.0):
            seen = section(0.02, 0.02, half, 0.0)
            found = misfit(replace(seen, up=seen.up + 1e-4, side=seen.side - 1e-4))
            assert found is not None
            assert found.shape < 1e-5

    def test_an_oval_has_the_second_harmonic(self) -> None:
        found = misfit(section(0.0204, 0.0196, 180.0, 0.0))
        assert found is not None
        # An amplitude of 0.2 mm.
        assert found.shape == pytest.approx(0.0002 / np.sqrt(2.0), rel=0.05)

    def test_noise_is_what_chance_explains(self) -> None:
        ratios = []
        for seed in range(30):
            found = misfit(section(0.02, 0.02, 84.0, 0.0005, 4000, seed))
            assert found is not None
            assert found.noise == pytest.approx(0.0005, rel=0.1)
            ratios.append(found.shape / found.chance)
        assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.2)

    def test_too_few_points_say_nothing(self) -> None:
        assert misfit(section(0.02, 0.02, 180.0, 0.0, 400)) is None


class TestPooled:
    """Around the bent line, which is no plane curve; the side that is seen turns around it."""

    def cloud(self, line: Skeleton, half: float, seed: int = 0, count: int = 6000) -> tuple[Array, Array]:
        """Points (M, 3) of a tube of 20 mm and their coordinates; what is seen is above, wherever the line goes."""
        rng = np.random.default_rng(seed)
        s = rng.random(count)
        tangent = line(s, 1)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        up = np.array([0.1, 0.2, 1.0]) - (tangent @ [0.1, 0.2, 1.0])[:, None] * tangent
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        angle = np.radians(rng.uniform(-half, half, count))[:, None]
        return line(s) + 0.02 * (np.cos(angle) * up + np.sin(angle) * np.cross(tangent, up)), s

    @pytest.mark.parametrize("half", [40.0, 60.0, 85.0])
    def test_one_side_is_above(self, line: Skeleton, half: float) -> None:
        points, s = self.cloud(line, half)
        found = pooled_section(points, s, np.zeros(len(s)), line, 0.02)
        assert found is not None
        assert not found.whole
        assert np.degrees(found.half_angle) == pytest.approx(half, abs=6.0)
        assert np.hypot(found.side, found.up) == pytest.approx(0.02, rel=1e-3)
        inside = np.degrees(np.abs(np.arctan2(found.side, found.up)))
        assert np.quantile(inside, 0.99) < half + 8.0
        part = found.within(np.radians(30.0))
        assert len(part.index) == np.count_nonzero(inside <= 30.0)
        assert np.array_equal(points[part.index], points[found.index][inside <= 30.0])

    def test_what_was_seen_may_turn_around_the_line(self, line: Skeleton) -> None:
        """Three times around from end to end: directions must not be averaged over more than they share."""
        points, s = self.cloud(line, 180.0, count=20_000)
        offset = points - line(s)
        tangent = unit(line(s, 1))
        frames = minimal_rotation_frames(unit(line((np.arange(400) + 0.5) / 400, 1)))[(s * 400).astype(int)]
        y, z = (np.einsum("ij,ij->i", offset, frames[:, :, axis]) for axis in (1, 2))
        turned = np.angle(np.exp(1j * (np.arctan2(z, y) - 6.0 * np.pi * s)))
        own = np.abs(turned) < np.radians(70.0)
        assert np.abs(np.einsum("ij,ij->i", offset, tangent)).max() < 1e-6
        found = pooled_section(points[own], s[own], np.zeros(own.sum()), line, 0.02)
        assert found is not None
        assert np.degrees(found.half_angle) == pytest.approx(70.0, abs=8.0)

    def test_a_whole_tube(self, line: Skeleton) -> None:
        points, s = self.cloud(line, 180.0)
        found = pooled_section(points, s, np.zeros(len(s)), line, 0.02)
        assert found is not None
        assert found.whole
        assert found.half_angle == pytest.approx(np.pi)

    def test_points_off_the_tube_and_its_ends_are_left_out(self, line: Skeleton) -> None:
        points, s = self.cloud(line, 180.0)
        residual = np.where(np.arange(len(s)) % 2 == 0, 0.0, 0.013)
        found = pooled_section(points, s, residual, line, 0.02)
        assert found is not None
        assert np.array_equal(np.sort(found.index), np.flatnonzero((residual == 0.0) & (s > 0.02) & (s < 0.98)))
        assert pooled_section(points[:150], s[:150], residual[:150], line, 0.02) is None
