"""Who does the work of a batch: what the options allow, and how many cores there are."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from dlogen.batch.executors.local import LocalPool
from dlogen.batch.job import Plan
from dlogen.cli.console import Console
from dlogen.cli.workers import Workers, cores
from dlogen.errors import UsageError


def workers(**options: object) -> Workers:
    nothing = {"jobs": None, "timeout": None, "memory": None, "scheduler": None, "scheduler_file": None, "ship": False}
    return Workers(**(nothing | options))


@pytest.mark.parametrize(
    ("text", "expected"),
    [("100000 100000\n", 1), ("10000 100000\n", 1), ("max 100000\n", None), ("6400000 100000\n", None), ("?", None)],
)
def test_cores_are_those_of_the_container(tmp_path: Path, text: str, expected: int | None) -> None:
    limits = tmp_path / "cpu.max"
    limits.write_text(text)
    everything = cores(tmp_path / "missing")
    assert 1 <= everything <= (os.cpu_count() or 1)
    assert cores(limits) == (expected if expected is not None else min(everything, 64))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"timeout": math.nan}, "is not a time"),
        ({"ship": True}, "for clusters"),
        ({"scheduler": "tcp://127.0.0.1:1", "scheduler_file": "x.json"}, "contradict"),
        ({"scheduler": "tcp://127.0.0.1:1", "jobs": 2}, "for this machine"),
        ({"scheduler_file": "x.json", "jobs": 2}, "for this machine"),
    ],
)
def test_what_does_not_go_together(options: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        workers(**options).check()


@pytest.mark.parametrize("options", [{}, {"jobs": 3, "timeout": 5.0}, {"scheduler": "tcp://127.0.0.1:1", "ship": True}])
def test_what_does(options: dict[str, object]) -> None:
    workers(**options).check()


def test_no_more_processes_than_clouds(tmp_path: Path) -> None:
    plan = Plan(str(tmp_path))
    for jobs, clouds, expected in ((8, 3, 3), (2, 3, 2), (8, 0, 1), (None, 10_000, cores())):
        pool = workers(jobs=jobs).pool(plan, clouds, Console(-1))
        assert isinstance(pool, LocalPool)
        assert pool.jobs == expected
