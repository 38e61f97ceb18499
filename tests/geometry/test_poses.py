"""Homogeneous transforms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from dlogen.geometry.poses import pose


def test_a_pose_takes_points_of_its_frame_to_those_outside() -> None:
    rotation = Rotation.from_euler("xyz", [0.1, -0.7, 2.0]).as_matrix()
    position = np.array([1.0, -2.0, 3.0])
    made = pose(rotation, position)
    point = np.array([0.3, 0.2, -0.5])
    assert made @ [*point, 1.0] == pytest.approx([*(rotation @ point + position), 1.0], abs=1e-15)
    assert made[3].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_a_row_of_poses_is_the_poses_in_a_row() -> None:
    rotations = Rotation.random(4, random_state=1).as_matrix()
    positions = np.arange(12.0).reshape(4, 3)
    made = pose(rotations, positions)
    assert made.shape == (4, 4, 4)
    for k in range(4):
        assert np.array_equal(made[k], pose(rotations[k], positions[k]))


def test_without_a_position_at_the_origin() -> None:
    assert np.array_equal(pose(np.eye(3)), np.eye(4))


def test_poses_follow_one_another_as_scipy_has_it() -> None:
    first, second = (
        (Rotation.random(random_state=k).as_matrix(), np.random.default_rng(k).normal(size=3)) for k in (1, 2)
    )
    expected = RigidTransform.from_matrix(pose(*first)) * RigidTransform.from_matrix(pose(*second))
    assert pose(*first) @ pose(*second) == pytest.approx(expected.as_matrix(), abs=1e-14)
