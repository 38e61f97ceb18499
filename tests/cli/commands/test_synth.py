"""`dlogen synth` from the outside: files, truth, refusals; the sample clouds are what their README says."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from places import SAMPLES

from dlogen.cli.commands.synth import SHAPES
from dlogen.cli.main import cli
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import TABLE_I, centre_line
from dlogen.io.cloud_files import read_cloud, read_raw
from dlogen.io.curves.curve import load_curve


def run(*arguments: object, stdin: bytes | None = None) -> Result:
    return CliRunner().invoke(cli, ["synth", *map(str, arguments)], input=stdin)


def made(folder: Path, *arguments: object, name: str = "c.ply") -> tuple[np.ndarray, CentreLine, dict[str, Any]]:
    """The points, the line through the truth's points, and the truth."""
    result = run(*arguments, "-o", folder / name)
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    truth = json.loads((folder / name).with_suffix(".truth.json").read_text())
    return read_raw(folder / name).points, from_points(truth["points"]), truth


@pytest.mark.parametrize("shape", SHAPES)
def test_points_lie_around_the_written_truth(tmp_path: Path, shape: str) -> None:
    points, line, truth = made(tmp_path, shape, "-M", 500)
    assert points.shape == (500, 3)
    assert (truth["schema"], truth["units"], truth["curve"]) == ("dlogen.truth/1", "m", shape)
    assert (truth["radius"], truth["seed"], truth["settings"]["points"]) == (0.02, 0, 500)
    assert line.length == pytest.approx(truth["length"], rel=1e-4)
    if shape != "helical-printed":
        assert np.median(np.abs(line.nearest(points)[1] - 0.02)) < 1e-6
    assert load_curve(tmp_path / "c.truth.json").length == pytest.approx(truth["length"], rel=1e-3)


def test_the_shapes_of_table_1_are_known() -> None:
    assert set(TABLE_I) <= set(SHAPES)


def test_the_truth_of_bent_is_the_papers_formula(tmp_path: Path) -> None:
    _, _, truth = made(tmp_path, "bent", "-M", 10)
    np.testing.assert_allclose(truth["points"], centre_line("bent").points(1000), atol=1e-9)


def test_options_do_what_they_say(tmp_path: Path) -> None:
    points, line, truth = made(
        tmp_path, "straight", "--diameter", 0.1, "-M", 2000, "--gap", "0.1:0.3", "--gap", "0.8:0.9",
        "--side", "0,-1,-1", "--density-ratio", 5, "--caps", "--seed", 5,
    )  # fmt: skip
    s, distance = line.nearest(points)
    assert distance.max() == pytest.approx(0.05, abs=1e-6)
    assert not ((s > 0.101) & (s < 0.299)).any() and not ((s > 0.801) & (s < 0.899)).any()
    assert (s > 0.9).sum() > 2 * (s < 0.1).sum()
    mantle = (s > 1e-6) & (s < 1 - 1e-6)
    assert ((points - line(s))[mantle] @ [0, -1, -1] < 1e-6).all()
    assert (distance < 0.049).any(), "points on the caps"
    expected = {
        "diameter": 0.1,
        "gaps": [[0.1, 0.3], [0.8, 0.9]],
        "side": [0, -1, -1],
        "density_ratio": 5,
        "caps": True,
    }
    assert truth["settings"].items() >= expected.items()
    assert truth["seed"] == 5


def test_noise_and_strays(tmp_path: Path) -> None:
    points, line, _ = made(tmp_path, "bent", "-M", 2000, "--noise", 0.002, "--stray", 0.1)
    _, distance = line.nearest(points)
    far = np.abs(distance - 0.02) > 0.012
    assert far.mean() == pytest.approx(0.1, abs=0.01)
    assert np.std(distance[~far] - 0.02) == pytest.approx(0.002, rel=0.1)


@pytest.mark.parametrize(("units", "scale"), [("m", 1), ("cm", 100), ("mm", 1000)])
def test_units_and_offset(tmp_path: Path, units: str, scale: float) -> None:
    offset = np.array([512_345.0, 5_412_345.0, 120.0])
    points, line, truth = made(
        tmp_path, "bent", "-M", 200, "--units", units, "--offset", ",".join(map(str, offset)), name="c.pcd"
    )
    assert truth["settings"]["units"] == units and truth["settings"]["offset"] == offset.tolist()
    near, there = points / scale - offset, line.moved(np.eye(3), -offset)
    np.testing.assert_allclose(there.nearest(near)[1], 0.02, atol=1e-6)
    plain, _, _ = made(tmp_path, "bent", "-M", 200, name="plain.ply")
    np.testing.assert_allclose(near, plain, atol=2e-7)


