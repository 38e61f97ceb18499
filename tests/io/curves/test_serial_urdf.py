"""The shape of a serial chain in URDF: by hand, by another reader, and what is refused."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from curve_files import joint, refused, robot, written
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.geometry.rotations import from_roll_pitch_yaw
from dlogen.io.curves.curve import load_curve
from dlogen.io.curves.serial_urdf import link_origins
from dlogen.io.models import urdf
from dlogen.types import FitData


def test_our_urdf_has_the_joints_of_the_chain(result: FitData, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.urdf", urdf.write(result, "cable")["cable.urdf"])
    curve = load_curve(path)
    assert (curve.kind, curve.is_chain) == ("urdf", True)
    assert curve.points == pytest.approx(result.chain.joints, abs=1e-9)


ARM = (
    joint("a", "l0", "l1", 'xyz="0.5 0.1 0" rpy="0.3 -0.7 1.1"'),
    joint("b", "l1", "l2", 'xyz="0 0.4 0.2" rpy="-2 0.4 0.6"'),
    joint("c", "l2", "l3", 'xyz="-0.2 0 0.3" rpy="1.5707963267948966 1.5707963267948966 0"', "fixed"),
    joint("d", "l3", "l4", 'xyz="0.1 0.2 0.3"', "fixed"),
)


@pytest.mark.oracle
def test_forward_kinematics_is_that_of_yourdfpy(result: FitData, tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    path = written(tmp_path, "arm.urdf", robot(*ARM))
    model = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    expected = [model.get_transform(f"l{i}", "l0")[:3, 3] for i in range(5)]
    assert load_curve(path).points == pytest.approx(np.array(expected), abs=1e-12)


def test_urdf_by_hand(tmp_path: Path) -> None:
    # A quarter turn left at the first joint: the second step goes along y; then a quarter roll: z becomes -y.
    text = robot(
        joint("a", "l0", "l1", 'xyz="1 0 0" rpy="0 0 1.5707963267948966"'),
        joint("b", "l1", "l2", 'xyz="2 0 0" rpy="1.5707963267948966 0 0"'),
        joint("c", "l2", "l3", 'xyz="0 0 3"'),
    )
    expected = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [4, 2, 0]]
    assert load_curve(written(tmp_path, "a.urdf", text)).points == pytest.approx(np.array(expected, dtype=float))


def test_the_order_of_joints_in_the_file_does_not_matter(tmp_path: Path) -> None:
    expected = load_curve(written(tmp_path, "a.urdf", robot(*ARM))).points
    for order in itertools.permutations(ARM):
        assert np.array_equal(load_curve(written(tmp_path, "b.urdf", robot(*order))).points, expected)


def test_frames_before_the_first_body_place_the_model(tmp_path: Path) -> None:
    links = '<link name="world"/><link name="base"/><link name="l1"><visual/></link><link name="l2"/>'
    text = robot(
        joint("p", "world", "base", 'xyz="5 0 0"', "fixed"),
        joint("q", "base", "l1", 'xyz="0 5 0"', "fixed"),
        joint("r", "l1", "l2"),
        links=links,
    )
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[5, 5, 0], [6, 5, 0]]


def test_a_model_without_bodies_begins_at_its_root_and_stacked_joints_count_once(tmp_path: Path) -> None:
    text = robot(
        joint("a", "l0", "l1"),
        joint("b", "l1", "l2", 'xyz="0 0 0"'),
        joint("c", "l2", "l3", ""),
        joint("d", "l3", "l4", 'xyz="0 1 0"'),
        bodies=False,
    )
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_frames_fixed_to_a_segment_are_passed_over(tmp_path: Path) -> None:
    side = joint("s", "l1", "camera", 'xyz="0 0 9"', "fixed")
    text = robot(joint("a", "l0", "l1"), side, joint("b", "l1", "l2", 'xyz="0 1 0"'))
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_a_long_chain_does_not_exhaust_the_stack(tmp_path: Path) -> None:
    text = robot(*(joint(f"j{i}", f"l{i}", f"l{i + 1}", 'xyz="0.001 0 0"') for i in range(3000)))
    assert load_curve(written(tmp_path, "a.urdf", text)).points[-1] == pytest.approx([3, 0, 0])


LAUGHS = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"), joint("c", "l1", "l3")), "branches at the link 'l1'"),
        (robot(joint("a", "l0", "l1", kind="fixed"), joint("b", "l0", "l2", kind="fixed")), "branches"),
        (robot(joint("a", "l0", "l1"), joint("b", "l2", "l3")), "2 of 4 have no parent"),
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l0")), "no tree"),
        (robot(joint("a", "l0", "l1"), joint("b", "l2", "l3"), joint("c", "l3", "l2")), "ring"),
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"), joint("c", "l0", "l2")), "1 have several"),
        (robot(joint("a", "l0", "l1"), links='<link name="l0"/>'), "'l1', which is not there"),
        (robot(joint("a", "l0", "l1", 'xyz="1 0"')), "joint 'a' has xyz='1 0'"),
        (robot(joint("a", "l0", "l1", 'rpy="1 0 east"')), "rpy='1 0 east'"),
        (robot(joint("a", "l0", "l1", 'xyz="nan 0 0"')), "nan"),
        (robot('<joint name="a" type="fixed"/>', links='<link name="l0"/>'), "parent and child"),
        (robot(links='<link name="l0"/>'), "1 point in one place"),
        (robot(), "no tree"),
        ("<mujoco><worldbody/></mujoco>", "<mujoco>"),
        (robot(joint("a", "l0", "l1"))[:-20], "not valid XML"),
        (LAUGHS + robot(joint("a", "l0", "l1")).split("\n")[1], "document type"),
        ('<?xml version="1.0" encoding="no-such"?><robot/>', "not valid XML"),
    ],
)
def test_urdf_that_is_no_serial_chain(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.urdf", text), words)


@given(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0), st.floats(-7.0, 7.0))
def test_angles_are_about_fixed_axes(roll: float, pitch: float, yaw: float) -> None:
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    assert np.allclose(from_roll_pitch_yaw(roll, pitch, yaw), expected, atol=1e-12)


def test_it_needs_no_file() -> None:
    assert link_origins(robot(joint("a", "l0", "l1")).encode()).tolist() == [[0, 0, 0], [1, 0, 0]]
