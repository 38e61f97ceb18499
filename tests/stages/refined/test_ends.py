"""Ends and gaps of points along a line."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.ends import find_ends, find_gaps


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("strays", [0, 30])
def test_ends_are_unbiased(noise, strays):
    rng = np.random.default_rng(5)
    off = []
    for _ in range(60):
        s = rng.uniform(0.2, 1.2, 1500) + noise * rng.normal(size=1500)
        s = np.append(s, rng.uniform(0.0, 1.4, strays // 10))
        deviation = np.concatenate([np.abs(rng.normal(size=1500)), rng.uniform(5.0, 15.0, strays // 4)])
        first, last = find_ends(s, deviation, noise)
        off += [(0.2 - first.position) / first.std, (last.position - 1.2) / last.std]
    # In units of the reported standard deviation. A stray point just beyond an end cannot be told from the object.
    assert abs(np.mean(np.clip(off, -3.0, 3.0))) < (0.6 if strays else 0.3)
    assert 0.5 < np.std(np.clip(off, -3.0, 3.0)) < (1.8 if strays else 1.4)


def test_gaps():
    rng = np.random.default_rng(6)
    s = rng.uniform(0.0, 1.0, 4000)
    assert find_gaps(s, 0.0, 1.0, 0.012) == ()
    s = s[((s < 0.3) | (s > 0.33)) & ((s < 0.34) | (s > 0.4))]
    assert np.allclose(find_gaps(s, 0.0, 1.0, 0.012), [(0.3, 0.33), (0.34, 0.4)], atol=2e-3)
    # The same holes are nothing unusual among few points, nor for a thick object.
    assert find_gaps(np.sort(s)[::60], 0.0, 1.0, 0.012) == ()
    assert find_gaps(s, 0.0, 1.0, 0.08) == ()


def test_without_noise_an_end_is_one_spacing_beyond_the_last_point() -> None:
    rng = np.random.default_rng(1)
    beyond = []
    for _ in range(100):
        s = rng.uniform(0.0, 1.0, 1000)
        first, last = find_ends(s, np.zeros(1000), 0.0)
        beyond += [1000 * (last.position - s.max()), 1000 * (s.min() - first.position)]
        assert 0.3e-3 < last.std < 3e-3
    assert np.mean(beyond) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_ends_move_with_the_points_and_swap_when_they_are_mirrored(noise: float) -> None:
    rng = np.random.default_rng(2)
    s = rng.uniform(0.3, 1.0, 2000) + noise * rng.normal(size=2000)
    deviation = np.abs(rng.normal(size=2000))
    first, last = find_ends(s, deviation, noise)
    moved = find_ends(s[rng.permutation(2000)] + 5.0, deviation, noise)
    assert [end.position - 5.0 for end in moved] == pytest.approx([first.position, last.position], abs=1e-6)
    scaled = find_ends(1e3 * s, deviation, 1e3 * noise)
    assert [end.std / 1e3 for end in scaled] == pytest.approx([first.std, last.std], rel=1e-4)
    mirrored = find_ends(-s, deviation, noise)
    assert [-end.position for end in mirrored] == pytest.approx([last.position, first.position], abs=1e-6)
    assert [end.std for end in mirrored] == pytest.approx([last.std, first.std], rel=1e-4)


def test_noise_is_not_taken_for_length() -> None:
    rng = np.random.default_rng(3)
    s = rng.uniform(0.0, 1.0, 5000) + 0.01 * rng.normal(size=5000)
    first, last = find_ends(s, np.abs(rng.normal(size=5000)), 0.01)
    assert s.max() > 1.01
    assert abs(last.position - 1.0) < 4e-3
    assert abs(first.position) < 4e-3


def test_a_handful_of_points_is_as_uncertain_as_they_are_long() -> None:
    s = np.array([0.2, 0.5, 0.3, 0.7])
    first, last = find_ends(s, np.zeros(4), 0.0)
    assert (first.position, last.position) == (0.2, 0.7)
    assert first.std == last.std == pytest.approx(0.5)


def test_gaps_are_shares_of_the_length_between_the_ends() -> None:
    s = np.arange(0.0, 1.0, 0.001)
    s = s[(s < 0.5) | (s > 0.6)]
    assert np.allclose(find_gaps(s, 0.0, 1.0, 0.02), [(0.499, 0.601)], atol=2e-3)
    # From 2 to 6 metres, in any order.
    shuffled = np.random.default_rng(0).permutation(2.0 + 4.0 * s)
    assert np.allclose(find_gaps(shuffled, 2.0, 6.0, 0.08), [(0.499, 0.601)], atol=2e-3)
    # Beyond an end there are no gaps.
    assert find_gaps(s, 0.0, 0.45, 0.02) == ()
    assert find_gaps(s, 0.0, 1.0, 0.11) == ()
    assert find_gaps(s[:29], 0.0, 1.0, 0.0001) == ()
