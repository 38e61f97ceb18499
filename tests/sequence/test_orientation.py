"""Directions and wrong captures, on motions that nothing was tuned on."""

from __future__ import annotations

import numpy as np
import pytest
from moving import LENGTH, MOTIONS, RADIUS, recorded

from dlogen.evaluation.shapes import random_centre_line
from dlogen.sequence.orientation import directions, misfits, unclear_directions

Array = np.ndarray
PLACES = np.linspace(0.0, 1.0, 16)


def curves_of(name: str, seed: int = 0, captures: int = 60) -> tuple[Array, Array]:
    """(F, 16, 3) material points with the errors of single fits, and times."""
    made = recorded(name, seed, captures, flips=False)
    rows = np.round(PLACES * 999).astype(int)
    return np.array([item.points[rows] for item in made.captures]), made.times


def flipped(curves: Array, seed: int) -> tuple[Array, Array]:
    flip = np.random.default_rng(seed).random(len(curves)) < 0.5
    out = curves.copy()
    out[flip] = out[flip][:, ::-1]
    return out, flip


def wrong_ways(reverse: Array, flip: Array, where: Array) -> int:
    """Captures that run the other way than most."""
    other = int((reverse != flip)[where].sum())
    return min(other, int(where.sum()) - other)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("seed", [11, 12])
def test_no_direction_is_lost_and_no_capture_is_wrong(name: str, seed: int) -> None:
    curves, times = curves_of(name, seed)
    seen, flip = flipped(curves, seed)
    reverse, kept = directions(seen, times, RADIUS)
    assert kept.all() and wrong_ways(reverse, flip, kept) == 0
    assert not reverse[0]
    off, allowed = misfits(curves, times, kept, RADIUS)
    assert np.all(off < allowed)


@pytest.mark.parametrize("name", MOTIONS)
def test_fast_motion_is_not_wrong(name: str) -> None:
    """Up to a fifth of the object's length from one capture to the next."""
    curves, times = curves_of(name, 4, captures=25)
    seen, flip = flipped(curves, 5)
    reverse, kept = directions(seen, times, RADIUS)
    assert kept.all() and wrong_ways(reverse, flip, kept) == 0
    off, allowed = misfits(curves, times, kept, RADIUS)
    assert np.all(off < allowed)


def spoilt(curves: Array, which: list[int], seed: int) -> Array:
    """Another object in the same place, or the right one elsewhere."""
    rng = np.random.default_rng(seed)
    out = curves.copy()
    for n, k in enumerate(which):
        if n % 2:
            shift = rng.normal(size=3)
            out[k] += 0.3 * shift / np.linalg.norm(shift)
        else:
            out[k] = random_centre_line(rng, LENGTH, 0.1)(PLACES) + curves[k].mean(axis=0)
    return out


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("which", [[0, 1], [58, 59], [0, 13, 29, 30, 31, 44], [20, 22, 24, 26, 28]], ids=str)
def test_wrong_captures_are_found_and_mislead_nobody(name: str, which: list[int]) -> None:
    curves, times = curves_of(name, 21)
    seen, flip = flipped(spoilt(curves, which, 3), 8)
    reverse, kept = directions(seen, times, RADIUS)
    right = ~np.isin(np.arange(60), which)
    assert wrong_ways(reverse, flip, right) == 0
    seen[reverse] = seen[reverse][:, ::-1]
    off, allowed = misfits(seen, times, kept, RADIUS)
    assert sorted(np.flatnonzero(off > allowed)) == which


def test_a_gap_in_time_is_crossed() -> None:
    curves, times = curves_of("hose", 3)
    there = np.r_[0:20, 32:60]
    seen, flip = flipped(curves[there], 1)
    reverse, kept = directions(seen, times[there], RADIUS)
    assert kept.all() and wrong_ways(reverse, flip[:], kept) == 0


