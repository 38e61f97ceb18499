"""SRDF: what MoveIt reads of it. Its states are checked with the other formats' kinematics."""

from __future__ import annotations

from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from configured import configured
from scipy.spatial.transform import Rotation

from dlogen.io.models.srdf import write
from dlogen.io.models.urdf import write as write_urdf
from dlogen.multibody.build import multibody
from dlogen.types import FitData


@pytest.fixture
def result(make_result, circle) -> FitData:
    return make_result(circle(0.5, 3.0), 0.02, 0.005)


def parsed(result: FitData, stem: str = "cable") -> ElementTree.Element:
    (name, content), *others = write(result, stem).items()
    assert name == f"{stem}.srdf"
    assert not others
    return ElementTree.fromstring(content)


def with_joints(result: FitData, **settings: object) -> FitData:
    return configured(result, joints=settings)


@pytest.mark.parametrize("settings", [{}, {"dof": 3, "base": "floating", "zero": "straight"}])
def test_names_are_those_of_the_urdf(result, settings) -> None:
    result = with_joints(result, **settings)
    srdf, urdf = parsed(result, "a & b"), ElementTree.fromstring(write_urdf(result, "a & b")["a & b.urdf"])
    assert srdf.get("name") == urdf.get("name")
    links = {link.get("name") for link in urdf.findall("link")}
    joints = {joint.get("name") for joint in urdf.findall("joint") if joint.get("type") != "fixed"}
    chain = srdf.find("group/chain")
    assert {chain.get("base_link"), chain.get("tip_link")} == {"base_link", "tip"} <= links
    for state in srdf.findall("group_state"):
        assert state.get("group") == srdf.find("group").get("name")
        assert {joint.get("name") for joint in state.findall("joint")} == joints
    for pair in srdf.findall("disable_collisions"):
        assert {pair.get("link1"), pair.get("link2")} <= links


@pytest.mark.parametrize("zero", ["scan", "straight"])
def test_states(result, zero) -> None:
    result = with_joints(result, zero=zero)
    model = multibody(result)
    states = {state.get("name"): state for state in parsed(result).findall("group_state")}
    assert list(states) == ["scanned", "straight"]
    for name, expected in (("scanned", model.scanned), ("straight", model.straight)):
        found = {joint.get("name"): float(joint.get("value")) for joint in states[name].findall("joint")}
        assert found == dict(zip(model.hinge_names, expected.ravel().tolist(), strict=True))


def test_a_floating_base_stays_where_its_joint_has_it(result) -> None:
    """MoveIt's variables of a floating joint: trans_x, trans_y, trans_z, rot_x, rot_y, rot_z, rot_w."""
    for state in parsed(with_joints(result, base="floating")).findall("group_state"):
        (base,) = (joint for joint in state.findall("joint") if joint.get("name") == "base_joint")
        values = [float(word) for word in base.get("value", "").split()]
        assert values[:3] == [0.0, 0.0, 0.0]
        assert Rotation.from_quat(values[3:]).as_matrix() == pytest.approx(np.eye(3))  # scipy has w last as well


def test_collisions_of_one_bend_are_off(result) -> None:
    pairs = [
        (pair.get("link1"), pair.get("link2"), pair.get("reason"))
        for pair in parsed(result).findall("disable_collisions")
    ]
    names = [body.name for body in multibody(result).bodies]
    assert [pair[:2] for pair in pairs if pair[2] == "Adjacent"] == list(pairwise(names))
    assert {pair[:2] for pair in pairs} == {(names[i], names[j]) for i, j in multibody(result).close_pairs()}
    assert len(pairs) < len(names) * (len(names) - 1) / 2  # those far apart along the object may meet
