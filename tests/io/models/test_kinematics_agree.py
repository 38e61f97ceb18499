"""Every format has its joints where the chain has them: forward kinematics by the simulators that read it."""

from __future__ import annotations

import io
import json
import logging
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from configured import configured
from scipy.spatial.transform import Rotation

from dlogen.geometry.rotations import hinges
from dlogen.io.registry import model_format
from dlogen.stages.chain import build_chain
from dlogen.types import FitData, Joints

Array = np.ndarray
#: Joint values by pose -> (n + 1, 3) joints; made from the files of one model.
Kinematics = Callable[[str], Array]

CASES = list(product((1, 2, 3, 10, 200), (2, 3), ("scan", "straight"), ("fixed", "floating")))
IDS = [f"{n}-dof{dof}-{zero}-{base}" for n, dof, zero, base in CASES]


def chain_points(count: int, seed: int) -> Array:
    """Equal segments but the last, the first one upright or aslant, bent by some 20 degrees each time."""
    rng = np.random.default_rng(seed)
    first = np.array([0.0, 0.0, -1.0]) if seed % 2 else rng.normal(size=3)
    directions = [first / np.linalg.norm(first)]
    for _ in range(count - 1):
        turned = directions[-1] + 0.25 * rng.normal(size=3)
        directions.append(turned / np.linalg.norm(turned))
    lengths = np.full(count, 0.05)
    lengths[-1] *= 0.4
    start = rng.normal(size=3)
    return np.vstack([start, start + np.cumsum(lengths[:, None] * np.array(directions), axis=0)])


@pytest.fixture(scope="module")
def case(make_result, straight) -> Callable[[tuple[int, int, str, str]], FitData]:
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    @cache
    def make(settings: tuple[int, int, str, str]) -> FitData:
        count, dof, zero, base = settings
        points = chain_points(count, count + dof)
        joints = Joints(np.linspace(0, 1, count + 1), points, 0.05, 0.02)
        chosen = {"joints": {"dof": dof, "zero": zero, "base": base}, "material": {"preset": "rope"}}
        chain = build_chain(joints, 0.01)
        return configured(replace(template, joints=joints, chain=chain), **chosen)

    return make


def text(result: FitData, name: str) -> str:
    (content,) = model_format(name).write(result, "cable").values()
    return content.decode()


@lru_cache
def described(result: FitData) -> dict[str, Any]:
    """What the JSON says."""
    return json.loads(text(result, "json"))


def values(result: FitData, pose: str) -> dict[str, float]:
    """Values of the hinges by name, as the JSON has them."""
    joints = described(result)["model"]["joints"]
    return {name: value for joint in joints for name, value in zip(joint["hinges"], joint[pose], strict=True)}


def expected(result: FitData, pose: str) -> Array:
    chain = result.chain
    if pose == "scanned":
        return chain.joints
    along = np.concatenate([[0.0], np.cumsum(chain.lengths)])
    return chain.joints[0] + along[:, None] * chain.transforms[0, :3, 0]


def names(result: FitData) -> list[str]:
    return [link["name"] for link in described(result)["links"]]


def check(result: FitData, kinematics: Kinematics, tolerance: float = 1e-9) -> None:
    for pose in ("scanned", "straight"):
        assert kinematics(pose) == pytest.approx(expected(result, pose), rel=0, abs=tolerance), pose


@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_json(case, settings) -> None:
    result = case(settings)
    data = described(result)
    model = data["model"]
    assert data["joints"] == result.chain.joints.tolist()

    def kinematics(pose: str) -> Array:
        frame, points = np.array(model["base_transform"]), []
        points.append(frame[:3, 3])
        for joint in model["joints"]:
            turn = np.eye(4)
            turn[:3, :3] = hinges(tuple(joint["axes"]), np.array(joint[pose]))
            frame = frame @ np.array(joint["origin"]) @ turn
            points.append(frame[:3, 3])
        return np.array([*points, (frame @ [data["links"][-1]["length"], 0, 0, 1])[:3]])

    check(result, kinematics)
    zero = [value for joint in model["joints"] for value in joint["scanned" if settings[2] == "scan" else "straight"]]
    assert not any(zero)


def by_pinocchio(model, q: Array, links: list[str]) -> Array:
    """Origins of links. With Pinocchio's joints, without its `Data`: that takes 5 GB for 400 joints."""
    placed = [model.jointPlacements[0]]
    for i in range(1, model.njoints):
        joint = model.joints[i].createData()
        model.joints[i].calc(joint, q)
        placed.append(placed[model.parents[i]] * model.jointPlacements[i] * joint.M)
    frames = [model.frames[model.getFrameId(name)] for name in links]
    return np.array([(placed[frame.parentJoint] * frame.placement).translation for frame in frames])


@pytest.mark.oracle
@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_urdf_in_pinocchio(case, settings, capfd) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    result = case(settings)
    model = pinocchio.buildModelFromXML(text(result, "urdf"))
    links = [*names(result), "tip"]
    assert model.nv == (len(result.chain.lengths) - 1) * settings[1] + 6 * (settings[3] == "floating")

    def kinematics(pose: str) -> Array:
        q = pinocchio.neutral(model)
        for name, value in values(result, pose).items():
            q[model.joints[model.getJointId(name)].idx_q] = value
        if len(links) < 10:
            data = model.createData()
            pinocchio.framesForwardKinematics(model, data, q)
            found = np.array([data.oMf[model.getFrameId(name)].translation for name in links])
            assert found == pytest.approx(by_pinocchio(model, q, links), abs=1e-12)
        return by_pinocchio(model, q, links)

    check(result, kinematics)
    assert capfd.readouterr() == ("", "")


