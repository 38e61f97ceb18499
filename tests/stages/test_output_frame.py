"""The frame of the output: what moves, by how much, and in which order."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

import dlogen
from dlogen.cli.main import cli
from dlogen.config.schema import Config
from dlogen.config.sections import FrameSettings
from dlogen.errors import ConfigError
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.rotations import from_quaternion, quaternion
from dlogen.io.cloud_files import read_cloud, write_cloud
from dlogen.io.registry import model_format
from dlogen.stages.chain import build_chain
from dlogen.stages.output_frame import OPTICAL_TO_ROS, in_frame, output_frame
from dlogen.types import Cloud, Finding, Frame, Quality

LINE = random_centre_line(3, clearance=0.08)
CLOUD = sample_tube(LINE, 0.015, 1500, 3).points
POINTS = np.zeros((1, 3))
OPTIONS = {"r": 0.015, "profile": "paper"}


def transform(cloud: Cloud | None = None, scale: float = 1.0, **settings) -> np.ndarray:
    return output_frame(FrameSettings(**settings), cloud or Cloud(POINTS), scale).transform


def apply(pose: np.ndarray, points) -> np.ndarray:
    return np.asarray(points) @ pose[:3, :3].T + pose[:3, 3]


@pytest.fixture(scope="module")
def here():
    return dlogen.fit(CLOUD, OPTIONS)


def fit_in(**frame):
    return dlogen.fit(CLOUD, {**OPTIONS, "frame": frame})


def test_by_default_nothing_moves(here) -> None:
    assert transform().tolist() == np.eye(4).tolist()
    assert here.frame.name == "cloud"
    data = json.loads(model_format("json").write(here, "x")["x.json"])
    assert data["frame"] == "cloud"
    assert data["frame_transform"] == np.eye(4).tolist()


def test_optical_to_ros_by_hand() -> None:
    pose = transform(convention="optical-to-ros")
    # One metre before the camera, 0.2 to the right, 0.1 below its axis.
    assert apply(pose, [[0.2, 0.1, 1.0]]).tolist() == [[1.0, -0.2, -0.1]]
    right, down, forward = OPTICAL_TO_ROS.T.tolist()
    assert forward == [1, 0, 0]
    assert right == [0, -1, 0]  # minus left
    assert down == [0, 0, -1]  # minus up
    assert np.linalg.det(OPTICAL_TO_ROS) == pytest.approx(1.0)
    # As usual in camera drivers: rpy of the optical frame in the body's.
    assert Rotation.from_matrix(OPTICAL_TO_ROS).as_euler("xyz") == pytest.approx([-math.pi / 2, 0, -math.pi / 2])


def test_pose_is_that_of_urdf() -> None:
    pose = transform(x=1.0, y=2.0, z=3.0, roll=0.3, pitch=-0.7, yaw=2.0)
    assert pose[:3, :3] == pytest.approx(Rotation.from_euler("xyz", [0.3, -0.7, 2.0]).as_matrix(), abs=1e-15)
    assert pose[:, 3].tolist() == [1, 2, 3, 1]
    assert apply(transform(yaw=math.pi / 2), [[1, 0, 0]]) == pytest.approx(np.array([[0, 1, 0]]))


def test_viewpoint_then_convention_then_pose() -> None:
    half = math.sqrt(0.5)
    cloud = Cloud(POINTS, viewpoint=np.array([10.0, 0.0, 0.0]), orientation=np.array([half, 0.0, 0.0, half]))
    # The sensor is turned by 90 degrees about z: its x axis is the other frame's y axis.
    point = [[1.0, 0.0, 0.0]]
    seen = transform(cloud, use_viewpoint=True)
    assert apply(seen, point) == pytest.approx(np.array([[10.0, 1.0, 0.0]]))
    ros = transform(cloud, use_viewpoint=True, convention="optical-to-ros")
    assert apply(ros, point) == pytest.approx(np.array([[0.0, -10.0, -1.0]]))
    all_of_it = transform(cloud, use_viewpoint=True, convention="optical-to-ros", z=5.0, yaw=math.pi)
    assert apply(all_of_it, point) == pytest.approx(np.array([[0.0, 10.0, 4.0]]))
    assert np.linalg.det(all_of_it[:3, :3]) == pytest.approx(1.0)


def test_viewpoint_is_in_the_units_of_the_cloud() -> None:
    cloud = Cloud(POINTS, viewpoint=np.array([1000.0, 0.0, 0.0]), orientation=np.array([2.0, 0.0, 0.0, 0.0]))
    pose = transform(cloud, 1e-3, use_viewpoint=True, x=0.5)
    assert pose == pytest.approx(np.array([[1, 0, 0, 1.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))


@pytest.mark.parametrize(
    "cloud",
    [
        Cloud(POINTS),
        Cloud(POINTS, viewpoint=np.full(3, np.nan)),
        Cloud(POINTS, viewpoint=np.zeros(3), orientation=np.zeros(4)),
        Cloud(POINTS, viewpoint=np.zeros(3), orientation=np.full(4, np.nan)),
    ],
)
def test_a_missing_viewpoint_is_refused(cloud: Cloud) -> None:
    transform(cloud)
    with pytest.raises(ConfigError) as caught:
        transform(cloud, use_viewpoint=True)
    assert "frame.use_viewpoint" in caught.value.message
    assert caught.value.hint


def test_quaternions_go_round() -> None:
    for rotation in Rotation.random(50, random_state=1).as_matrix():
        assert from_quaternion(np.array(quaternion(rotation))) == pytest.approx(rotation, abs=1e-14)
    assert from_quaternion(np.array([0.0, 0.0, 0.0, 3.0])) == pytest.approx(np.diag([-1.0, -1.0, 1.0]))


POSES = {
    "shift": {"x": 1.0, "y": -2.0, "z": 0.25},
    "optical": {"convention": "optical-to-ros"},
    "all": {"convention": "optical-to-ros", "x": 0.3, "y": 4.0, "roll": 0.4, "pitch": -1.2, "yaw": 2.5},
}


@pytest.mark.parametrize("case", POSES)
def test_everything_moves_and_nothing_changes(here, case: str) -> None:
    there, pose = fit_in(**POSES[case]), transform(**POSES[case])
    assert there.frame.transform == pytest.approx(pose, abs=0)
    chain, moved = here.chain, there.chain
    assert moved.joints == pytest.approx(apply(pose, chain.joints), abs=1e-14)
    assert moved.transforms[:, :3, 3] == pytest.approx(apply(pose, chain.transforms[:, :3, 3]), abs=1e-14)
    assert moved.transforms[:, :3, 0] == pytest.approx(chain.transforms[:, :3, 0] @ pose[:3, :3].T, abs=1e-14)
    assert np.linalg.det(moved.transforms) == pytest.approx(np.ones(len(moved.lengths)))
    assert there.joints.positions.tolist() == there.segmentation.joints.positions.tolist() == moved.joints.tolist()
    assert len(there.segmentation.alternatives) == len(here.segmentation.alternatives)
    for a, b in zip(here.segmentation.alternatives, there.segmentation.alternatives, strict=True):
        assert b.joints.positions == pytest.approx(apply(pose, a.joints.positions), abs=1e-14)
    assert there.skeleton_points == pytest.approx(apply(pose, here.skeleton_points), abs=1e-14)
    s = np.linspace(0, 1, 50)
    assert there.skeleton(s) == pytest.approx(apply(pose, here.skeleton(s)), abs=1e-13)
    assert there.skeleton(s, 1) == pytest.approx(here.skeleton(s, 1) @ pose[:3, :3].T, abs=1e-12)
    for a, b in zip(here.intermediates, there.intermediates, strict=True):
        assert b.points == pytest.approx(apply(pose, a.points), abs=1e-14)
    normals = [
        np.stack([made.intermediates[0].columns[f"n{axis}"] for axis in "xyz"], axis=1) for made in (here, there)
    ]
    assert normals[1] == pytest.approx(normals[0] @ pose[:3, :3].T, abs=1e-14)
    # The same chain, bit by bit, where no place is concerned.
    assert np.array_equal(there.chain.lengths, here.chain.lengths)
    assert np.array_equal(there.chain.s, here.chain.s)
    assert there.max_deviation == here.max_deviation
    assert there.mdtw.mean == here.mdtw.mean
    assert there.residual == here.residual


def test_twist_begins_anew_with_z_up(here) -> None:
    there = fit_in(convention="optical-to-ros")
    x, z = there.chain.transforms[0, :3, 0], there.chain.transforms[0, :3, 2]
    up = np.array([0.0, 0.0, 1.0])
    expected = up - (up @ x) * x
    assert z == pytest.approx(expected / np.linalg.norm(expected), abs=1e-9)
    # As a chain that was made in that frame.
    direct = build_chain(there.joints, 0.015)
    assert direct.transforms == pytest.approx(there.chain.transforms, abs=1e-12)


def test_there_and_back(here) -> None:
    pose = transform(**POSES["all"])
    there = in_frame(here, Frame("camera", pose), np.zeros(3))
    back = in_frame(there, Frame("cloud", np.linalg.inv(pose)), np.zeros(3))
    assert back.chain.joints == pytest.approx(here.chain.joints, abs=1e-14)
    assert back.chain.transforms == pytest.approx(here.chain.transforms, abs=1e-12)
    assert back.skeleton.weights == pytest.approx(here.skeleton.weights, abs=1e-12)
    assert back.skeleton.offset == pytest.approx(here.skeleton.offset, abs=1e-14)


def test_findings_move(here) -> None:
    from dataclasses import replace

    marked = replace(here, quality=Quality((Finding("gap", "x", position=(0.2, 0.1, 1.0)), Finding("radius", "y"))))
    moved = in_frame(marked, output_frame(FrameSettings(convention="optical-to-ros"), Cloud(POINTS)), np.zeros(3))
    assert moved.quality.findings[0].position == (1.0, -0.2, -0.1)
    assert moved.quality.findings[1].position is None


def test_far_away_shapes_keep_their_digits(here) -> None:
    offset = np.array([5e6, -4e6, 300.0])
    far = dlogen.fit(CLOUD + offset, {**OPTIONS, "frame": {"convention": "optical-to-ros"}})
    moved = fit_in(convention="optical-to-ros")
    assert far.chain.joints == pytest.approx(moved.chain.joints + OPTICAL_TO_ROS @ offset, rel=0, abs=1e-5)
    assert far.skeleton.weights == pytest.approx(moved.skeleton.weights, abs=1e-5)


def test_the_sensor_of_points_in_its_own_frame_is_at_their_origin() -> None:
    # A half tube seen from the origin of its frame; the file says that the sensor was somewhere else in the world.
    line = random_centre_line(3, dimensions=2, clearance=0.08)
    half = sample_tube(line, 0.015, 1500, 3, side=(0.0, 0.0, -1.0)).points + np.array([0.0, 0.0, 3.0])
    options = {**OPTIONS, "normals": {"orientation": "viewpoint"}}
    true = dlogen.fit(Cloud(half, viewpoint=np.zeros(3)), options)
    turned = np.array([0.0, 1.0, 0.0, 0.0])
    cloud = Cloud(half, viewpoint=np.array([0.0, 0.0, 6.0]), orientation=turned)
    used = dlogen.fit(cloud, {**options, "frame": {"use_viewpoint": True}})
    pose = transform(cloud, use_viewpoint=True)
    assert used.chain.joints == pytest.approx(apply(pose, true.chain.joints), abs=1e-14)


@pytest.mark.parametrize("suffix", [".pcd", ".ply"])
def test_files_keep_the_sensors_pose(tmp_path: Path, suffix: str) -> None:
    pose = [1.0, -2.0, 0.5, *quaternion(Rotation.from_euler("xyz", [0.3, -0.7, 2.0]).as_matrix())]
    path = tmp_path / f"cloud{suffix}"
    write_cloud(path, CLOUD, viewpoint=pose)
    cloud = read_cloud(path)
    assert cloud.viewpoint.tolist() == pose[:3]
    assert cloud.orientation == pytest.approx(pose[3:], abs=1e-15)
    write_cloud(path, cloud)
    assert read_cloud(path).orientation == pytest.approx(pose[3:], abs=1e-15)
    expected = Rotation.from_euler("xyz", [0.3, -0.7, 2.0]).as_matrix()
    assert transform(cloud, use_viewpoint=True)[:3, :3] == pytest.approx(expected, abs=1e-14)


def run(*arguments: object):
    return CliRunner().invoke(cli, ["fit", *map(str, arguments)])


def test_flag_of_the_command_line(tmp_path: Path) -> None:
    write_cloud(tmp_path / "cloud.pcd", CLOUD, viewpoint=[1, 2, 3, 1, 0, 0, 0])
    base = [tmp_path / "cloud.pcd", "--profile", "paper", "--set", "r=0.015", "-q", "--format", "all"]
    assert run(*base, "-o", tmp_path / "a").exit_code == 0
    result = run(*base, "-o", tmp_path / "b", "--frame", "optical-to-ros", "--set", "frame.name=camera_link")
    assert result.exit_code == 0, result.stderr
    a, b = (json.loads((tmp_path / folder / "cloud.json").read_text()) for folder in "ab")
    assert (a["frame"], b["frame"]) == ("cloud", "camera_link")
    assert b["joints"] == pytest.approx(np.array(a["joints"]) @ OPTICAL_TO_ROS.T, abs=1e-14)
    for folder, root in (("a", "base_link"), ("b", "camera_link")):
        urdf = ElementTree.parse(tmp_path / folder / "cloud.urdf")
        assert urdf.find("link").get("name") == urdf.find("joint[@name='base_joint']/parent").get("link") == root
        assert root in (tmp_path / folder / "cloud_description" / "rviz" / "display.rviz").read_text()
    # The flag wins over --set, and none undoes what a file says.
    arguments = ["--set", "frame.convention=optical-to-ros", "--frame", "none", "-o", tmp_path / "c"]
    assert run(*base, *arguments).exit_code == 0
    assert json.loads((tmp_path / "c" / "cloud.json").read_text())["joints"] == a["joints"]
    seen = run(*base, "--set", "frame.use_viewpoint=true", "-o", tmp_path / "d")
    assert seen.exit_code == 0, seen.stderr
    d = json.loads((tmp_path / "d" / "cloud.json").read_text())
    assert d["joints"] == pytest.approx(np.array(a["joints"]) + np.array([1.0, 2.0, 3.0]), abs=1e-14)
    assert np.array(d["frame_transform"])[:3, 3].tolist() == [1, 2, 3]


def test_a_folder_of_outputs_is_refused_file_by_file(tmp_path: Path) -> None:
    write_cloud(tmp_path / "cloud.ply", CLOUD)
    base = [tmp_path / "cloud.ply", "--profile", "paper", "--set", "r=0.015", "-o", tmp_path, "--format", "ros2"]
    (tmp_path / "cloud_description" / "urdf").mkdir(parents=True)
    (tmp_path / "cloud_description" / "notes.txt").write_text("mine")
    first = run(*base)
    assert first.exit_code == 0, first.stderr  # a folder is no reason: nothing in it would be overwritten
    assert "cloud_description" in first.stderr
    (tmp_path / "cloud.report.json").unlink()
    again = run(*base)
    assert again.exit_code == 2
    assert "cloud_description" in again.stderr and "--force" in again.stderr
    assert run(*base, "--force").exit_code == 0
    assert (tmp_path / "cloud_description" / "notes.txt").read_text() == "mine"
    assert not list(tmp_path.rglob(".dlogen-*"))


@pytest.mark.parametrize(
    "name", ["tip", "tip_joint", "segment_01", "joint_01_y_link", "base_joint", "/map", "a b", "1st"]
)
def test_names_that_cannot_be_frames(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Config.from_dict({"frame": {"name": name}})
    assert "frame.name" in str(caught.value)


@pytest.mark.parametrize("name", ["world", "camera_link", "base", "robot1/base_link", "auto", "tip_link"])
def test_names_that_can(name: str) -> None:
    assert Config.from_dict({"frame": {"name": name}}).frame.name == name


def test_angles_and_lengths_are_numbers() -> None:
    with pytest.raises(ConfigError):
        Config.from_dict({"frame": {"roll": "90deg"}})
    with pytest.raises(ConfigError) as caught:
        Config.from_dict({"frame": {"xyz": [1, 2, 3]}})
    assert "frame.x" in str(caught.value)


def test_world_is_the_world_of_sdf() -> None:
    # SDFormat reserves the name: a frame must not be called so again.
    text = {name: model_format("sdf").write(fit_in(name=name), "x")["x.sdf"].decode() for name in ("world", "base")}
    assert '<frame name="base">' in text["base"]
    assert '<frame name="world">' not in text["world"]
