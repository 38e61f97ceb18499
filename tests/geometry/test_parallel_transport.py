"""Frames without twist: rotations, their x axes, and the angle that they turn by."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.rotations import smallest_rotations
from dlogen.geometry.vectors import unit

Array = np.ndarray


def walk(seed: int, count: int, step: float) -> Array:
    """Unit tangents that wander by about a step."""
    steps = step * np.random.default_rng(seed).normal(size=(count, 3))
    return unit(np.array([1.0, 0.5, 0.2]) + np.cumsum(steps, axis=0))


walks = st.builds(walk, st.integers(0, 10_000), st.integers(1, 60), st.floats(1e-6, 1.0))


@given(walks)
def test_frames_are_rotations_with_the_tangents_as_x_axes(tangents: Array) -> None:
    frames = minimal_rotation_frames(tangents)
    assert np.array_equal(frames[:, :, 0], tangents)
    assert frames @ np.swapaxes(frames, 1, 2) == pytest.approx(np.tile(np.eye(3), (len(frames), 1, 1)), abs=1e-12)
    assert np.linalg.det(frames) == pytest.approx(1.0, abs=1e-12)


@given(walks)
def test_frames_turn_by_the_smallest_rotation_and_no_more(tangents: Array) -> None:
    frames = minimal_rotation_frames(tangents)
    turns = smallest_rotations(tangents[:-1], tangents[1:])
    near = (tangents[:-1] * tangents[1:]).sum(axis=1) > -0.9
    assert (turns @ frames[:-1])[near] == pytest.approx(frames[1:][near], abs=1e-9)


@given(walks, st.integers(0, 10_000))
def test_only_the_first_frame_depends_on_how_the_world_is_turned(tangents: Array, seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    assume((tangents[:-1] * tangents[1:]).sum(axis=1).min(initial=1.0) > -0.9)
    frames, moved = minimal_rotation_frames(tangents), minimal_rotation_frames(unit(tangents @ turn.T))
    # One and the same angle about the tangent between the two, from the first to the last.
    between = np.swapaxes(turn @ frames, 1, 2) @ moved
    assert between == pytest.approx(np.tile(between[0], (len(frames), 1, 1)), abs=1e-8)


def test_the_first_frame_is_upright() -> None:
    frame = minimal_rotation_frames(unit(np.array([[1.0, 2.0, 0.5]])))[0]
    assert frame[2, 1] == pytest.approx(0.0, abs=1e-15)
    assert frame[2, 2] > 0.0
    # A vertical one has no upright: its z axis goes towards the world's x axis.
    vertical = minimal_rotation_frames(np.array([[0.0, 0.0, 1.0]]))[0]
    assert vertical.T.tolist() == [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]


def test_a_plane_curve_keeps_its_normal_through_an_inflection() -> None:
    angle = np.sin(np.linspace(0.0, 3.0 * math.pi, 200))
    tangents = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    assert minimal_rotation_frames(tangents)[:, :, 2] == pytest.approx(np.tile([0.0, 0.0, 1.0], (200, 1)), abs=1e-12)


def test_a_closed_way_turns_by_the_angle_that_it_encloses() -> None:
    # Along a circle of latitude on the sphere of tangents: the holonomy is the area of the cap (Gauss and Bonnet).
    height, count = 0.3, 20_001
    angle = np.linspace(0.0, 2.0 * math.pi, count)
    radius = math.sqrt(1.0 - height**2)
    tangents = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)], axis=1)
    frames = minimal_rotation_frames(tangents)
    turned = frames[0].T @ frames[-1]
    found = math.atan2(turned[2, 1], turned[1, 1]) % (2.0 * math.pi)
    assert found == pytest.approx(2.0 * math.pi * (1.0 - height), abs=1e-6)


def test_straight_on_keeps_the_frame_to_the_last_bit() -> None:
    tangents = np.tile(unit(np.array([0.3, -0.2, 0.9])), (1000, 1))
    frames = minimal_rotation_frames(tangents)
    assert (frames == frames[0]).all()


def test_a_turn_right_back_is_still_a_frame() -> None:
    frames = minimal_rotation_frames(np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    assert np.linalg.det(frames) == pytest.approx(1.0)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 100))
def test_rounding_does_not_add_up(seed: int) -> None:
    frames = minimal_rotation_frames(walk(seed, 20_000, 0.05))
    off = frames[-1] @ frames[-1].T - np.eye(3)
    assert np.abs(off).max() < 1e-12
