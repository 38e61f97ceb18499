"""What a result writes: the files of `dlogen fit`, all of them or none."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from dlogen.cli.main import cli
from dlogen.errors import ConfigError, DlogenError, OutputError, UsageError
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import read_cloud, write_cloud
from dlogen.io.registry import model_formats
from dlogen.io.result import Result
from dlogen.pipeline import fit

#: Without the times, which are never the same.
CONFIG = {"e_max": 0.05, "report": {"timings": False}}


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cloud") / "hose.v2.ply"
    write_cloud(path, sample_tube(centre_line("bent"), 0.02, 1500, 5).points)
    return path


@pytest.fixture(scope="module")
def result(cloud: Path) -> Result:
    return fit(read_cloud(cloud), CONFIG)


def files_in(folder: Path) -> dict[str, bytes]:
    """All files below a folder, by their path in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_the_same_bytes_as_the_command_writes(profile: str, cloud: Path, tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    fit(read_cloud(cloud), {**CONFIG, "profile": profile}).write(ours, "all")
    call = ["fit", str(cloud), "-o", str(theirs), "--format", "all", "--profile", profile]
    call += ["--set", "e_max=0.05", "--set", "report.timings=false"]
    done = CliRunner().invoke(cli, call)
    assert done.exit_code == 0, done.stderr
    assert len(files_in(ours)) > len(model_formats())
    assert files_in(ours) == files_in(theirs)


def test_formats_are_names_or_one_text(result: Result, tmp_path: Path) -> None:
    expected = ["hose.v2.urdf", "hose.v2.xml", "hose.v2.report.json"]
    for number, formats in enumerate(("urdf,mjcf", ["urdf", "mjcf"], iter(("urdf", "mjcf")))):
        paths = result.write(tmp_path / str(number), formats)
        assert [path.name for path in paths] == expected
        assert sorted(files_in(tmp_path / str(number))) == sorted(expected)
        assert all(path.parent == tmp_path / str(number) for path in paths)
    assert [path.name for path in result.write(str(tmp_path / "default"))] == [
        "hose.v2.urdf",
        "hose.v2.json",
        "hose.v2.report.json",
    ]


def test_existing_files_stay_unless_forced(result: Result, tmp_path: Path) -> None:
    (tmp_path / "hose.v2.json").write_text("mine")
    with pytest.raises(UsageError, match=r"output exists: .*hose\.v2\.json \(use --force") as caught:
        result.write(tmp_path)
    assert caught.value.hint
    assert files_in(tmp_path) == {"hose.v2.json": b"mine"}
    result.write(tmp_path, force=True)
    assert files_in(tmp_path)["hose.v2.json"].startswith(b'{\n  "schema": "dlogen.chain/1"')
    assert len(files_in(tmp_path)) == 3


def test_another_format_does_not_mind_what_it_does_not_write(result: Result, tmp_path: Path) -> None:
    (tmp_path / "hose.v2.json").write_text("mine")
    result.write(tmp_path, "urdf")
    assert files_in(tmp_path)["hose.v2.json"] == b"mine"


def test_a_folder_in_the_way_of_the_last_file_leaves_nothing(result: Result, tmp_path: Path) -> None:
    (tmp_path / "hose.v2.report.json").mkdir()
    for force in (False, True):
        with pytest.raises(UsageError):
            result.write(tmp_path, "urdf,json,mjcf", force=force)
        assert files_in(tmp_path) == {}


def test_a_disk_that_is_full_on_the_way_leaves_nothing(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, left = Path.write_bytes, [2]

    def full(path: Path, data: bytes) -> int:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, os.strerror(28))
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left") as caught:
        result.write(tmp_path / "out", "urdf,json,mjcf")
    assert left[0] == -1, "no file was written before"
    assert caught.value.for_all
    assert list(tmp_path.iterdir()) == []


def test_a_format_that_cannot_hold_it_leaves_nothing(result: Result, tmp_path: Path) -> None:
    endless = replace(result, e_max=float("inf"))
    with pytest.raises((DlogenError, ValueError)):
        endless.write(tmp_path / "out", "urdf,json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("formats", "message"), [("udrf", "'udrf'"), ("", "no model format"), ([], "no model format")])
def test_formats_that_there_are_not(result: Result, formats: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=message):
        result.write(tmp_path / "out", formats)
    assert list(tmp_path.iterdir()) == []


def test_the_model_is_made_once_with_the_results_settings(result: Result) -> None:
    assert result.model is result.model
    assert result.model.name == "hose.v2"
    np.testing.assert_allclose(result.model.joint_positions(), result.chain.joints, atol=1e-12)
    wrong = replace(result, config=result.config.resolved({"joints.min_bend_radius": 10.0}))
    with pytest.raises(ConfigError, match="min_bend_radius = 10 m"):
        _ = wrong.model


class TestPicture:
    def test_beside_the_models(self, result: Result, tmp_path: Path) -> None:
        pytest.importorskip("matplotlib")
        paths = result.write(tmp_path, "urdf", plot=True)
        assert [path.name for path in paths] == ["hose.v2.urdf", "hose.v2.report.json", "hose.v2.png"]
        assert paths[-1].read_bytes() == result.plot()

    def test_alone(self, result: Result, tmp_path: Path) -> None:
        pytest.importorskip("matplotlib")
        path = tmp_path / "new" / "picture.png"
        made = result.plot(path)
        assert made.startswith(b"\x89PNG\r\n\x1a\n")
        assert path.read_bytes() == made
        assert list(tmp_path.rglob("*.png")) == [path]
        with pytest.raises(UsageError):
            result.plot(tmp_path / "new")
