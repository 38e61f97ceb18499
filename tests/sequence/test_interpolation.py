"""What fills the holes of a recording, and what takes its noise away."""

from __future__ import annotations

import numpy as np
import pytest
from moving import fitted_chains

from dlogen.sequence.interpolation import filled_in, smoothed


class TestFilledIn:
    @pytest.mark.parametrize(("gap", "most"), [(1, 0.003), (3, 0.01)])
    def test_near_the_truth(self, gap: int, most: float) -> None:
        joints, links, times = fitted_chains("hose", 6)
        true, _, _ = fitted_chains("hose", 6, noise=0.0, end_noise=0.0)
        good = np.ones(60, dtype=bool)
        for k in range(8, 50, gap + 4):
            good[k : k + gap] = False
        hidden = joints.copy()
        hidden[~good] = np.nan
        filled = filled_in(hidden, links, times, good)
        assert np.linalg.norm(filled - true, axis=2)[~good].max() < most
        assert np.array_equal(filled[good], joints[good])
        assert np.linalg.norm(np.diff(filled, axis=1), axis=2) == pytest.approx(np.tile(links, (60, 1)), abs=1e-12)

    def test_uneven_times(self) -> None:
        joints, links, times = fitted_chains("hose", 6, captures=80, noise=0.0, end_noise=0.0)
        there = np.sort(np.random.default_rng(0).choice(80, 60, replace=False))
        good = np.ones(60, dtype=bool)
        good[[15, 30, 31, 47]] = False
        filled = filled_in(joints[there], links, times[there], good)
        assert np.linalg.norm(filled - joints[there], axis=2).max() < 0.003

    def test_rests_at_the_ends(self) -> None:
        joints, links, times = fitted_chains("rod")
        good = (np.arange(60) >= 3) & (np.arange(60) < 57)
        filled = filled_in(joints, links, times, good)
        assert np.all(filled[:3] == joints[3]) and np.all(filled[57:] == joints[56])

    def test_the_straight_way_across_a_long_gap(self) -> None:
        """A swing to and fro that nobody saw is not made up."""
        joints, links, times = fitted_chains("rod", noise=0.0, end_noise=0.0)
        good = (np.arange(60) < 20) | (np.arange(60) >= 40)
        filled = filled_in(joints, links, times, good)
        middle = filled[20:40].mean(axis=1)
        straight = 0.5 * (joints[19].mean(axis=0) + joints[40].mean(axis=0))
        assert np.linalg.norm(middle - straight, axis=1).max() < 0.01


class TestSmoothed:
    def test_less_noise(self) -> None:
        true, links, times = fitted_chains("loop", noise=0.0, end_noise=0.0)
        joints, _, _ = fitted_chains("loop")
        even = smoothed(joints, links, times, 0.006)
        before, after = (np.linalg.norm(made - true, axis=2)[2:-2].mean() for made in (joints, even))
        assert after < 0.8 * before
        assert np.linalg.norm(np.diff(even, axis=1), axis=2) == pytest.approx(np.tile(links, (60, 1)), abs=1e-12)
        assert np.array_equal(even[[0, 1, -2, -1]], joints[[0, 1, -2, -1]])

    def test_what_moves_fast_stays(self) -> None:
        joints, links, times = fitted_chains("whip", captures=12, noise=0.0, end_noise=0.0)
        even = smoothed(joints, links, times, 0.003)
        assert np.linalg.norm(even - joints, axis=2).max() <= 0.003
        changed = (even != joints).any(axis=(1, 2))
        assert not changed.all()

    def test_too_few(self) -> None:
        joints, links, times = fitted_chains("rod", captures=4)
        assert smoothed(joints, links, times, 1.0) is joints
