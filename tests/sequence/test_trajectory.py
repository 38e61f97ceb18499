"""The motion of the common model: poses, limits, keyframes and files."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from moving import LENGTH, recorded
from recorded_motion import moved

from dlogen.config.sections import JointSettings
from dlogen.io.registry import model_format, model_formats
from dlogen.multibody.build import multibody
from dlogen.sequence.export import trajectory_csv
from dlogen.sequence.shared_model import common_model
from dlogen.sequence.trajectory import motion_of

Array = np.ndarray
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
        assert there == pytest.approx(motion.common.joints[k], abs=1e-9)
        for joint, values in zip(model.joints, motion.values[k], strict=True):
            assert np.all(joint.lower <= values) and np.all(values <= joint.upper)
    assert [pose.name for pose in model.poses] == [*(f"frame_{k:02d}" for k in range(30)), "scanned", "straight"]
    assert model.poses[12].values is not motion.values and np.array_equal(model.poses[12].values, motion.values[12])
    if zero == "scan":
        assert motion.values[motion.common.reference] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("dof", "zero"), CASES)
def test_keyframes_replay_in_mujoco(result_for, dof: int, zero: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    motion = moved("loop", dof, zero)
    (text,) = model_format("mjcf").write(result_for(motion, dof=dof, zero=zero), "hose").values()
    model = mujoco.MjModel.from_xml_string(text.decode())
    data = mujoco.MjData(model)
    for k in range(30):
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_kinematics(model, data)
        assert model.key(k).name == f"frame_{k:02d}"
        assert data.time == motion.times[k]
        tip = data.site("tip").xpos
        assert np.vstack([data.xpos[1:], tip]) == pytest.approx(motion.common.joints[k], abs=1e-6)
    for name in ("scanned", "straight"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_kinematics(model, data)
        assert data.xpos[1] == pytest.approx(motion.chain.joints[0])
        if name == "scanned":
            assert data.xpos[1:] == pytest.approx(motion.chain.joints[:-1], abs=1e-6)


@pytest.mark.parametrize("name", [item.name for item in model_formats()])
def test_every_format_writes_it(result_for, name: str) -> None:
    assert all(model_format(name).write(result_for(moved()), "hose").values())


def test_names_of_frames_that_the_model_has_for_itself() -> None:
    frames = [
        replace(item, name=name)
        for item, name in zip(recorded("rod", 0, 3).observed, ("scanned", "straight", "x"), strict=True)
    ]
    motion = motion_of(common_model(frames, np.arange(3.0)), np.arange(3.0), JointSettings())
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
    assert np.isfinite(motion.values[motion.common.reference]).all()
    names = [f"j{i}" for i in range(motion.values[0].size)]
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(motion, names).decode())))
    assert rows[7]["time"] == rows[7]["x"] == "" and rows[7]["reason"] == "failed"


def test_json_of_the_model_is_that_of_a_chain(result_for) -> None:
    (text,) = model_format("json").write(result_for(moved()), "hose").values()
    data = json.loads(text)
    assert data["schema"] == "dlogen.chain/1"
    assert data["length"] == pytest.approx(LENGTH, abs=0.003)
    assert data["model"]["base"] == "floating"
    assert data["model"]["base_transform"] == np.eye(4).tolist()
