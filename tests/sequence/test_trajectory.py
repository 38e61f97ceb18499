"""The motion of the shared model: poses, limits and states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from moving import moved, recorded

from dlogen.config.sections import JointSettings
from dlogen.multibody.build import multibody
from dlogen.sequence.shared_model import shared_model
from dlogen.sequence.trajectory import motion_of

CASES = [(dof, zero) for dof in (2, 3) for zero in ("straight", "scan")]


@pytest.mark.parametrize(("dof", "zero"), CASES)
@pytest.mark.parametrize("name", ["hose", "helix", "hairpin"])
def test_the_model_takes_every_pose(result_for, name: str, dof: int, zero: str) -> None:
    motion = moved(name, dof, zero)
    model = multibody(result_for(motion, dof=dof, zero=zero))
    assert model.floating
    for k in range(30):
        own = model.joint_positions(motion.values[k])
        there = own @ motion.base_rotations[k].T + motion.base_positions[k]
        assert there == pytest.approx(motion.model.joints[k], abs=1e-9)
        for joint, values in zip(model.joints, motion.values[k], strict=True):
            assert np.all(joint.lower <= values) and np.all(values <= joint.upper)
    assert [pose.name for pose in model.poses] == [*(f"frame_{k:02d}" for k in range(30)), "scanned", "straight"]
    assert model.poses[12].values is not motion.values and np.array_equal(model.poses[12].values, motion.values[12])
    if zero == "scan":
        assert motion.values[motion.model.reference] == pytest.approx(0.0, abs=1e-9)


def test_names_of_captures_that_the_model_has_for_itself() -> None:
    captures = [
        replace(item, name=name)
        for item, name in zip(recorded("rod", 0, 3).captures, ("scanned", "straight", "x"), strict=True)
    ]
    motion = motion_of(shared_model(captures, np.arange(3.0)), np.arange(3.0), JointSettings())
    assert [pose.name for pose in motion.poses()] == ["scanned_", "straight_", "x"]


def test_states() -> None:
    motion = moved()
    assert motion.states == tuple({7: "interpolated", 29: "held"}.get(k, "good") for k in range(30))
    assert np.array_equal(motion.base_positions[29], motion.base_positions[28])
    assert np.array_equal(motion.values[29], motion.values[28])


def test_quaternions_do_not_jump() -> None:
    """The whole turn of the rod takes w through zero."""
    q = moved("rod").quaternions
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0)
    assert (q[1:] * q[:-1]).sum(axis=1).min() > 0.9
    assert q[:, 0].min() < -0.5 or q[:, 0].max() - q[:, 0].min() > 0.9


def test_without_time() -> None:
    motion = moved(times=False)
    assert set(motion.states) == {"good", "none"} and motion.states[7] == "none"
    assert np.isnan(motion.base_positions[7]).all() and np.isnan(motion.values[7]).all()
    poses = motion.poses()
    assert len(poses) == 28 and all(pose.time is None for pose in poses)
    assert np.isfinite(motion.values[motion.model.reference]).all()
