"""The shared model in files: every format, and keyframes that a simulator replays."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving import LENGTH, moved

from dlogen.batch.store import Row
from dlogen.config.reader import load_config
from dlogen.config.sections import JointSettings, Segmentation
from dlogen.io.registry import model_format, model_formats
from dlogen.sequence.captures import read_capture
from dlogen.sequence.export import contents, result_of
from dlogen.sequence.shared_model import shared_model
from dlogen.sequence.trajectory import motion_of

CASES = [(dof, zero) for dof in (2, 3) for zero in ("straight", "scan")]


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
        assert np.vstack([data.xpos[1:], tip]) == pytest.approx(motion.model.joints[k], abs=1e-6)
    for name in ("scanned", "straight"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_kinematics(model, data)
        assert data.xpos[1] == pytest.approx(motion.chain.joints[0])
        if name == "scanned":
            assert data.xpos[1:] == pytest.approx(motion.chain.joints[:-1], abs=1e-6)


@pytest.mark.parametrize("name", [item.name for item in model_formats()])
def test_every_format_writes_it(result_for, name: str) -> None:
    assert all(model_format(name).write(result_for(moved()), "hose").values())


def test_json_of_the_model_is_that_of_a_chain(result_for) -> None:
    (text,) = model_format("json").write(result_for(moved()), "hose").values()
    data = json.loads(text)
    assert data["schema"] == "dlogen.chain/1"
    assert data["length"] == pytest.approx(LENGTH, abs=0.003)
    assert data["model"]["base"] == "floating"
    assert data["model"]["base_transform"] == np.eye(4).tolist()


@pytest.mark.parametrize("reversed_first", [False, True])
def test_the_result_has_the_line_of_the_reference_in_the_direction_of_the_model(
    fitted: Path, reversed_first: bool
) -> None:
    """The other capture decides on the direction, and is bent more at its joints: it is not the reference."""
    rows = {"sub/b": Row("sub/b", "b.ply", "done")}
    own = replace(read_capture(rows, "sub/b", fitted), problem=None)
    wave = 0.03 * np.sin(np.linspace(0.0, 6.0 * np.pi, len(own.points)))[:, None] * [0.6, 0.0, 0.8]
    other = replace(own, name="a", points=(own.points + wave)[:: -1 if reversed_first else 1])
    model = shared_model([other, own], segmentation=Segmentation(segments=12))
    assert model.reference == 1 and model.reverse.tolist() == [False, reversed_first]
    motion = motion_of(model, None, JointSettings())
    config = load_config(None, ["profile=paper", "mdtw.samples=50", "joints.base=floating"])
    result = result_of(motion, fitted, "sub/b", config, "model")

    expected = own.points[::-1] if reversed_first else own.points
    assert np.array_equal(result.skeleton_points, expected)
    # The points are even in arc length, not in s: they are the same curve, run through in the same order.
    curve = result.skeleton(np.linspace(0.0, 1.0, 200))
    assert curve[[0, -1]] == pytest.approx(expected[[0, -1]], abs=1e-9)
    apart = np.linalg.norm(curve[:, None] - expected, axis=2)
    assert apart.min(axis=1).max() < 0.001
    assert np.all(np.diff(apart.argmin(axis=1)) > 0)
    assert np.linalg.norm(result.chain.joints[[0, -1]] - expected[[0, -1]], axis=1).max() < 0.05
    assert (result.name, result.max_deviation, result.e_max) == ("model", model.deviation[1], model.e_max)
    assert [pose.name for pose in result.recorded] == ["a", "sub/b"]
    names = ("poses.csv", "poses.npz", "one_model.json")
    made = contents(motion, result, {"schema": "x"}, ["urdf", "json"], names)
    assert set(made) == {"model.urdf", "model.json", *names}
    assert json.loads(made["one_model.json"]) == {"schema": "x"}
