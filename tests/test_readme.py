"""The pages of the project: what they say to type works as it stands there, and what they point to is there."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from moving import hose, line
from places import ROOT, SAMPLES

from dlogen.cli.main import cli
from dlogen.config.schema import Config
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.io.cloud_files import write_cloud

IGNORED = {".git", ".venv", "venv", "node_modules", "out", ".pytest_cache"}
PAGES = sorted(
    path
    for path in ROOT.rglob("*.md")
    if not IGNORED & set(path.relative_to(ROOT).parts) and not path.match("*.egg-info/*")
)
#: Folders of the project whose files are named in the pages by their path from the top.
FOLDERS = r"(?:dlogen|tests|configs|sample_clouds|\.ci|\.github)"


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(content: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", content, re.MULTILINE | re.DOTALL)


def section(content: str, title: str) -> str:
    """What stands under a title of the second level."""
    (found,) = re.findall(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", content, re.MULTILINE | re.DOTALL)
    return found


def prose(content: str) -> str:
    """Without blocks of code."""
    return re.sub(r"^```.*?^```$", "", content, flags=re.MULTILINE | re.DOTALL)


BATCH = text("dlogen/batch/README.md")
DATASETS = section(BATCH, "Datasets")
CLUSTERS = section(BATCH, "Clusters")
SEQUENCE = text("dlogen/sequence/README.md")
STAGES = text("dlogen/stages/README.md")
README = text("README.md")


# Links ------------------------------------------------------------------------------------------------------------


def anchors(content: str) -> set[str]:
    """Those that GitHub makes of the headings."""
    headings = re.findall(r"^#+ (.*)$", prose(content), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    content = prose(page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", content):
        if re.match(r"https?://", target):
            continue
        place, _, anchor = target.partition("#")
        there = (page.parent / place).resolve() if place else page
        assert there.exists(), f"{name(page)}: {target}"
        if anchor:
            assert anchor in anchors(there.read_text(encoding="utf-8")), f"{name(page)}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_files_that_are_named_are_there(page: Path) -> None:
    named = re.findall(rf"(?<![\w./-])({FOLDERS}/[\w./-]*\w)", page.read_text(encoding="utf-8"))
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_readme_leads_to_every_room() -> None:
    rooms = [page for page in PAGES if page.name == "README.md" and page.parent != ROOT]
    assert len(rooms) >= 8
    assert [name(page) for page in rooms if f"({name(page)})" not in README] == []


# The front page ---------------------------------------------------------------------------------------------------


def test_the_readme_is_short_and_its_first_two_commands_do_all() -> None:
    assert len(README.splitlines()) <= 180
    first, second = blocks(README, "sh")[0].splitlines()
    assert first.startswith("python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/dlogen fit sample_clouds/")
    assert second == ".venv/bin/pip install -e '.[test]' && .venv/bin/python -m pytest -n auto"


def test_the_readme_names_every_command() -> None:
    table = section(README, "Commands")
    group = cli.list_commands(click.Context(cli))
    assert [command for command in group if f"`dlogen {command}" not in table] == []


def test_the_result_of_the_readme(tmp_path: Path) -> None:
    call, *shown = blocks(section(README, "One result"), "console")[0].splitlines()
    shutil.copytree(SAMPLES, tmp_path / "sample_clouds", ignore=shutil.ignore_patterns("pictures"))
    done = run(call.removeprefix("$ "), tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines() == shown


@pytest.mark.parametrize("page", ["README.md", "dlogen/io/README.md"])
def test_from_python(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(SAMPLES, tmp_path / "sample_clouds", ignore=shutil.ignore_patterns("pictures"))
    monkeypatch.chdir(tmp_path)
    codes = blocks(text(page), "python")
    assert codes
    for code in codes:
        names: dict[str, Any] = {}
        exec(compile(code, page, "exec"), names)
        if "result" in names:
            assert names["result"].quality.verdict == "good"


# All blocks of code -----------------------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("bash") is None, reason="the recipes are for a shell")
@pytest.mark.parametrize("page", PAGES, ids=name)
def test_code_is_well_formed(page: Path) -> None:
    content = page.read_text(encoding="utf-8")
    for code in blocks(content, "sh"):
        done = subprocess.run(["bash", "-n"], input=code, capture_output=True, text=True)
        assert done.stderr == "", code
    for code in blocks(content, "python"):
        compile(code, name(page), "exec")
    for code in blocks(content, "yaml"):
        assert isinstance(yaml.safe_load(code), dict)


def test_configurations_are_valid() -> None:
    codes = blocks(text("configs/README.md"), "yaml")
    assert len(codes) >= 3
    for code in codes:
        assert Config.from_dict(yaml.safe_load(code)) != Config()


# What the pages say of the code -----------------------------------------------------------------------------------


def rows(table: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in row.strip("|").split(" | ")] for row in re.findall(r"^\|.*\|$", table, re.MULTILINE)
    ]


def test_the_map_has_every_equation_of_the_paper() -> None:
    found = set()
    for row in rows(section(STAGES, "Where the paper's equations are")):
        for numbers in re.findall(r"Eq\. ([\d, -]+)", row[0]):
            for part in re.findall(r"\d+(?:-\d+)?", numbers):
                first, _, last = part.partition("-")
                found |= set(range(int(first), int(last or first) + 1))
    assert found == set(range(1, 23))


@pytest.mark.parametrize("equation", [4, 5, 8, 11, 17, 20, 21])
def test_equations_are_in_the_file_that_the_map_names(equation: int) -> None:
    for row in rows(section(STAGES, "Where the paper's equations are")):
        for numbers in re.findall(r"Eq\. ([\d, -]+)", row[0]):
            for part in re.findall(r"\d+(?:-\d+)?", numbers):
                first, _, last = part.partition("-")
                if int(first) <= equation <= int(last or first):
                    (place,) = re.findall(r"\]\(([^)]+)\)", row[2])[:1]
                    source = (ROOT / "dlogen" / "stages" / place).read_text(encoding="utf-8")
                    spans = re.findall(r"Eq\. (\d+)(?:-(\d+))?", source)
                    assert any(int(a) <= equation <= int(b or a) for a, b in spans), place
                    return
    pytest.fail(f"Eq. {equation} is not in the map")


@pytest.mark.parametrize(("file", "schema"), [("bent.json", "dlogen.chain/1"), ("bent.report.json", "dlogen.report/1")])
def test_schemas_have_the_keys_that_are_written(file: str, schema: str, tmp_path: Path) -> None:
    cloud = str(SAMPLES / "bent.ply")
    truth = str(SAMPLES / "bent.truth.json")
    done = CliRunner().invoke(cli, ["fit", cloud, "-o", str(tmp_path), "--reference", truth])
    assert done.exit_code == 0, done.stderr
    (content,) = re.findall(
        rf"^## .*schema `{re.escape(schema)}`\n(.*?)(?=^## )", text("dlogen/io/README.md"), re.M | re.S
    )
    documented = [key for row in rows(content)[2:] for key in re.findall(r"`(\w+)`", row[0])]
    assert documented == list(dict.fromkeys(documented))
    assert set(documented) == set(json.loads((tmp_path / file).read_text(encoding="utf-8")))


# Recipes ----------------------------------------------------------------------------------------------------------


def scripts(place: Path) -> dict[str, str]:
    """An environment with the dlogen and the dask of this Python, and a srun that is for one node."""
    folder = place / "bin"
    folder.mkdir(exist_ok=True)
    for script, content in {
        "dlogen": f'exec "{sys.executable}" -m dlogen "$@"',
        "dask": f'exec "{sys.executable}" -c "from dask.cli import run_cli; run_cli()" "$@"',
        "srun": 'shift\nexec "$@"',
    }.items():
        (folder / script).write_text(f"#!/bin/sh\n{content}\n")
        (folder / script).chmod(0o755)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    return os.environ | {"PATH": path, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}


def run(command: str, place: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command in a shell of its own; what it leaves in the background is ended with it."""
    # Into files: pipes would stay open as long as something is left in the background.
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", command],
            cwd=place,
            env=scripts(place) | environment,
            stdout=out,
            stderr=err,
            start_new_session=True,
        )
        try:
            process.wait(timeout=300)
        finally:
            if hasattr(os, "killpg"):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(command, process.returncode, out.read(), err.read())


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory, half_tube: SyntheticCloud) -> Path:
    """A folder with what the recipes speak of, and the results of those before."""
    place = tmp_path_factory.mktemp("datasets")
    (place / "captures" / "a").mkdir(parents=True)
    points = half_tube.points[::5]
    for cloud in ("one.ply", "two words.ply"):
        write_cloud(place / "captures" / "a" / cloud, points)
    write_cloud(place / "captures" / "a" / "three.pcd", 1e3 * points)
    (place / "captures" / "a" / "three.yaml").write_text("units: mm\n")
    (place / "captures.csv").write_text("cloud,e_max\ncaptures/a/one.ply,0.004\n")
    (place / "last-run").touch()
    os.utime(place / "last-run", (0, 0))
    return place


