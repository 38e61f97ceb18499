from __future__ import annotations

import logging
import math
import os
import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from configured import configured
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.evaluation.shapes import centre_line, hose_centre_line, random_centre_line
from dlogen.geometry.rotations import roll_pitch_yaw
from dlogen.io.models.urdf import write
from dlogen.multibody.build import multibody
from dlogen.stages.chain import build_chain
from dlogen.stages.segmentation.joints import place_joints
from dlogen.types import FitData

mujoco = pytest.importorskip("mujoco")


def text(result: FitData, stem: str = "cable") -> str:
    (name, content), *others = write(result, stem).items()
    assert name == f"{stem}.urdf"
    assert not others
    return content.decode()


def names(result: FitData) -> list[str]:
    digits = max(2, len(str(len(result.chain.lengths))))
    return [f"segment_{i + 1:0{digits}d}" for i in range(len(result.chain.lengths))]


class Yourdfpy:
    """Forward kinematics by yourdfpy; anything that it complains about is an error."""

    def __init__(self, urdf: str, tmp_path, caplog) -> None:
        yourdfpy = pytest.importorskip("yourdfpy")
        path = tmp_path / "model.urdf"
        path.write_text(urdf, encoding="utf-8")
        with caplog.at_level(logging.WARNING), warnings.catch_warnings():
            warnings.simplefilter("error")
            self.robot = yourdfpy.URDF.load(path, build_scene_graph=True, load_meshes=False)
            assert self.robot.validate()
        assert caplog.records == []

    def positions(self, links: list[str], **values: float) -> np.ndarray:
        """Origins of links, (K, 3), at these joint values, others at zero."""
        self.robot.update_cfg({name: values.get(name, 0.0) for name in self.robot.actuated_joint_names})
        return np.array([self.robot.get_transform(link)[:3, 3] for link in links])

    def rotation(self, link: str) -> np.ndarray:
        return self.robot.get_transform(link)[:3, :3]


class Mujoco:
    """Forward kinematics by MuJoCo; warnings that it writes to its log are errors."""

    def __init__(self, urdf: str, tmp_path, monkeypatch) -> None:
        monkeypatch.chdir(tmp_path)
        self.model = mujoco.MjModel.from_xml_string(urdf)
        self.data = mujoco.MjData(self.model)
        assert not (tmp_path / "MUJOCO_LOG.TXT").exists()

    def positions(self, links: list[str], **values: float) -> np.ndarray:
        self.data.qpos[:] = 0
        for name, value in values.items():
            self.data.joint(name).qpos = value
        mujoco.mj_forward(self.model, self.data)
        return np.array([self.data.body(link).xpos for link in links])

    def rotation(self, link: str) -> np.ndarray:
        return self.data.body(link).xmat.reshape(3, 3)


@pytest.fixture(params=[pytest.param("yourdfpy", marks=pytest.mark.oracle), "mujoco"])
def load(request, tmp_path, caplog, monkeypatch):
    if request.param == "yourdfpy":
        return lambda urdf: Yourdfpy(urdf, tmp_path, caplog)
    return lambda urdf: Mujoco(urdf, tmp_path, monkeypatch)


def with_length(result: FitData, length: float) -> FitData:
    """The same line with segments of this length."""
    from dataclasses import replace

    joints = place_joints(result.skeleton, length)
    return replace(result, joints=joints, chain=build_chain(joints, result.chain.radius))


CASES = {
    "hose": lambda exact, straight: exact(hose_centre_line()),
    "bent": lambda exact, straight: exact(centre_line("bent")),
    "helical": lambda exact, straight: exact(centre_line("helical")),
    "random": lambda exact, straight: exact(random_centre_line(8)),
    "one segment": lambda exact, straight: straight([1, 2, 3], [2, 2.5, 3.1]),
    "upright": lambda exact, straight: straight([1, 2, 3], [1, 2, 4]),
    "hanging": lambda exact, straight: straight([0, 0, 0], [0, 0, -1]),
    "far away": lambda exact, straight: exact(random_centre_line(8).moved(np.eye(3), np.array([5e6, -4e6, 300.0]))),
}


@pytest.mark.parametrize("case", CASES)
def test_zero_is_the_scanned_pose(exact_line, straight, make_result, load, case: str) -> None:
    result = make_result(CASES[case](exact_line, straight), 0.02, 0.01)
    robot = load(text(result))
    # At 5e6 m the last digit of a double is 1e-9.
    tolerance = 1e-9 if case != "far away" else 5e-9
    found = robot.positions([*names(result), "tip"])
    assert found == pytest.approx(result.chain.joints, rel=0, abs=tolerance)
    # And the orientation: x along the segment, y and z as in the chain.
    for name, transform in zip(names(result), result.chain.transforms, strict=True):
        assert robot.rotation(name) == pytest.approx(transform[:3, :3], abs=1e-9)


