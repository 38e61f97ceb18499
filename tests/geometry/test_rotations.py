"""Rotations against scipy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.geometry.rotations import bend_and_twist_angles, bend_angles, hinge, hinges, quaternion, roll_pitch_yaw

ANGLES = st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi, 1.5707963, 1e-9])
ROTATIONS = st.tuples(ANGLES, ANGLES, ANGLES).map(lambda angles: Rotation.from_euler("xyz", angles).as_matrix())


@given(st.sampled_from("xyz"), ANGLES)
def test_hinge(axis: str, angle: float) -> None:
    assert hinge(axis, angle) == pytest.approx(Rotation.from_euler(axis, angle).as_matrix(), abs=1e-15)


@given(ANGLES, ANGLES, ANGLES)
def test_hinges_turn_the_axes_of_the_next(a: float, b: float, c: float) -> None:
    found = hinges(("y", "z", "x"), np.array([a, b, c]))
    assert found == pytest.approx(Rotation.from_euler("YZX", [a, b, c]).as_matrix(), abs=1e-15)


@given(ROTATIONS)
def test_two_hinges_reach_every_direction(rotation: np.ndarray) -> None:
    a, b = bend_angles(rotation[:, 0])
    assert -math.pi / 2 <= b <= math.pi / 2
    assert hinges(("y", "z"), np.array([a, b]))[:, 0] == pytest.approx(rotation[:, 0], abs=1e-14)


@given(ROTATIONS)
def test_three_hinges_reach_every_rotation(rotation: np.ndarray) -> None:
    angles = np.array(bend_and_twist_angles(rotation))
    assert hinges(("y", "z", "x"), angles) == pytest.approx(rotation, abs=1e-14)


@given(ROTATIONS)
def test_roll_pitch_yaw_even_where_two_axes_fall_together(rotation: np.ndarray) -> None:
    angles = roll_pitch_yaw(rotation)
    assert Rotation.from_euler("xyz", angles).as_matrix() == pytest.approx(rotation, abs=1e-14)


@given(ROTATIONS)
def test_quaternion(rotation: np.ndarray) -> None:
    w, x, y, z = quaternion(rotation)
    assert w >= 0
    assert w * w + x * x + y * y + z * z == pytest.approx(1, abs=1e-15)
    assert Rotation.from_quat([x, y, z, w]).as_matrix() == pytest.approx(rotation, abs=1e-14)
