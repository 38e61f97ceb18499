"""Clusters that cannot be had are refused before any work, in so many words."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from dlogen.batch.executors import dask as cluster
from dlogen.batch.executors.dask import DaskPool, prepare_dask, scheduler_of
from dlogen.batch.job import Outcome, Plan, Task
from dlogen.errors import DlogenError, UsageError
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud


def run_all(pool: DaskPool, tasks: list[Task]) -> list[Outcome]:
    with contextlib.closing(pool.run(iter(tasks))) as outcomes:
        return list(outcomes)


def make_clouds(folder: Path, count: int, points: int = 200) -> None:
    """Small ones in two folders, with names as people give them."""
    for index in range(count):
        cloud = sample_tube(random_centre_line(index % 7, clearance=0.08), 0.015, points, index)
        path = folder / ("left", "right side")[index % 2] / f"Schlauch № {index:02d}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_cloud(path, cloud.points)


@pytest.mark.parametrize("address", ["nonsense", "ht://x:1", "tcp://x:y"])
def test_no_address(address: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is not an address"):
        run_all(DaskPool(Plan(None), address, 1), [])


def test_no_scheduler_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 0.5)
    with pytest.raises(DlogenError, match=r"cannot connect to a Dask scheduler at tcp://127\.0\.0\.1:9"):
        run_all(DaskPool(Plan(None), "tcp://127.0.0.1:9", 1), [])


def test_no_scheduler_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        scheduler_of(str(tmp_path / "x.json"), patience=0.0)
    (tmp_path / "x.json").write_text("[]")
    with pytest.raises(UsageError, match="not the scheduler file"):
        scheduler_of(str(tmp_path / "x.json"))


def test_the_scheduler_file_is_waited_for(tmp_path: Path) -> None:
    """A script that starts a scheduler goes on at once, and the scheduler creates its file before it fills it."""
    path = tmp_path / "x.json"

    def start() -> None:
        time.sleep(0.2)
        path.write_text("")
        time.sleep(0.3)
        path.write_text('{"address": "tcp://x:1"}')

    thread = threading.Thread(target=start)
    thread.start()
    try:
        assert scheduler_of(str(path)) == "tcp://x:1"
    finally:
        thread.join()


def test_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(DlogenError) as caught:
        prepare_dask(verbose=False)
    assert caught.value.hint == "pip install 'dlogen[distributed]'"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--ship"], "--ship is for clusters"),
        (["--scheduler", "x:1", "--jobs", "2"], "--jobs is for this machine"),
        (["--scheduler", "x:1", "--scheduler-file", "x"], "contradict each other"),
    ],
)
def test_usage(arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    from dlogen.cli.main import cli

    monkeypatch.chdir(tmp_path)
    make_clouds(Path("clouds"), 1)
    result = CliRunner().invoke(cli, ["batch", "clouds", "-o", "out", *arguments])
    assert result.exit_code == 2
    assert message in result.output
    assert not Path("out").exists()