def test_sizes_of_shapes(tmp_path: Path) -> None:
    for shape, options in SHAPES.items():
        if "length" in options:
            _, _, truth = made(tmp_path, shape, "-M", 10, "--length", 2.0, name=f"{shape}.ply")
            assert truth["length"] == pytest.approx(2.0, abs=1e-9)
        if "bend_radius" in options:
            _, line, _ = made(tmp_path, shape, "-M", 10, "--bend-radius", 0.17, name=f"{shape}_bend.ply")
            assert 1 / line.max_curvature() > 0.169
    _, line, truth = made(tmp_path, "random", "-M", 10, "--length", 30, name="long.ply")
    assert 1 / line.max_curvature() > 2.0 and truth["length"] == pytest.approx(30)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_encodings_hold_the_same_points(tmp_path: Path, encoding: str) -> None:
    points, _, _ = made(tmp_path, "loop", "-M", 100, "--encoding", encoding)
    plain, _, _ = made(tmp_path, "loop", "-M", 100, name="plain.pcd")
    np.testing.assert_array_equal(points, plain)
    assert read_raw(tmp_path / "c.ply").encoding == encoding


def test_the_same_call_gives_the_same_bytes_and_another_seed_does_not(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        made(tmp_path, "random", "-M", 100, "--noise", 0.001, "--seed", seed, name=f"{name}.ply")
    for suffix in (".ply", ".truth.json"):
        a, b, c = ((tmp_path / name).with_suffix(suffix).read_bytes() for name in "abc")
        assert a == b != c


# A centre line from a file -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "separator"), [("", ","), ("x,y,z", ","), ("", " "), ("# x y z", " "), ("x;y;z", ";"), ("x\ty\tz", "\t")]
)
def test_centre_line_from_a_table(tmp_path: Path, header: str, separator: str) -> None:
    given = centre_line("helical").points(80)
    rows = [header] * bool(header) + [separator.join(map(repr, row)) for row in given.tolist()]
    (tmp_path / "axis.csv").write_text("\n".join(rows) + "\n")
    points, line, truth = made(tmp_path, "--centre-line", tmp_path / "axis.csv", "-M", 300)
    assert truth["curve"] == "axis"
    assert line.nearest(given)[1].max() < 1e-6
    np.testing.assert_allclose(line.nearest(points)[1], 0.02, atol=1e-6)
    from_stdin = run("--centre-line", "-", "-M", 300, "-o", tmp_path / "s.ply", stdin="\n".join(rows).encode())
    assert from_stdin.exit_code == 0, from_stdin.stderr
    np.testing.assert_array_equal(read_raw(tmp_path / "s.ply").points, points)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,z\n0,0,0\n\n1,one,1\n", "line 4"),
        ("0 0 0\n1 0\n", "line 2"),
        ("0,0,0\n1,0,0\n1,0,0\n", "point 3"),
        ("0,0,0\n1,nan,0\n", "not finite"),
        ("0,0,0\n", "1 point"),
        ("a,b,c\n0,0,0\n1,0,0\n", "no columns x, y and z"),
        ("", "empty"),
    ],
)
def test_bad_centre_lines(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "axis.csv").write_text(text)
    result = run("--centre-line", tmp_path / "axis.csv", "-o", tmp_path / "c.ply")
    assert result.exit_code == 2
    assert words in result.stderr and "axis.csv" in result.stderr and "hint:" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["axis.csv"]


# Files -------------------------------------------------------------------------------------------------------------


def test_json_says_what_was_made(tmp_path: Path) -> None:
    result = run("hose", "-o", tmp_path / "c.ply", "--json", "-q", "-M", 50)
    assert result.exit_code == 0 and result.stderr == ""
    said = json.loads(result.stdout)
    assert said["schema"] == "dlogen.synth/1"
    assert (said["cloud"], said["truth"]) == (str(tmp_path / "c.ply"), str(tmp_path / "c.truth.json"))
    assert (said["background"], said["points"], said["seed"]) == (None, 50, 0)
    assert said["min_bend_radius"] == pytest.approx(0.145, rel=1e-6)
    assert said["length"] == pytest.approx(1.7) and said["settings"]["diameter"] == 0.04


def test_to_stdout(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli, ["synth", "bent", "-o", "-", "-M", "100"])
    assert result.exit_code == 0
    (tmp_path / "piped.ply").write_bytes(result.stdout_bytes)
    points, _, _ = made(tmp_path, "bent", "-M", 100)
    np.testing.assert_array_equal(read_cloud(tmp_path / "piped.ply").points, points)