@pytest.mark.oracle
@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_srdf_in_pinocchio(case, settings, capfd) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    result = case(settings)
    model = pinocchio.buildModelFromXML(text(result, "urdf"))
    pinocchio.loadReferenceConfigurationsFromXML(model, text(result, "srdf"), False)

    def kinematics(pose: str) -> Array:
        q = model.referenceConfigurations[pose] if model.nq else pinocchio.neutral(model)
        return by_pinocchio(model, q, [*names(result), "tip"])

    check(result, kinematics)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_urdf_in_mujoco(case, settings, monkeypatch, tmp_path, capfd) -> None:
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings into a file
    result = case(settings)
    model = mujoco.MjModel.from_xml_string(text(result, "urdf"))
    data = mujoco.MjData(model)

    def kinematics(pose: str) -> Array:
        for name, value in values(result, pose).items():
            data.joint(name).qpos = value
        mujoco.mj_kinematics(model, data)
        last = data.body(names(result)[-1])
        tip = last.xpos + result.chain.lengths[-1] * last.xmat.reshape(3, 3)[:, 0]
        if settings[3] == "fixed":
            assert data.body("tip").xpos == pytest.approx(tip, rel=0, abs=1e-9)
        return np.array([*(data.body(name).xpos for name in names(result)), tip])

    check(result, kinematics)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.oracle
@pytest.mark.parametrize("settings", [case for case in CASES if case[0] <= 10])
def test_urdf_in_yourdfpy(case, settings, caplog) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    result = case(settings)
    with caplog.at_level(logging.WARNING), warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = yourdfpy.URDF.load(io.BytesIO(text(result, "urdf").encode()), load_meshes=False)
        assert robot.validate()
    assert caplog.records == []

    def kinematics(pose: str) -> Array:
        at = values(result, pose)
        robot.update_cfg({name: at.get(name, 0.0) for name in robot.actuated_joint_names if name in at})
        return np.array([robot.get_transform(name)[:3, 3] for name in [*names(result), "tip"]])

    check(result, kinematics)


@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_mjcf_in_mujoco(case, settings, monkeypatch, tmp_path, capfd) -> None:
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    result = case(settings)
    model = mujoco.MjModel.from_xml_string(text(result, "mjcf"))
    data = mujoco.MjData(model)

    def kinematics(pose: str) -> Array:
        mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
        found = dict(values(result, pose))
        assert {name: float(data.joint(name).qpos[0]) for name in found} == found
        mujoco.mj_kinematics(model, data)
        return np.array([*(data.body(name).xpos for name in names(result)), data.site("tip").xpos])

    check(result, kinematics)
    # Without a keyframe it is in its zero pose.
    mujoco.mj_resetData(model, data)
    mujoco.mj_kinematics(model, data)
    zero = "scanned" if settings[2] == "scan" else "straight"
    assert data.site("tip").xpos == pytest.approx(expected(result, zero)[-1], rel=0, abs=1e-9)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.oracle
@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_sdf_in_drake(case, settings, caplog) -> None:
    plants = pytest.importorskip("pydrake.multibody.plant")
    parsing = pytest.importorskip("pydrake.multibody.parsing")
    result = case(settings)
    count, dof, _, base = settings
    plant = plants.MultibodyPlant(0.0)
    parsing.Parser(plant).AddModelsFromString(text(result, "sdf"), "sdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.num_velocities() == (count - 1) * dof + 6 * (base == "floating")
    assert plant.CalcTotalMass(context) == pytest.approx(described(result)["model"]["material"]["mass"])

    def kinematics(pose: str) -> Array:
        for joint in described(result)["model"]["joints"]:
            angles = np.array(joint[pose])
            if dof == 3:
                # Drake's ball joint takes roll, pitch, yaw.
                angles = Rotation.from_matrix(hinges(tuple(joint["axes"]), angles)).as_euler("xyz")
            plant.GetJointByName(joint["name"]).set_angles(context, angles)
        frames = [plant.GetFrameByName(name) for name in [*names(result), "tip"]]
        return np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])

    check(result, kinematics)
    assert caplog.records == []


@pytest.mark.oracle
@pytest.mark.parametrize("settings", CASES, ids=IDS)
def test_urdf_in_drake(case, settings, caplog) -> None:
    plants = pytest.importorskip("pydrake.multibody.plant")
    parsing = pytest.importorskip("pydrake.multibody.parsing")
    result = case(settings)
    plant = plants.MultibodyPlant(0.0)
    parsing.Parser(plant).AddModelsFromString(text(result, "urdf"), "urdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()

    def kinematics(pose: str) -> Array:
        for name, value in values(result, pose).items():
            plant.GetJointByName(name).set_angle(context, value)
        first, *rest = (plant.GetFrameByName(name) for name in [*names(result), "tip"])
        points = [frame.CalcPose(context, first).translation() for frame in rest]
        # Drake leaves a floating base at its origin.
        rotation, start = result.chain.transforms[0, :3, :3], result.chain.joints[0]
        if settings[3] == "fixed":
            base = first.CalcPose(context, plant.GetFrameByName("base_link"))
            assert base.rotation().matrix() == pytest.approx(rotation, abs=1e-12)
            assert base.translation() == pytest.approx(start, abs=1e-12)
        return np.array([start, *(start + rotation @ point for point in points)])

    check(result, kinematics)
    told = [record.getMessage() for record in caplog.records]
    if settings[3] == "fixed":
        assert told == []
    else:
        # Drake has no floating joints in URDF; it says so and leaves the base free, which is what is meant.
        (message,) = told
        assert "Leaving 'segment_" in message
