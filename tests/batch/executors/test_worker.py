"""A worker process as its parent has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlogen.batch.executors.worker import NotStarted, Worker, died
from dlogen.batch.job import Plan, Task


def test_a_worker_that_dies_while_it_has_nothing_to_do_costs_nothing(clouds: tuple[Path, ...], plan: Plan) -> None:
    worker = Worker(plan)
    try:
        assert worker.run_job(Task(str(clouds[0]), "a")).failure is None
        assert worker._process is not None
        worker._process.kill()
        worker._process.wait()
        assert worker.run_job(Task(str(clouds[0]), "b")).failure is None
    finally:
        worker.close()
    with pytest.raises(NotStarted):
        worker.run_job(Task(str(clouds[0]), "c"))


def test_how_a_worker_ended_in_words() -> None:
    assert "signal 9, SIGKILL" in died(-9).message
    assert "signal 250" in died(-250).message
    assert "exit code 1" in died(1).message
    assert died(None).code == "worker-died"