@pytest.mark.parametrize("existing", ["c.ply", "c.truth.json"])
def test_existing_outputs_are_refused_without_force(tmp_path: Path, existing: str) -> None:
    (tmp_path / existing).write_text("mine")
    refused = run("bent", "-o", tmp_path / "c.ply")
    assert refused.exit_code == 2 and "--force" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == [existing]
    assert (tmp_path / existing).read_text() == "mine"
    assert run("bent", "-o", tmp_path / "c.ply", "--force").exit_code == 0
    assert len(read_raw(tmp_path / "c.ply").points) == 5000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "helical-printed"),
        (["bnt"], "bnt"),
        (["bent", "--centre-line", "a.csv"], "--centre-line"),
        (["--centre-line", "nowhere.csv"], "nowhere.csv"),
        (["bent", "--length", 2], "--length"),
        (["loop", "--bend-radius", 0.2], "--bend-radius"),
        (["bent", "-M", 0], "--points"),
        (["bent", "--diameter", 0], "--diameter"),
        (["bent", "--diameter", "nan"], "--diameter"),
        (["bent", "--noise", -1], "--noise"),
        (["bent", "--noise", "inf"], "--noise"),
        (["bent", "--stray", 1], "--stray"),
        (["bent", "--density-ratio", 0], "--density-ratio"),
        (["bent", "--gap", "0.5"], "S0:S1"),
        (["bent", "--gap", "0.5:0.4"], "0.5:0.4"),
        (["bent", "--gap", "0:1"], "--gap"),
        (["bent", "--side", "1,2"], "X,Y,Z"),
        (["bent", "--side", "0,0,0"], "--side"),
        (["straight", "--side", "-0.3,1,0"], "along the object"),
        (["bent", "--offset", "1,2,nan"], "X,Y,Z"),
        (["bent", "--units", "inch"], "inch"),
        (["bent", "--encoding", "utf-8"], "binary_little_endian"),
        (["bent", "--seed", -1], "--seed"),
        (["hose", "--length", 0.3], "--length"),
        (["loop", "--length", 0.01], "--length"),
        (["coil", "--length", 0.05], "--length"),
        (["bent", "--distance", 1], "--camera"),
        (["bent", "--camera", "kinect-v9"], "kinect-v9"),
        (["bent", "--camera", "kinect-v2"], "does not see the whole object"),
        (["hose", "--camera", "kinect-v1", "--noise", 0.001, "-M", 100], "--noise"),
        (["hose", "--camera", "kinect-v1", "--distance", 0.6], "distance of 0.78 m"),
        (["bent", "--camera", "kinect-v1", "--diameter", 0.5, "--distance", 4], "too large"),
    ],
)
def test_bad_calls_give_one_message_and_no_files(tmp_path: Path, arguments: list[object], words: str) -> None:
    result = run(*arguments, "-o", tmp_path / "out" / "c.ply")
    assert result.exit_code == 2, result.stderr
    assert words in result.stderr
    assert "Traceback" not in result.stderr and "internal error" not in result.stderr and result.stdout == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("output", "words"), [("c.stl", ".stl"), ("cloud", "known:"), ("f.ply/c.ply", "cannot write")])
def test_bad_outputs(tmp_path: Path, output: str, words: str) -> None:
    (tmp_path / "f.ply").write_text("a file, not a folder")
    result = run("bent", "-o", tmp_path / output, "-M", 10)
    assert result.exit_code == 2, result.stderr
    assert words in result.stderr and "hint:" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["f.ply"]


def test_stdout_holds_one_thing_only() -> None:
    for more in (["--json"], ["--camera", "kinect-v1"]):
        result = run("hose", "-o", "-", *more)
        assert result.exit_code == 2 and result.stdout == "" and "-o" in result.stderr


def test_a_tube_that_cannot_be_is_made_with_a_warning(tmp_path: Path) -> None:
    result = run("helical-printed", "-o", tmp_path / "c.ply", "-M", 10)
    assert result.exit_code == 0
    assert re.search(r"warning: no such tube exists.* 3\.9\d mm", result.stderr)
    assert "warning" not in run("helical", "-o", tmp_path / "d.ply", "-M", 10).stderr


# The camera --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
def test_camera_writes_scene_background_and_truth_in_the_cameras_frame(tmp_path: Path, suffix: str) -> None:
    name = f"scene.{suffix}"
    arguments = ["straight", "--camera", "kinect-v1", "--distance", 1.5, "--diameter", 0.08]
    points, line, truth = made(tmp_path, *arguments, name=name)
    assert {path.name for path in tmp_path.iterdir()} == {name, f"scene.background.{suffix}", "scene.truth.json"}
    scene, background = read_raw(tmp_path / name), read_raw(tmp_path / f"scene.background.{suffix}")
    for cloud in (scene, background):
        assert cloud.organised and (cloud.width, cloud.height) == (640, 480)
        assert cloud.viewpoint is not None and cloud.viewpoint.tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert np.isnan(points).any() and np.isfinite(background.points).all()
    assert truth["settings"] == {"diameter": 0.08, "units": "m", "camera": "kinect-v1", "distance": 1.5}
    # The truth lies where the scene has its object.
    assert np.asarray(truth["points"])[:, 2] == pytest.approx(1.46)
    near = points[points[:, 2] < 1.46]
    assert np.abs(line.nearest(near[::20])[1] - 0.04).max() < 5 * 1.425e-3 * 1.5**2
    refused = run(*arguments, "-o", tmp_path / name)
    assert refused.exit_code == 2 and "--force" in refused.stderr


