"""`dlogen extract` from the outside."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dlogen.cli.main import cli
from dlogen.evaluation.camera import KINECT_V1, Capture, capture
from dlogen.evaluation.shapes import hose_centre_line
from dlogen.io.cloud_files import read_raw, write_cloud
from dlogen.stages.extract import extract


def run(*arguments: object, stdin: bytes | None = None) -> Result:
    return CliRunner().invoke(cli, ["extract", *map(str, arguments)], input=stdin)


@pytest.fixture(scope="module")
def seen() -> Capture:
    small = replace(KINECT_V1, width=320, height=240, focal=292.5)
    return capture(hose_centre_line(), 0.02, np.random.default_rng(1), small)


@pytest.fixture(scope="module")
def files(seen: Capture, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("scene")
    write_cloud(folder / "scene.pcd", seen.scene)
    write_cloud(folder / "table.pcd", seen.background)
    return folder / "scene.pcd", folder / "table.pcd"


def test_writes_the_object(seen: Capture, files: tuple[Path, Path], tmp_path: Path) -> None:
    result = run(files[0], "--background", files[1], "-o", tmp_path / "c.ply")
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    cloud = read_raw(tmp_path / "c.ply")
    assert cloud.points.shape == (5000, 3) and not cloud.organised
    np.testing.assert_array_equal(cloud.points, extract(seen.scene, seen.background).points)
    assert cloud.viewpoint is not None and cloud.viewpoint[:3].tolist() == [0, 0, 0]
    finite = int(np.isfinite(seen.scene.points).all(axis=1).sum())
    assert f"76800 points, {finite} of them seen" in result.stderr and "kept 5000" in result.stderr
    assert np.percentile(np.abs(seen.line.nearest(cloud.points)[1] - 0.02), 95) < 3e-3


def test_options(seen: Capture, files: tuple[Path, Path], tmp_path: Path) -> None:
    result = run(
        files[0], "--background", files[1], "-o", tmp_path / "c.pcd", "-M", "all", "--threshold", 0.02, "--json", "-q",
        "--encoding", "ascii",
    )  # fmt: skip
    assert result.exit_code == 0 and result.stderr == ""
    whole = extract(seen.scene, seen.background, threshold=0.02, count=None)
    said = json.loads(result.stdout)
    assert said == {
        "schema": "dlogen.extract/1",
        "cloud": str(tmp_path / "c.pcd"),
        "scene_points": 76800,
        "seen_points": int(np.isfinite(seen.scene.points).all(axis=1).sum()),
        "object_points": len(whole),
        "points": len(whole),
        "threshold": 0.02,
        "seed": 0,
    }
    cloud = read_raw(tmp_path / "c.pcd")
    assert cloud.encoding == "ascii"
    np.testing.assert_array_equal(cloud.points, whole.points)


def test_the_threshold_is_in_metres_whatever_the_clouds_are_in(
    seen: Capture, files: tuple[Path, Path], tmp_path: Path
) -> None:
    for name, cloud in (("scene", seen.scene), ("table", seen.background)):
        write_cloud(tmp_path / f"{name}.ply", replace(cloud, points=1e3 * cloud.points))
    arguments = ["--threshold", 0.0205, "-M", "all"]
    in_mm = run(
        tmp_path / "scene.ply", "--background", tmp_path / "table.ply", *arguments, "--units", "mm",
        "-o", tmp_path / "mm.ply",
    )  # fmt: skip
    assert in_mm.exit_code == 0, in_mm.stderr
    assert run(files[0], "--background", files[1], *arguments, "-o", tmp_path / "m.ply").exit_code == 0
    np.testing.assert_allclose(read_raw(tmp_path / "mm.ply").points, 1e3 * read_raw(tmp_path / "m.ply").points)


def test_pipes_and_seeds(files: tuple[Path, Path], tmp_path: Path) -> None:
    scene, table = files
    result = run("-", "--background", table, "-o", "-", "--seed", 7, "-M", 300, stdin=scene.read_bytes())
    assert result.exit_code == 0, result.stderr
    for name, seed in (("a.ply", 7), ("b.ply", 8)):
        assert run(scene, "--background", table, "-o", tmp_path / name, "--seed", seed, "-M", 300).exit_code == 0
    assert result.stdout_bytes == (tmp_path / "a.ply").read_bytes() != (tmp_path / "b.ply").read_bytes()


def test_existing_output_is_refused_without_force(files: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "c.ply").write_text("mine")
    arguments = [files[0], "--background", files[1], "-o", tmp_path / "c.ply"]
    refused = run(*arguments)
    assert refused.exit_code == 2 and "--force" in refused.stderr
    assert (tmp_path / "c.ply").read_text() == "mine"
    assert run(*arguments, "--force").exit_code == 0
    assert len(read_raw(tmp_path / "c.ply").points) == 5000


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["SCENE"], 2, "--background"),
        (["SCENE", "--background", "nowhere.pcd"], 2, "nowhere.pcd"),
        (["nowhere.pcd", "--background", "TABLE"], 2, "nowhere.pcd"),
        (["-", "--background", "-"], 2, "stdin"),
        (["SCENE", "--background", "TABLE", "--threshold", "much"], 2, "auto"),
        (["SCENE", "--background", "TABLE", "--threshold", "0"], 2, "auto"),
        (["SCENE", "--background", "TABLE", "--threshold", "nan"], 2, "auto"),
        (["SCENE", "--background", "TABLE", "-M", "0"], 2, "all"),
        (["SCENE", "--background", "TABLE", "-M", "many"], 2, "all"),
        (["SCENE", "--background", "TABLE", "--encoding", "zip"], 2, "binary_little_endian"),
        (["SCENE", "--background", "SCENE"], 1, "nothing differs"),
        (["SCENE", "--background", "TABLE", "--threshold", "0.5"], 1, "--threshold"),
    ],
)
def test_bad_calls_give_one_message_and_no_files(
    files: tuple[Path, Path], tmp_path: Path, arguments: list[str], code: int, words: str
) -> None:
    paths = {"SCENE": str(files[0]), "TABLE": str(files[1])}
    result = run(*(paths.get(word, word) for word in arguments), "-o", tmp_path / "out" / "c.ply")
    assert result.exit_code == code, result.stderr
    assert words in result.stderr
    assert "Traceback" not in result.stderr and "internal error" not in result.stderr and result.stdout == ""
    assert not (tmp_path / "out").exists()


def test_bad_outputs(files: tuple[Path, Path], tmp_path: Path) -> None:
    arguments = [files[0], "--background", files[1]]
    assert ".stl" in run(*arguments, "-o", tmp_path / "c.stl").stderr
    both = run(*arguments, "-o", "-", "--json")
    assert both.exit_code == 2 and both.stdout == ""
    assert not list(tmp_path.iterdir())
