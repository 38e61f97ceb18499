"""Rotations against scipy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.geometry.rotations import (
    bend_and_twist_angles,
    bend_angles,
    from_quaternion,
    from_roll_pitch_yaw,
    hinge,
    hinges,
    quaternion,
    roll_pitch_yaw,
    smallest_rotations,
)

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


#: Quaternions w x y z: any, and those of rotations by nearly half a turn, where w is nearly zero of either sign.
QUATERNIONS = st.builds(
    lambda w, axis: np.array([w, *axis]),
    st.floats(-1.0, 1.0) | st.sampled_from([0.0, -0.0, 1e-9, -1e-9, 1e-17, 1.0]),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3),
).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(QUATERNIONS)
def test_quaternions_there_and_back(q: np.ndarray) -> None:
    expected = q / np.linalg.norm(q)
    found = np.array(quaternion(from_quaternion(q)))
    # Both signs are the same rotation; near half a turn rounding decides which one comes out.
    assert min(np.abs(found - expected).max(), np.abs(found + expected).max()) < 1e-14
    assert found[0] >= 0.0
    if expected[0] > 1e-12:
        assert found == pytest.approx(expected, abs=1e-14)


@given(QUATERNIONS)
def test_from_quaternion_is_that_of_scipy_whatever_the_length(q: np.ndarray) -> None:
    expected = Rotation.from_quat(q, scalar_first=True).as_matrix()
    for factor in (1.0, -1.0, 1e-3, 1e4):
        assert from_quaternion(factor * q) == pytest.approx(expected, abs=1e-14)


@given(QUATERNIONS, QUATERNIONS, QUATERNIONS)
def test_rotations_are_a_group(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> None:
    a, b, c = map(from_quaternion, (p, q, r))
    for rotation in (a, a @ b):
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)
        # The inverse: the conjugate quaternion.
        w, *vector = quaternion(rotation)
        assert from_quaternion(np.array([w, *np.negative(vector)])) @ rotation == pytest.approx(np.eye(3), abs=1e-14)
    assert (a @ b) @ c == pytest.approx(a @ (b @ c), abs=1e-14)
    # Matrices multiply as quaternions do.
    product = Rotation.from_quat(p, scalar_first=True) * Rotation.from_quat(q, scalar_first=True)
    assert a @ b == pytest.approx(product.as_matrix(), abs=1e-14)
    one = from_quaternion(np.array([1.0, 0.0, 0.0, 0.0]))
    assert np.array_equal(one, np.eye(3))
    assert np.array_equal(one, hinges((), np.zeros(0)))


@given(st.sampled_from("xyz"), ANGLES, ANGLES)
def test_hinges_about_one_axis_add_up(axis: str, a: float, b: float) -> None:
    assert hinge(axis, a) @ hinge(axis, b) == pytest.approx(hinge(axis, a + b), abs=1e-14)
    assert hinge(axis, a) @ hinge(axis, -a) == pytest.approx(np.eye(3), abs=1e-15)


@given(ROTATIONS)
def test_a_matrix_that_is_rounded_has_nearly_the_same_quaternion(rotation: np.ndarray) -> None:
    """As sensor poses in single precision have it."""
    w, x, y, z = quaternion(rotation.astype(np.float32).astype(float))
    assert w * w + x * x + y * y + z * z == pytest.approx(1, abs=1e-15)
    assert Rotation.from_quat([x, y, z, w]).as_matrix() == pytest.approx(rotation, abs=5e-7)


@given(ANGLES, ANGLES, ANGLES)
def test_roll_pitch_and_yaw_are_angles_about_fixed_axes(roll: float, pitch: float, yaw: float) -> None:
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    assert from_roll_pitch_yaw(roll, pitch, yaw) == pytest.approx(expected, abs=1e-15)
    assert from_roll_pitch_yaw(roll, pitch, yaw) == pytest.approx(
        hinges(("z", "y", "x"), np.array([yaw, pitch, roll])), abs=1e-15
    )


@given(ANGLES, st.sampled_from([-1.0, 1.0]), st.floats(0.0, 1e-3) | st.just(0.0), ANGLES)
def test_roll_pitch_yaw_there_and_back_at_gimbal_lock(roll: float, side: float, off: float, yaw: float) -> None:
    rotation = from_roll_pitch_yaw(roll, side * (math.pi / 2 - off), yaw)
    # The angles themselves are not determined there; the rotation is.
    assert from_roll_pitch_yaw(*roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-14)


class TestSmallestRotations:
    @staticmethod
    def unit(vectors: np.ndarray) -> np.ndarray:
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

    @given(st.integers(0, 10_000))
    def test_about_the_common_normal(self, seed: int) -> None:
        a, b = self.unit(np.random.default_rng(seed).normal(size=(2, 5, 3)))
        turns = smallest_rotations(a, b)
        assert np.einsum("kij,kj->ki", turns, a) == pytest.approx(b, abs=1e-9)
        assert turns @ np.swapaxes(turns, 1, 2) == pytest.approx(np.tile(np.eye(3), (5, 1, 1)), abs=1e-8)
        # The trace of a rotation by an angle is 1 + 2 cos: no more than between the two.
        assert np.trace(turns, axis1=1, axis2=2) == pytest.approx(1 + 2 * (a * b).sum(axis=1), abs=1e-8)
        assert np.einsum("kij,kj->ki", turns, np.cross(a, b)) == pytest.approx(np.cross(a, b), abs=1e-8)

    def test_of_the_same_vectors_none(self) -> None:
        a = self.unit(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 1.0]]))
        assert smallest_rotations(a, a) == pytest.approx(np.tile(np.eye(3), (2, 1, 1)), abs=1e-15)

    def test_opposite(self) -> None:
        a = self.unit(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
        b = -a
        b[2] = [0.0, 1.0, 0.0]
        turns = smallest_rotations(a, b)
        assert np.einsum("kij,kj->ki", turns, a) == pytest.approx(b, abs=1e-15)
        assert np.linalg.det(turns) == pytest.approx([1.0, 1.0, 1.0])
