"""The recipes of the README, run as they stand there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.io.cloud_files import write_cloud

README = (ROOT / "README.md").read_text(encoding="utf-8")
DATASETS = README[README.index("\n## Datasets\n") :].split("\n## ")[1]


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", DATASETS, re.MULTILINE | re.DOTALL)


def recipes() -> list[str]:
    return [line for block in blocks("sh")[:2] for line in block.splitlines() if not line.startswith("export")]


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory, half_tube: SyntheticCloud) -> Path:
    """A folder with what the recipes speak of, and the results of those before."""
    place = tmp_path_factory.mktemp("datasets")
    (place / "captures" / "a").mkdir(parents=True)
    points = half_tube.points[::5]
    for name in ("one.ply", "two words.ply"):
        write_cloud(place / "captures" / "a" / name, points)
    write_cloud(place / "captures" / "a" / "three.pcd", 1e3 * points)
    (place / "captures" / "a" / "three.yaml").write_text("units: mm\n")
    (place / "captures.csv").write_text("cloud,e_max\ncaptures/a/one.ply,0.004\n")
    (place / "last-run").touch()
    os.utime(place / "last-run", (0, 0))
    return place


def run(command: str, place: Path) -> subprocess.CompletedProcess[str]:
    # The dlogen of this Python, wherever its scripts are.
    script = place / "bin" / "dlogen"
    script.parent.mkdir(exist_ok=True)
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m dlogen "$@"\n')
    script.chmod(0o755)
    environment = os.environ | {"PATH": f"{script.parent}{os.pathsep}{os.environ['PATH']}", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command], cwd=place, env=environment, capture_output=True, text=True
    )


@pytest.mark.skipif(shutil.which("bash") is None, reason="the recipes are for a shell")
def test_the_recipes_work(captures: Path) -> None:
    assert len(recipes()) >= 8
    for line in recipes():
        missing = [tool for tool in ("jq", "sqlite3", "parallel", "xargs") if tool in line and not shutil.which(tool)]
        if missing:
            continue
        done = run(line, captures)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
    made = captures / "models" / "a"
    assert {path.name for path in made.glob("*.urdf")} == {"one.urdf", "two words.urdf", "three.urdf"}
    assert (captures / "models-pcd" / "a" / "three.urdf").exists()
    assert (captures / "models-new" / "captures" / "a" / "two words.urdf").exists()
    assert (captures / "models-list" / "captures" / "a" / "one.urdf").read_bytes() != (made / "one.urdf").read_bytes()
    if shutil.which("xargs"):
        # The same model as from the batch, which was also asked for MJCF.
        assert (captures / "models-xargs" / "one.json").read_bytes() == (made / "one.json").read_bytes()


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_the_makefile_makes_what_is_missing(captures: Path, tmp_path: Path) -> None:
    shutil.copytree(captures / "captures", tmp_path / "captures")
    (tmp_path / "captures" / "a" / "two words.ply").unlink()  # make knows no blanks in names
    (tmp_path / "Makefile").write_text(blocks("make")[0])
    first = run("make -j 2", tmp_path)
    assert first.returncode == 0, first.stderr
    assert (tmp_path / "made" / "a" / "one.urdf").exists()
    assert "Nothing to be done" in run("make", tmp_path).stdout