def test_strands_that_change_places() -> None:
    """Folded in half and moved by the distance of the strands a capture: the nearest curve is the reversed one."""
    bow = np.linspace(0.0, np.pi, 16)
    strands = np.stack([np.sin(bow), 0.05 * np.cos(bow), 0 * bow], axis=1)
    curves = strands + np.arange(12)[:, None, None] * [0.0, 0.1, 0.0]
    seen, flip = flipped(curves, 2)
    reverse, kept = directions(seen, np.arange(12.0), 0.01)
    assert kept.all() and wrong_ways(reverse, flip, kept) == 0


def test_two_captures_and_one() -> None:
    curves, _ = curves_of("hose")
    pair = np.stack([curves[0], curves[1][::-1]])
    reverse, kept = directions(pair, np.array([0.0, 1.0]), RADIUS)
    assert reverse.tolist() == [False, True] and kept.all()
    reverse, kept = directions(curves[:1], np.zeros(1), RADIUS)
    assert reverse.tolist() == [False] and kept.tolist() == [True]


def test_of_few_captures_none_is_wrong() -> None:
    curves, times = curves_of("hose", captures=4)
    off, allowed = misfits(curves, times, np.ones(4, dtype=bool), RADIUS)
    assert np.all(off <= allowed)


def test_where_and_how_it_lies_does_not_matter() -> None:
    curves, times = curves_of("hose", 7)
    seen, _ = flipped(spoilt(curves, [12, 40], 5), 6)
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    for moved in (seen @ turn.T + [100.0, -50.0, 3.0], seen[::-1]):
        reverse, kept = directions(moved, times, RADIUS)
        again, still = directions(seen, times, RADIUS)
        if moved.shape == seen.shape and np.array_equal(moved[0], seen[-1]):
            again, still = again[::-1], still[::-1]
        assert np.array_equal(kept, still)
        assert wrong_ways(reverse, again, kept) == 0


@pytest.mark.parametrize("name", MOTIONS)
def test_directions_are_clear_in_a_whole_recording(name: str) -> None:
    curves, times = curves_of(name, 3)
    assert unclear_directions(curves, times).tolist() == []
    # One end and the other are told apart by the middle of the recording alone.
    curves[30:] = curves[30:, ::-1]
    assert 30 in unclear_directions(curves, times)


def test_what_moves_too_far_is_not_clear() -> None:
    """A rod that turns by about half a turn from one capture to the next."""
    for turn, unclear in ((0.2, []), (0.45, [1, 2, 3])):
        angle = np.pi * turn * np.arange(4)
        axis = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        curves = (PLACES - 0.5)[None, :, None] * axis[:, None]
        assert unclear_directions(curves, np.arange(4.0)).tolist() == unclear, turn


@pytest.mark.parametrize("times", [[0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.2, 2.0, 2.3, 4.0], [0.0, 1.9, 2.1, 3.9, 4.0]])
def test_steady_motion_is_clear_however_uneven_the_times(times: list[float]) -> None:
    """A rod that goes on at one speed, whatever the way: its velocity tells which end is first."""
    rod = np.stack([PLACES, 0 * PLACES, 0 * PLACES], axis=1)
    for way, speed in (([1.0, 0.0, 0.0], 0.3), ([0.0, 1.0, 0.0], 0.1), ([0.0, 0.0, -1.0], 0.3)):
        curves = rod + np.array(times)[:, None, None] * speed * np.array(way)
        assert unclear_directions(curves, np.array(times)).tolist() == []
        # One capture alone the other way round is not clear at either of its sides.
        curves[2] = curves[2, ::-1]
        assert {2, 3} <= set(unclear_directions(curves, np.array(times)).tolist())


def test_directions_of_few_captures() -> None:
    curves = np.stack([PLACES, 0 * PLACES, 0 * PLACES], axis=1)[None] + np.zeros((2, 1, 1))
    assert unclear_directions(curves[:1], np.zeros(1)).tolist() == []
    assert unclear_directions(curves, np.arange(2.0)).tolist() == []
    crossed = np.stack([curves[0], np.stack([0.5 + 0 * PLACES, PLACES - 0.5, 0 * PLACES], axis=1)])
    assert unclear_directions(crossed, np.arange(2.0)).tolist() == [1]