def test_camera_in_millimetres(tmp_path: Path) -> None:
    points, _, truth = made(tmp_path, "hose", "--camera", "kinect-v1", "--units", "mm", name="scene.pcd")
    assert np.nanmedian(points[:, 2]) == pytest.approx(800, abs=2)
    assert np.asarray(truth["points"])[:, 2] == pytest.approx(0.78)


ROPE = ["hose", "--length", 1, "--bend-radius", 0.08, "--diameter", 0.006]


def test_a_camera_with_a_mask_writes_the_object_alone(tmp_path: Path) -> None:
    arguments = [*ROPE, "--camera", "realsense-d435", "--mask-grow", 1, "--seed", 2]
    points, line, truth = made(tmp_path, *arguments, name="rope.pcd")
    assert {path.name for path in tmp_path.iterdir()} == {"rope.pcd", "rope.truth.json"}
    cloud = read_raw(tmp_path / "rope.pcd")
    assert not cloud.organised and np.isfinite(points).all()
    assert cloud.viewpoint is not None and cloud.viewpoint.tolist() == [0, 0, 0, 1, 0, 0, 0]
    camera = {"camera": "realsense-d435", "distance": 0.5, "mask_grow": 1.0}
    assert truth["settings"] == {"diameter": 0.006, "units": "m", **camera}
    assert 18_000 < len(points) < 30_000
    assert np.median(np.abs(line.nearest(points[::20])[1] - 0.003)) < 2e-3
    result = run(*arguments, "-o", "-")
    assert result.exit_code == 0 and result.stdout_bytes.startswith(b"ply")


def test_the_pose_of_the_camera_is_in_the_units_of_the_cloud(tmp_path: Path) -> None:
    arguments = [*ROPE, "--camera", "azure-kinect", "--world", "--voxel", 0.004, "--tilt", 20, "--units", "mm"]
    points, _, truth = made(tmp_path, *arguments, name="rope.pcd")
    cloud = read_raw(tmp_path / "rope.pcd")
    assert cloud.viewpoint is not None
    assert np.linalg.norm(cloud.viewpoint[:3]) == pytest.approx(800)
    assert cloud.viewpoint[2] == pytest.approx(800 * np.cos(np.radians(20)))
    assert abs(np.median(points[:, 2])) < 12
    assert np.asarray(truth["points"])[:, 2] == pytest.approx(0.003)


def test_a_tilted_scene_has_a_background(tmp_path: Path) -> None:
    made(tmp_path, *ROPE, "--camera", "kinect-v1", "--tilt", 15, "--frames", 2, "--holes", 0.1, name="s.ply")
    assert {path.name for path in tmp_path.iterdir()} == {"s.ply", "s.background.ply", "s.truth.json"}
    scene, background = read_raw(tmp_path / "s.ply"), read_raw(tmp_path / "s.background.ply")
    assert scene.organised and background.organised
    # The table is farther at the top of the image.
    depth = background.points[:, 2].reshape(480, 640)
    assert np.nanmedian(depth[20]) > np.nanmedian(depth[460]) + 0.1


# The sample clouds -------------------------------------------------------------------------------------------------


FILES = sorted(path.name for path in SAMPLES.iterdir() if path.suffix in (".ply", ".pcd", ".json"))


def sample_commands() -> list[list[str]]:
    block = re.search(r"```sh\n(.*?)```", (SAMPLES / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert block
    return [shlex.split(line) for line in block.group(1).splitlines()]


@pytest.fixture(scope="module")
def remade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the commands of the README were run."""
    folder = tmp_path_factory.mktemp("samples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for program, *arguments in sample_commands():
            if program == "rm":
                for name in arguments:
                    Path(name).unlink()
            else:
                assert program == "dlogen"
                result = CliRunner().invoke(cli, arguments)
                assert result.exit_code == 0, result.stderr
    return folder


def test_the_readme_of_the_samples_makes_all_of_them(remade: Path) -> None:
    assert {path.name for path in remade.iterdir()} == set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_sample_is_what_its_readme_says(remade: Path, name: str) -> None:
    assert (remade / name).read_bytes() == (SAMPLES / name).read_bytes()
    assert (SAMPLES / name).stat().st_size < 150_000
    if not name.endswith(".json"):
        assert (SAMPLES / name).with_suffix(".truth.json").exists()
        assert len(read_cloud(SAMPLES / name)) in (4000, 5000)