@pytest.mark.parametrize("count", [1, 2, 9, 10, 99, 100, 120, 200])
def test_names_are_padded_so_that_they_sort(request, straight, make_result, load, count: int) -> None:
    result = with_length(make_result(straight([0, 0, 0], [1, 0.3, 0.2])), math.sqrt(1.13) / (count - 0.5))
    assert len(result.chain.lengths) == count
    urdf = ElementTree.fromstring(text(result))
    links = [link.get("name") for link in urdf.findall("link")]
    segments = [name for name in links if name.startswith("segment_")]
    assert segments == names(result)
    assert sorted(segments) == segments
    hinges = [joint.get("name") for joint in urdf.findall("joint") if joint.get("type") == "revolute"]
    assert len(hinges) == 2 * (count - 1)
    assert len(set(links)) == len(links)
    assert sorted({name[: name.rindex("_")] for name in hinges}) == [
        f"joint_{i + 1:0{max(2, len(str(count)))}d}" for i in range(count - 1)
    ]
    if count < 50 or request.node.callspec.params["load"] == "mujoco":  # yourdfpy takes seconds for long chains
        found = load(text(result)).positions([*names(result), "tip"])
        assert found == pytest.approx(result.chain.joints, rel=0, abs=1e-9)


@pytest.mark.parametrize(("column", "axis"), [(1, "y"), (2, "z")])
def test_a_joint_moves_what_is_behind_it(exact_line, make_result, load, column: int, axis: str) -> None:
    result = make_result(exact_line(random_centre_line(8)), 0.02, 0.01)
    chain, links = result.chain, [*names(result), "tip"]
    robot = load(text(result))
    for k in (1, len(chain.lengths) // 2, len(chain.lengths) - 1):
        for angle in (0.7, -2.0):
            found = robot.positions(links, **{f"joint_{k:02d}_{axis}": angle})
            turn = Rotation.from_rotvec(angle * chain.transforms[k, :3, column])
            expected = chain.joints.copy()
            expected[k + 1 :] = chain.joints[k] + turn.apply(chain.joints[k + 1 :] - chain.joints[k])
            assert found == pytest.approx(expected, abs=1e-9)
            assert robot.rotation(links[k]) == pytest.approx(turn.as_matrix() @ chain.transforms[k, :3, :3], abs=1e-9)


def test_both_joints_turn_about_y_and_then_z(exact_line, make_result, load) -> None:
    result = make_result(exact_line(random_centre_line(8)), 0.02, 0.01)
    robot = load(text(result))
    robot.positions([], joint_03_y=0.4, joint_03_z=-0.9)
    turned = Rotation.from_euler("YZ", [0.4, -0.9]).as_matrix()
    assert robot.rotation("segment_04") == pytest.approx(result.chain.transforms[3, :3, :3] @ turned, abs=1e-9)


def bodies(urdf: ElementTree.Element) -> dict[str, tuple[float, np.ndarray]]:
    """Mass and inertia matrix of every link that has them."""
    found = {}
    for link in urdf.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is not None and inertia is not None:
            xx, xy, xz, yy, yz, zz = (float(inertia.get(f"i{key}")) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
            found[str(link.get("name"))] = (
                float(mass.get("value")),
                np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
            )
    return found


@pytest.mark.parametrize("radius", [0.0005, 0.0015, 0.02])
def test_masses_and_inertias(exact_line, make_result, load, radius: float) -> None:
    result = make_result(exact_line(hose_centre_line()), radius)
    found = bodies(ElementTree.fromstring(text(result)))
    for mass, inertia in found.values():
        assert mass > 0
        values = np.linalg.eigvalsh(inertia)
        assert values[0] > 0
        assert values[2] <= (values[0] + values[1]) * (1 + 1e-9)  # of a body that can exist
    segments = [found[name] for name in names(result)]
    for (mass, inertia), length in zip(segments, result.chain.lengths, strict=True):
        assert mass == pytest.approx(1200 * math.pi * radius**2 * length, rel=1e-9)
        across = mass * (3 * radius**2 + length**2) / 12
        assert np.diag(inertia) == pytest.approx([mass * radius**2 / 2, across, across], rel=1e-9)
    total = 1200 * math.pi * radius**2 * result.chain.length
    assert sum(mass for mass, _ in segments) == pytest.approx(total, rel=1e-9)
    # The small links between the hinges are not felt, in mass or where they turn with a segment.
    assert sum(mass for mass, _ in found.values()) < (1.01 if radius > 0.001 else 1.1) * total
    small = [inertia for name, (_, inertia) in found.items() if name not in names(result)]
    assert max(np.max(inertia) for inertia in small) < 0.01 * min(np.max(inertia) for _, inertia in segments[:-1])
    load(text(result))


@pytest.mark.parametrize(("radius", "left_over"), [(0.0015, 1e-5), (0.02, 1e-8)])
def test_a_tiny_last_segment_loads(straight, make_result, load, radius: float, left_over: float) -> None:
    result = make_result(straight([0, 0, 0], [1, 0, 0]), radius)
    result = with_length(result, (1 - left_over) / 10)
    assert result.chain.lengths[-1] == pytest.approx(left_over, rel=0.1)
    found = load(text(result)).positions([*names(result), "tip"])
    # yourdfpy takes a transform this small for the identity.
    assert found == pytest.approx(result.chain.joints, rel=0, abs=1e-9 + left_over)


def test_bodies_lie_where_the_segments_are(exact_line, make_result) -> None:
    result = make_result(exact_line(random_centre_line(8)), 0.015, 0.01)
    urdf = ElementTree.fromstring(text(result))
    for name, length in zip(names(result), result.chain.lengths, strict=True):
        link = next(link for link in urdf.findall("link") if link.get("name") == name)
        for kind in ("visual", "collision"):
            cylinder = link.find(f"{kind}/geometry/cylinder")
            origin = link.find(f"{kind}/origin")
            assert float(cylinder.get("radius")) == pytest.approx(0.015, rel=0.5)
            place = np.array(origin.get("xyz").split(), dtype=float)
            half = (
                float(cylinder.get("length"))
                / 2
                * Rotation.from_euler("xyz", np.array(origin.get("rpy").split(), dtype=float)).apply([0, 0, 1.0])
            )
            ends = np.array([place - half, place + half])
            assert np.abs(ends[:, 1:]).max() < 1e-12  # along x, URDF's cylinders lie along z
            if kind == "visual":
                assert sorted(ends[:, 0]) == pytest.approx([0, length], abs=1e-9)
                assert float(cylinder.get("radius")) == 0.015
            else:
                assert 0 <= min(ends[:, 0]) < max(ends[:, 0]) <= length
        centre = np.array(link.find("inertial/origin").get("xyz").split(), dtype=float)
        assert centre == pytest.approx([length / 2, 0, 0])


def test_neighbouring_collision_bodies_do_not_touch(exact_line, make_result, tmp_path, monkeypatch) -> None:
    result = make_result(exact_line(hose_centre_line()), 0.02, 0.01)
    robot = Mujoco(text(result), tmp_path, monkeypatch)
    robot.positions([])
    assert robot.data.ncon == 0


def test_every_moving_joint_has_limits(exact_line, make_result) -> None:
    urdf = ElementTree.fromstring(text(make_result(exact_line(hose_centre_line()), 0.02, 0.01)))
    for joint in urdf.findall("joint"):
        if joint.get("type") == "revolute":
            limit = joint.find("limit")
            assert float(limit.get("lower")) < 0 < float(limit.get("upper"))
            assert float(limit.get("effort")) > 0
            assert float(limit.get("velocity")) > 0


@pytest.mark.parametrize("stem", ["a & b", "<cable>", 'say "hi"', "it's", "größe-線", "a b.c"])
def test_names_with_special_characters(straight, make_result, load, stem: str) -> None:
    result = make_result(straight([0, 0, 0], [1, 0, 0]))
    assert ElementTree.fromstring(text(result, stem)).get("name") == stem
    load(text(result, stem))


@pytest.mark.parametrize("stem", ["a\x01b", os.fsdecode(b"a\xf6b"), "a\uffffb"])
def test_names_that_xml_cannot_hold(straight, make_result, load, stem: str) -> None:
    urdf = text(make_result(straight([0, 0, 0], [1, 0, 0])), stem)
    assert ElementTree.fromstring(urdf).get("name") == "a\ufffdb"
    load(urdf)


def test_the_same_chain_gives_the_same_bytes(exact_line, make_result) -> None:
    first, second = (write(make_result(exact_line(centre_line("helical"))), "x") for _ in range(2))
    assert first == second


def test_numbers_keep_all_their_digits(exact_line, make_result) -> None:
    line = random_centre_line(8).moved(np.eye(3), np.array([1 / 3, 1e-7, -2e3]))
    result = make_result(exact_line(line), 0.02, 0.01)
    urdf = ElementTree.fromstring(text(result))
    base = urdf.find("joint[@name='base_joint']/origin").get("xyz")
    assert [float(number) for number in base.split()] == result.chain.joints[0].tolist()
    assert "nan" not in text(result)
    assert not re.search(r'[" ]-0\.0[" ]', text(result))


def with_settings(result: FitData, **changes: dict[str, object]) -> FitData:
    return configured(result, **changes)


@pytest.mark.parametrize("zero", ["scan", "straight"])
@pytest.mark.parametrize("dof", [2, 3])
def test_hinges_say_what_the_model_says(exact_line, make_result, zero: str, dof: int) -> None:
    result = with_settings(
        make_result(exact_line(hose_centre_line()), 0.02, 0.01),
        joints={"dof": dof, "zero": zero, "rest": "scan", "min_bend_radius": 0.1},
        material={"preset": "vacuum-hose"},
    )
    urdf = ElementTree.fromstring(text(result))
    springs = {item.get("reference"): item for item in urdf.findall("gazebo")}
    for joint in multibody(result).joints:
        for k, name in enumerate(joint.hinge_names):
            found = urdf.find(f"joint[@name='{name}']")
            limit = found.find("limit")
            assert (float(limit.get("lower")), float(limit.get("upper"))) == (joint.lower[k], joint.upper[k])
            assert float(found.find("dynamics").get("damping")) == joint.damping[k]
            assert float(springs[name].findtext("springStiffness")) == joint.stiffness[k]
            assert float(springs[name].findtext("springReference")) == joint.rest[k]
            axis = [float(number) for number in found.find("axis").get("xyz").split()]
            assert axis == ([0, 1, 0], [0, 0, 1], [1, 0, 0])[k]


def test_no_springs_without_a_modulus(exact_line, make_result) -> None:
    urdf = ElementTree.fromstring(text(make_result(exact_line(hose_centre_line()), 0.02, 0.01)))
    assert not urdf.findall("gazebo")


@pytest.mark.parametrize(("base", "kind"), [("fixed", "fixed"), ("floating", "floating")])
def test_base_joint(straight, make_result, base: str, kind: str) -> None:
    urdf = ElementTree.fromstring(
        text(with_settings(make_result(straight([0, 0, 0], [1, 0, 0])), joints={"base": base}))
    )
    joint = urdf.find("joint[@name='base_joint']")
    assert joint.get("type") == kind
    assert joint.find("parent").get("link") == "base_link"
    assert list(urdf.find("link[@name='base_link']")) == []  # KDL wants a root without inertia


def matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    return Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()


angles = st.floats(-math.pi, math.pi)


@given(angles, angles, angles)
def test_roll_pitch_yaw_gives_the_rotation_back(roll: float, pitch: float, yaw: float) -> None:
    rotation = matrix(roll, pitch, yaw)
    found = roll_pitch_yaw(rotation)
    assert matrix(*found) == pytest.approx(rotation, abs=1e-14)
    assert abs(found[1]) <= math.pi / 2
    if abs(pitch) < 1.5 and abs(roll) < 3.14 and abs(yaw) < 3.14:
        assert found == pytest.approx((roll, pitch, yaw), abs=1e-10)


@given(angles, st.sampled_from([-1, 1]), st.floats(-12, -1), angles)
def test_roll_pitch_yaw_near_gimbal_lock(roll: float, side: int, exponent: float, yaw: float) -> None:
    for off in (0.0, 10**exponent):
        rotation = matrix(roll, side * (math.pi / 2 - off), yaw)
        # The angles themselves are not determined here, but the rotation that they make is.
        assert matrix(*roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-14)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_random_chains_keep_their_joints(exact_line, make_result, seed: int) -> None:
    # Forward kinematics by hand, from the text alone.
    result = make_result(exact_line(random_centre_line(seed)), 0.02, 0.01)
    pose, origins = {"base_link": np.eye(4)}, {}
    for joint in ElementTree.fromstring(text(result)).findall("joint"):
        local = np.eye(4)
        local[:3, 3] = [float(number) for number in joint.find("origin").get("xyz").split()]
        local[:3, :3] = matrix(*(float(number) for number in joint.find("origin").get("rpy").split()))
        child = joint.find("child").get("link")
        pose[child] = pose[joint.find("parent").get("link")] @ local
        origins[child] = pose[child][:3, 3]
    found = np.array([origins[name] for name in [*names(result), "tip"]])
    assert found == pytest.approx(result.chain.joints, abs=1e-11)