def recipes() -> list[str]:
    return [line for block in blocks(DATASETS, "sh") for line in block.splitlines() if not line.startswith("export")]


@pytest.mark.skipif(shutil.which("bash") is None, reason="the recipes are for a shell")
def test_the_recipes_work(captures: Path) -> None:
    assert len(recipes()) >= 8
    for recipe in recipes():
        missing = [tool for tool in ("jq", "sqlite3", "parallel", "xargs") if tool in recipe and not shutil.which(tool)]
        if missing:
            continue
        done = run(recipe, captures)
        assert done.returncode == 0, f"{recipe}\n{done.stderr}"
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
    (tmp_path / "Makefile").write_text(blocks(DATASETS, "make")[0])
    first = run("make -j 2", tmp_path)
    assert first.returncode == 0, first.stderr
    assert (tmp_path / "made" / "a" / "one.urdf").exists()
    assert "Nothing to be done" in run("make", tmp_path).stdout


def cluster_recipe(word: str) -> str:
    (found,) = (code for code in blocks(CLUSTERS, "sh") if word in code)
    return found


@pytest.mark.skipif(sys.platform == "win32" or shutil.which("bash") is None, reason="the recipes are for a shell")
@pytest.mark.parametrize("word", ["here.json", "scheduler-$SLURM_JOB_ID"])
def test_a_dask_cluster_of_ones_own(word: str, captures: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    shutil.copytree(captures / "captures", tmp_path / "captures")
    # The port that people have is in use here when tests run side by side.
    recipe = cluster_recipe(word).replace("here.json &\ndask worker", "here.json --port 0 &\ndask worker")
    done = run(recipe, tmp_path, SLURM_JOB_ID="7", SLURM_CPUS_PER_TASK="1")
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "models" / "a").glob("*.urdf")} == {
        "one.urdf",
        "two words.urdf",
        "three.urdf",
    }


