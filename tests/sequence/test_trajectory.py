"""The motion of the common model: poses, limits, keyframes and files."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from moving import LENGTH, recorded

from dlogen.config.schema import Config
from dlogen.config.sections import JointSettings
from dlogen.io.registry import model_format, model_formats
from dlogen.multibody.build import multibody
from dlogen.sequence.export import trajectory_csv, trajectory_npz
from dlogen.sequence.outliers import Observed
from dlogen.sequence.plot import motion_picture
from dlogen.sequence.shared_model import common_model
from dlogen.sequence.trajectory import Motion, motion_of
from dlogen.types import Result

Array = np.ndarray
CASES = [(dof, zero) for dof in (2, 3) for zero in ("straight", "scan")]


@cache
def moved(name: str = "hose", dof: int = 2, zero: str = "straight", times: bool = True) -> Motion:
    made = recorded(name, 3, 30)
    frames = list(made.observed)
    frames[7] = Observed("frame_07", None, problem="the file is empty")
    frames[29] = Observed("frame_29", None, problem="the file is empty")
    at = made.times if times else None
    return motion_of(common_model(frames, at), at, JointSettings(dof=dof, zero=zero))


@pytest.fixture(scope="module")
def result_for(make_result, straight):
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    def make(motion: Motion, **joints) -> Result:
        config = Config(joints=JointSettings(base="floating", **joints))
        return replace(template, chain=motion.chain, config=config, recorded=motion.poses(), name="hose")

    return make


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


def test_trajectory_files_say_the_same(result_for) -> None:
    motion = moved()
    names = multibody(result_for(motion)).hinge_names
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(motion, names).decode())))
    arrays = np.load(io.BytesIO(trajectory_npz(motion, names)), allow_pickle=False)
    assert [row["frame"] for row in rows] == arrays["frame"].tolist() == [f"frame_{k:02d}" for k in range(30)]
    assert [float(row["time"]) for row in rows] == arrays["time"].tolist() == motion.times.tolist()
    assert arrays["joint_names"].tolist() == list(names)
    for name, column in zip(names, arrays["joint_values"].T, strict=True):
        assert [float(row[name]) for row in rows] == column.tolist()
    for keys, array in ((("x", "y", "z"), "base_position"), (("qw", "qx", "qy", "qz"), "base_quaternion")):
        assert np.array([[float(row[key]) for key in keys] for row in rows]).tolist() == arrays[array].tolist()
    assert [row["state"] for row in rows] == arrays["state"].tolist()
    assert (
        [row["error"] == "" for row in rows] == np.isnan(arrays["error"]).tolist() == [k in (7, 29) for k in range(30)]
    )
    assert arrays["joint_positions"].shape == (30, len(motion.common.links) + 1, 3)
    assert trajectory_npz(motion, names) == trajectory_npz(motion, names)


def test_picture() -> None:
    pytest.importorskip("matplotlib")
    for motion in (moved(), moved("rod"), moved(times=False)):
        data = motion_picture(motion)
        assert data.startswith(b"\x89PNG") and len(data) > 20_000


def test_json_of_the_model_is_that_of_a_chain(result_for) -> None:
    (text,) = model_format("json").write(result_for(moved()), "hose").values()
    data = json.loads(text)
    assert data["schema"] == "dlogen.chain/1"
    assert data["length"] == pytest.approx(LENGTH, abs=0.003)
    assert data["model"]["base"] == "floating"
    assert data["model"]["base_transform"] == np.eye(4).tolist()
