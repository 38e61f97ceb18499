"""`dlogen sequence` on clouds: a hose that is swung round, seen from one side with noise, with five spoilt captures."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner, Result
from moving import LENGTH, RADIUS, hose, line

from dlogen.cli.main import cli
from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import read_cloud, write_cloud
from dlogen.sequence.rigid_links import Shape, fit_links

Array = np.ndarray

CAPTURES, RATE = 60, 30.0
SPOILT = {9: "length", 17: "failed", 28: "motion", 38: "failed", 46: "doubtful"}
NOISE, SIDE = 0.001, (0.3, 0.2, -1.0)


def truth() -> list[CentreLine]:
    """The hose of `moving`, turned by half a turn meanwhile: single fits change their direction."""
    angles, middle = hose(1)
    lines = []
    for k in range(CAPTURES):
        t = k / RATE
        c, s = np.cos(1.6 * t), np.sin(1.6 * t)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        lines.append(line(angles, t, middle(t)).moved(turn, np.array([0.5, 0.0, 1.0])))
    return lines


@pytest.fixture(scope="module")
def lines() -> list[CentreLine]:
    return truth()


@pytest.fixture(scope="module")
def recording(lines, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    rng = np.random.default_rng(5)
    for k, true in enumerate(lines):
        gaps = [(0.5, 1.0)] if k == 9 else []
        points = sample_tube(true, RADIUS, 1500, k, noise=NOISE, side=SIDE, gaps=gaps).points
        if k == 17:  # a ball
            directions = rng.normal(size=points.shape)
            points = true(0.5) + 0.15 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        points = points + np.array([0.3, 0.0, 0.0]) if k == 28 else points
        points = points + rng.normal(scale=0.008, size=points.shape) if k == 46 else points
        write_cloud(folder / f"hose_{k + 1}.ply", points)
        if k == 38:
            (folder / f"hose_{k + 1}.ply").write_bytes(b"")
    return folder


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["sequence", *map(str, arguments)])


@pytest.fixture(scope="module")
def done(recording, tmp_path_factory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("out") / "motion"
    result = run(recording, "-o", out, "--rate", RATE, "--jobs", 2, "--set", "material.preset=vacuum-hose", "--plot")
    assert result.exit_code == 0, result.stderr
    return out, result


@pytest.fixture(scope="module")
def report(done) -> dict:
    return json.loads((done[0] / "sequence.json").read_text())


@pytest.fixture(scope="module")
def arrays(done) -> dict[str, Array]:
    return dict(np.load(done[0] / "trajectory.npz"))


def test_spoilt_captures_are_named(done, report) -> None:
    captures = report["frames"]
    assert [item["name"] for item in captures] == [f"hose_{k + 1}" for k in range(CAPTURES)]
    assert {k: item["reason"]["code"] for k, item in enumerate(captures) if item["reason"]} == SPOILT
    assert [item["state"] for item in captures] == ["interpolated" if k in SPOILT else "good" for k in range(CAPTURES)]
    assert report["states"] == {"good": 55, "interpolated": 5, "held": 0, "none": 0}
    for k in SPOILT:
        assert f"hose_{k + 1} is interpolated" in done[1].stderr
    assert "60 frames, 55 good" in done[1].stderr and done[1].stdout == ""


def test_the_model_is_the_object(report) -> None:
    common = report["common"]
    assert common["length"] == pytest.approx(LENGTH, abs=0.002)
    assert common["radius"] == pytest.approx(RADIUS, rel=0.01)
    assert common["max_deviation"] <= common["e_max"] == pytest.approx(common["radius"] / 2)
    assert common["segment_count"] * common["segment_length"] == pytest.approx(common["length"])
    assert report["schema"] == "dlogen.sequence/1"
    assert report["model"]["material"]["name"] == "vacuum hose"
    assert report["model"]["base"] == "floating" and report["model"]["zero"] == "straight"


def test_joints_are_where_the_object_is_and_no_capture_is_flipped(report, arrays, lines) -> None:
    assert 5 < sum(item["reversed"] for item in report["frames"]) < 55, "single fits come out both ways"
    joints = arrays["joint_positions"]
    true = np.array([item.points(1000) for item in lines])
    if np.linalg.norm(joints[0, 0] - true[0, 0]) > np.linalg.norm(joints[0, 0] - true[0, -1]):
        true = true[:, ::-1]
    links = np.full(joints.shape[1] - 1, LENGTH / (joints.shape[1] - 1))
    ideal = fit_links(Shape(true, np.full(CAPTURES, LENGTH), LENGTH, np.zeros(CAPTURES)), links)
    error = np.linalg.norm(joints - ideal, axis=2)
    good = arrays["state"] == "good"
    # Single captures: 0.65 mm on average, 3 mm at worst, where the ends are.
    assert error[good].mean() < 0.0008 and error[good].max() < 0.003
    assert error[~good].max() < 0.003


def test_keyframes_replay_in_mujoco(done, arrays) -> None:
    model = mujoco.MjModel.from_xml_path(str(done[0] / "model.xml"))
    data = mujoco.MjData(model)
    assert model.nkey == CAPTURES + 2
    for k in range(CAPTURES):
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_kinematics(model, data)
        assert model.key(k).name == f"hose_{k + 1}" and data.time == pytest.approx(k / RATE)
        joints = np.vstack([data.xpos[1:], data.site("tip").xpos])
        assert joints == pytest.approx(arrays["joint_positions"][k], abs=1e-6)


@pytest.mark.oracle
def test_urdf_and_trajectory_in_pinocchio(done, arrays) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    robot = pinocchio.buildModelFromUrdf(str(done[0] / "model.urdf"))
    data = robot.createData()
    with (done[0] / "trajectory.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = [name for name in rows[0] if name.startswith("joint_")]
    assert names == list(robot.names)[2:]
    places = [f"segment_{i + 1:02d}" for i in range(arrays["joint_positions"].shape[1] - 1)] + ["tip"]
    for row, expected in zip(rows, arrays["joint_positions"], strict=True):
        q = np.array([float(row[name]) for name in ("x", "y", "z", "qx", "qy", "qz", "qw", *names)])
        pinocchio.framesForwardKinematics(robot, data, q)
        joints = [data.oMf[robot.getFrameId(name)].translation for name in places]
        assert np.array(joints) == pytest.approx(expected, abs=1e-6)
        assert np.all(robot.lowerPositionLimit[7:] <= q[7:]) and np.all(q[7:] <= robot.upperPositionLimit[7:])


@pytest.mark.oracle
def test_urdf_and_trajectory_in_yourdfpy(done, arrays) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    robot = yourdfpy.URDF.load(str(done[0] / "model.urdf"), load_meshes=False, build_scene_graph=True)
    count = arrays["joint_positions"].shape[1] - 1
    for k in (0, 28, 59):
        robot.update_cfg(dict(zip(arrays["joint_names"].tolist(), arrays["joint_values"][k], strict=True)))
        w, x, y, z = arrays["base_quaternion"][k]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        for i in range(count):
            place = robot.get_transform(f"segment_{i + 1:02d}", "segment_01")[:3, 3]
            there = turn @ place + arrays["base_position"][k]
            assert there == pytest.approx(arrays["joint_positions"][k, i], abs=1e-6)


def test_again_nothing_is_fitted_and_the_files_are_the_same(done, recording) -> None:
    out = done[0]
    names = ("model.urdf", "model.xml", "trajectory.csv", "trajectory.npz", "sequence.json")
    before = {name: (out / name).read_bytes() for name in names}
    fitted = {path.name: path.stat().st_mtime_ns for path in (out / "frames").glob("*.json") if path.stem[:4] == "hose"}
    result = run(recording, "-o", out, "--rate", RATE, "--set", "material.preset=vacuum-hose", "--json", "-q")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["states"]["good"] == 55
    assert {name: (out / name).read_bytes() for name in names} == before
    assert {name: (out / "frames" / name).stat().st_mtime_ns for name in fitted} == fitted
    strict = run(recording, "-o", out, "--rate", RATE, "--set", "material.preset=vacuum-hose", "--strict", "-q")
    assert strict.exit_code == 1 and "5 of 60 frames are set aside" in strict.stderr


def test_other_options(done, recording) -> None:
    """On the fits that are there already."""
    out = done[0]
    fitted = {path: path.stat().st_mtime_ns for path in (out / "frames").glob("*.json") if path.stem[:4] == "hose"}
    settings = ("--set", "material.preset=rope", "--set", "e_max=0.004", "--set", "segmentation.criterion=fewest")
    result = run(recording, "-o", out, *settings, "--keep-doubtful", "--smooth", "--format", "sdf", "--json")
    assert result.exit_code == 0 and "one frame a second is assumed" in result.stderr
    said = json.loads(result.stdout)
    assert said["time"] == {"source": "numbers", "rate": None, "start": 0.0, "end": 59.0}
    # Without its verdict it still has the wrong noise or radius.
    assert said["frames"][46]["reason"]["code"] in ("noise", "radius", "length")
    assert said["common"]["max_deviation"] <= 0.004
    # Those of another model would pass for this one.
    assert {path.name for path in out.glob("model.*")} == {"model.sdf"} and not (out / "sequence.png").exists()
    run(recording, "-o", out, *settings, "--keep-doubtful", "--smooth", "--format", "srdf", "-q")
    assert {path.name for path in out.glob("model.*")} == {"model.sdf", "model.srdf"}
    # Settings of the model make no fit anew.
    assert {path: path.stat().st_mtime_ns for path in fitted} == fitted


def test_what_is_wrong_is_said_before_the_work(tmp_path, recording) -> None:
    capture = recording / "hose_1.ply"
    (tmp_path / "model.urdf").write_text("mine")
    result = run(capture, "-o", tmp_path)
    assert result.exit_code == 2 and "output exists" in result.stderr
    assert not (tmp_path / "frames").exists()

    listed = tmp_path / "frames.csv"
    listed.write_text(f"cloud,time\n{capture},1.0\n{recording / 'hose_2.ply'},1.0\n")
    result = run(f"@{listed}", "-o", tmp_path / "out")
    assert result.exit_code == 2 and "same time" in result.stderr
    assert run(f"@{listed}", "-o", tmp_path / "out", "--rate", 5).exit_code == 2
    assert run(recording, "-o", tmp_path / "out", "--set", "e_max=-1").exit_code == 2
    assert run(recording, "-o", tmp_path / "out", "--format", "urdff").exit_code == 2
    assert run(tmp_path / "none", "-o", tmp_path / "out").exit_code == 2
    assert not (tmp_path / "out").exists()


def test_no_good_capture(tmp_path, recording) -> None:
    result = run(recording / "hose_39.ply", "-o", tmp_path / "out", "-j", 1)
    assert result.exit_code == 1
    assert "no frame can be believed" in result.stderr and "empty" in result.stderr
    assert not (tmp_path / "out" / "model.urdf").exists()


def test_times_of_a_list_and_a_fixed_base_that_moves(tmp_path, recording) -> None:
    listed = tmp_path / "frames.csv"
    rows = [f"{recording / f'hose_{k}.ply'},{time}" for k, time in ((3, 0.25), (2, 0.125), (1, 0.0))]
    listed.write_text("\n".join(["cloud,time", *rows]) + "\n")
    config = tmp_path / "config.yaml"
    config.write_text("joints: {base: fixed, zero: scan, dof: 3}\nsegmentation: {segments: 6}\n")
    result = run(f"@{listed}", "-o", tmp_path / "out", "-c", config, "-j", 2, "--json")
    assert result.exit_code == 0, result.stderr
    assert "joints.base = fixed is not used" in result.stderr
    said = json.loads(result.stdout)
    assert [item["time"] for item in said["frames"]] == [0.0, 0.125, 0.25]
    assert said["time"]["source"] == "list"
    assert said["common"]["segment_count"] == 6 and said["common"]["criterion"] == "segments"
    assert said["model"]["dof"] == 3 and said["model"]["zero"] == "scan"

    result = run(f"@{listed}", "-o", tmp_path / "out", "--set", "joints.min_bend_radius=1.0", "-q")
    assert result.exit_code == 2 and "but hose_" in result.stderr and "is bent to" in result.stderr


def test_a_cut_and_captures_in_a_row_take_one_line(tmp_path, recording) -> None:
    """The second part of the recording shows the object elsewhere."""
    moved = tmp_path / "recording"
    moved.mkdir()
    for k in range(20):
        if k in (8, 18):
            (moved / f"{k}.ply").write_bytes(b"")
        else:
            points = read_cloud(recording / f"hose_{k + 21}.ply").points
            write_cloud(moved / f"{k}.ply", points + np.array([3.0 * (k >= 12), 0.0, 0.0]))
    out = tmp_path / "out"
    result = run(moved, "-o", out, "--rate", RATE, "-j", 2)
    assert result.exit_code == 0, result.stderr
    said = json.loads((out / "sequence.json").read_text())
    assert [item["reason"]["code"] for item in said["frames"][12:]] == [*["motion"] * 6, "failed", "motion"]
    assert "12 to 17 are held, 6 frames: such as 12: " in result.stderr and result.stderr.count("[motion]") == 2
    assert "if the recording has a cut" in result.stderr
    assert said["doubts"] == []


def test_doubts_are_told_and_strict(tmp_path, recording) -> None:
    """Two captures that are too far apart to tell which end is which."""
    for name, turn in (("a_1", 0.0), ("a_2", 1.6)):
        c, s = np.cos(turn), np.sin(turn)
        points = read_cloud(recording / "hose_1.ply").points
        points = (points - points.mean(axis=0)) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        write_cloud(tmp_path / f"{name}.ply", points)
    call = (tmp_path / "a_1.ply", tmp_path / "a_2.ply", "-o", tmp_path / "out", "--rate", 1, "-j", 1)
    result = run(*call)
    assert result.exit_code == 0
    assert "which end is first may be wrong from a_2 on" in result.stderr and "2 frames, 2 good" in result.stderr
    doubts = json.loads((tmp_path / "out" / "sequence.json").read_text())["doubts"]
    assert [(item["code"], item["frame"]) for item in doubts] == [("direction", "a_2")]
    strict = run(*call, "--strict")
    assert strict.exit_code == 1 and "the motion is in doubt" in strict.stderr
