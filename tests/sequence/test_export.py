"""The shared model in files: every format, and keyframes that a simulator replays."""

from __future__ import annotations

import json

import numpy as np
import pytest
from moving import LENGTH, moved

from dlogen.io.registry import model_format, model_formats

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
