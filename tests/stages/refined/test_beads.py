"""Few points in the order that they have on their string."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.stages.refined.beads import string_beads

Array = np.ndarray


def spiral(count: int) -> Array:
    """Beads about 0.1 apart on a helix whose turns are 0.3 apart."""
    t = np.linspace(0.0, 0.1 * (count - 1), count)
    return np.stack([0.2 * np.cos(5.0 * t), 0.2 * np.sin(5.0 * t), 0.24 * t], axis=1)


def same_string(found: Array, expected: Array) -> bool:
    return np.array_equal(found, expected) or np.array_equal(found, expected[::-1])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(4, 40))
def test_any_order_comes_to_the_right_one(seed: int, count: int) -> None:
    beads = spiral(count)
    assert same_string(string_beads(beads[np.random.default_rng(seed).permutation(count)]), beads)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_place_and_direction_do_not_matter(scale: float) -> None:
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    beads = scale * spiral(25) @ turn.T + rng.normal(size=3)
    assert same_string(string_beads(beads[rng.permutation(25)]), beads)


def test_a_ring_is_opened() -> None:
    angle = 2.0 * np.pi * np.arange(12) / 12
    ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    # The widest step is the one that stays open.
    ring[0] = [np.cos(0.05), np.sin(0.05), 0.0]
    assert same_string(string_beads(ring[np.random.default_rng(0).permutation(12)]), ring)


def test_strays_beyond_the_ends_are_left_out() -> None:
    beads = np.arange(10.0)[:, None] * [0.1, 0.0, 0.0]
    strays = np.array([[-0.5, 0.0, 0.0], [1.5, 0.1, 0.0], [2.5, 0.1, 0.0]])
    found = string_beads(np.concatenate([strays, beads[::-1]]))
    assert same_string(found, beads)
    # A step of less than three usual ones is none.
    near = np.concatenate([beads, [[1.15, 0.0, 0.0]]])
    assert same_string(string_beads(near[::-1]), near)


def test_four_beads_are_never_fewer() -> None:
    beads = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [100.0, 0, 0]])
    assert same_string(string_beads(beads[[2, 0, 3, 1]]), beads)


@pytest.mark.parametrize("seed", range(4))
def test_a_bead_has_two_neighbours_even_if_a_third_is_near(seed: int) -> None:
    # A hairpin: the beads of the upper strand are 1.22 away from those of the lower one, the turn is 1.44.
    lower, upper = [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1.2, 1.2, 0], [0.2, 1.2, 0], [-0.8, 1.2, 0], [-1.8, 1.2, 0]]
    beads = np.array([*lower, *upper])
    assert same_string(string_beads(beads[np.random.default_rng(seed).permutation(7)]), beads)
