"""One cloud of a batch."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dlogen.batch.job import Failure, Plan, Task, failure_of, run_job
from dlogen.batch.metrics import METRICS
from dlogen.config.reader import load_config
from dlogen.errors import ConfigError, FitError, InputError, OutputError
from dlogen.io.cloud_files import write_cloud
from dlogen.io.outputs import Outputs


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_writes_the_results_and_says_how_it_went(clouds: tuple[Path, ...], plan: Plan, tmp_path: Path) -> None:
    outcome = run_job(plan, Task(str(clouds[0]), "sub/cable"))
    assert outcome.failure is None
    assert outcome.verdict in ("good", "doubtful")
    assert names(tmp_path / "out" / "sub") == ["cable.json", "cable.report.json"]
    chain = json.loads((tmp_path / "out" / "sub" / "cable.json").read_text())
    assert outcome.metrics["segment_count"] == chain["segment_count"]
    assert outcome.metrics["max_deviation"] == pytest.approx(chain["max_deviation"], abs=1e-9)
    assert set(outcome.metrics) == {item.name for item in METRICS}
    assert outcome.sha256 == chain["provenance"]["sha256"]
    assert outcome.files is None
    assert outcome.seconds >= sum(outcome.timings.values()) > 0.0
    assert "timings" not in json.loads((tmp_path / "out" / "sub" / "cable.report.json").read_text())


def test_without_a_folder_the_results_come_back(clouds: tuple[Path, ...], plan: Plan, tmp_path: Path) -> None:
    run_job(plan, Task(str(clouds[0]), "cable"))
    content = clouds[0].read_bytes()
    # The file is somewhere else, or of another system: its bytes are all there is.
    outcome = run_job(replace(plan, folder=None), Task(f"/elsewhere/{clouds[0].name}", "cable", content=content))
    assert outcome.files == {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}


def test_own_settings_win_over_common_ones_and_the_command_line_over_both(
    clouds: tuple[Path, ...], plan: Plan, tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("e_max: 0.003\n")

    def e_max(plan: Plan, task: Task) -> float:
        outcome = run_job(plan, task)
        assert outcome.failure is None
        return outcome.metrics["e_max"]

    cloud = str(clouds[0])
    with_common = replace(plan, config=load_config(None, ["e_max=0.002", "profile=paper"]))
    assert e_max(with_common, Task(cloud, "a")) == 0.002
    assert e_max(with_common, Task(cloud, "a", config=str(own))) == 0.003
    assert e_max(with_common, Task(cloud, "a", config="elsewhere.yaml", config_text="e_max: 0.003\n")) == 0.003
    assert e_max(with_common, Task(cloud, "a", config=str(own), overrides=("e_max=0.004",))) == 0.004
    with_given = replace(with_common, overrides=("e_max=0.005",))
    assert e_max(with_given, Task(cloud, "a", config=str(own), overrides=("e_max=0.004",))) == 0.005


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_only_files_are_read(kind: str, clouds: tuple[Path, ...], plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "x.ply"
    if kind == "pipe":
        # Opening it would wait until somebody writes to it.
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        # It never ends.
        path.symlink_to("/dev/zero")
    failure = run_job(plan, Task(str(path), "x")).failure
    assert failure is not None
    assert failure.code == "input"
    assert "not a file" in failure.message
    assert failure.hint
    # A configuration as well.
    failure = run_job(plan, Task(str(clouds[0]), "x", str(path))).failure
    assert failure is not None
    assert failure.code == "config"
    assert "not a file" in failure.message


def test_failures_have_a_code_and_say_what_to_try(clouds: tuple[Path, ...], plan: Plan, tmp_path: Path) -> None:
    missing = run_job(plan, Task(str(tmp_path / "missing.ply"), "x")).failure
    assert missing is not None
    assert (missing.code, missing.stops_all) == ("input", False)
    wrong = run_job(plan, Task(str(clouds[0]), "x", "own.yaml", "e_maxx: 1\n")).failure
    assert wrong is not None
    assert wrong.code == "config"
    assert "own.yaml" in wrong.message
    assert "line 1" in wrong.message
    assert wrong.hint == "did you mean 'e_max'?"
    directions = np.random.default_rng(0).normal(size=(500, 3))
    write_cloud(tmp_path / "ball.ply", directions / np.linalg.norm(directions, axis=1, keepdims=True))
    unfit = run_job(plan, Task(str(tmp_path / "ball.ply"), "x"))
    assert unfit.failure is not None
    assert unfit.failure.code == "fit"
    # It was read.
    assert unfit.sha256 is not None
    (tmp_path / "out" / "x.json").mkdir(parents=True)
    output = run_job(plan, Task(str(clouds[0]), "x")).failure
    assert output is not None
    assert output.hint
    assert output.code == "output"


def test_running_out_of_memory_is_a_failure_of_the_cloud(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise MemoryError

    monkeypatch.setattr("dlogen.pipeline.fit", full)
    failure = run_job(plan, Task(str(clouds[0]), "x")).failure
    assert failure is not None
    assert failure.code == "memory"


def test_a_bug_of_ours_is_a_failure_of_the_cloud(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("sum of nothing")

    monkeypatch.setattr("dlogen.pipeline.fit", wrong)
    failure = run_job(plan, Task(str(clouds[0]), "x")).failure
    assert failure is not None
    assert failure.code == "internal"
    assert "ZeroDivisionError: sum of nothing" in failure.message
    assert "test_job.py" in failure.message


def test_errors_as_failures() -> None:
    assert failure_of(InputError("m", "h", path="p")) == Failure("input", "m", "h")
    assert failure_of(ConfigError("m", "h", path="p")) == Failure("config", "p: m", "h")
    assert failure_of(FitError("m", stage="sorting")) == Failure("fit", "m", stage="sorting")
    assert failure_of(OutputError("m", "h", for_all=True)) == Failure("output", "m", "h", stops_all=True)


def test_the_digest_tells_everything_apart_that_matters(plan: Plan) -> None:
    task = Task("a.ply", "a")
    different = [
        (plan, task),
        (replace(plan, overrides=("e_max=0.01",)), task),
        (replace(plan, config=load_config(None, [])), task),
        (replace(plan, outputs=Outputs(("json", "urdf"))), task),
        (replace(plan, outputs=Outputs(("json",), plot=True)), task),
        (plan, replace(task, config="a.yaml", config_text="e_max: 0.01\n")),
        (plan, replace(task, overrides=("e_max=0.01",))),
    ]
    assert len({plan.digest(task) for plan, task in different}) == len(different)
    # Where it lies does not.
    assert plan.digest(replace(task, cloud="b.ply", key="b")) == plan.digest(task)
    assert replace(plan, folder="elsewhere").digest(task) == plan.digest(task)