@pytest.mark.skipif(sys.platform == "win32" or shutil.which("bash") is None, reason="the recipes are for a shell")
def test_a_job_array(captures: Path, tmp_path: Path) -> None:
    shutil.copytree(captures / "captures", tmp_path / "captures")
    recipe = cluster_recipe("--array")
    for task in ("1", "2"):
        done = run(recipe, tmp_path, SLURM_ARRAY_TASK_ID=task, SLURM_CPUS_PER_TASK="1")
        assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "models").glob("[12]/**/*.urdf"))) == 2
    (joined,) = re.findall(r"^# when all have ended: (.*)$", recipe, re.MULTILINE)
    assert run(joined, tmp_path).returncode == 0
    assert len((tmp_path / "summary.csv").read_text(encoding="utf-8").splitlines()) == 3


# A recording ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the recording's recipe was run."""
    place = tmp_path_factory.mktemp("recording")
    (place / "recording").mkdir()
    angles, middle = hose(1)
    for k in range(14):
        true = line(angles, k / 30.0, middle(k / 30.0))
        write_cloud(place / "recording" / f"hose_{k}.ply", sample_tube(true, 0.012, 1000, k).points)
    (recipe,) = blocks(SEQUENCE, "sh")
    done = run(recipe, place)
    assert done.returncode == 0, done.stderr
    return place


def replay(module: str) -> dict[str, Any]:
    """What the code of the page for this engine has made."""
    (code,) = (code for code in blocks(section(SEQUENCE, "Replay"), "python") if module in code)
    names: dict[str, Any] = {}
    exec(code, names)
    return names


def test_replay_in_mujoco(motion: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(motion)
    data = replay("mujoco")["data"]
    expected = np.load("motion/trajectory.npz")["joint_positions"][12]
    assert np.vstack([data.xpos[1:], data.site("tip").xpos]) == pytest.approx(expected, abs=1e-6)


@pytest.mark.oracle
def test_forward_kinematics_in_pinocchio(motion: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pinocchio")
    monkeypatch.chdir(motion)
    made = replay("pinocchio")
    expected = np.load("motion/trajectory.npz")["joint_positions"][12]
    places = [f"segment_{i + 1:02d}" for i in range(len(expected) - 1)] + ["tip"]
    found = [made["data"].oMf[made["robot"].getFrameId(place)].translation for place in places]
    assert np.array(found) == pytest.approx(expected, abs=1e-6)
