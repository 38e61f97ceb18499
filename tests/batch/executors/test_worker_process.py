"""A worker process by hand: what goes in, what comes out, and when it ends."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from dlogen.batch.executors.worker_process import _arc, can_limit_memory
from dlogen.batch.job import Outcome, Plan, Task, run_job

MAIN = "from dlogen.batch.executors.worker_process import main; main()"


class Then:
    """What a worker that is sent it does before it can answer."""

    def __init__(self, code: str) -> None:
        self.code = code

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, (self.code,)


@contextmanager
def worker(code: str = MAIN) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


def send(process: subprocess.Popen[bytes], what: object) -> None:
    assert process.stdin is not None
    pickle.dump(what, process.stdin)
    process.stdin.flush()


def receive(stream: IO[bytes] | None) -> object:
    assert stream is not None
    return pickle.load(stream)


def test_tasks_in_and_outcomes_out(clouds: tuple[Path, ...], plan: Plan) -> None:
    with worker() as process:
        send(process, (plan, None))
        assert receive(process.stdout) == "ready"
        # What a library prints is no answer.
        noise = Then("import os; print('noise'); os.write(1, b'noise')")
        for key in "ab":
            send(process, Task(str(clouds[0]), key, config=noise))  # type: ignore[arg-type]
        outcomes = [receive(process.stdout) for _ in range(2)]
        assert [outcome.key for outcome in outcomes if isinstance(outcome, Outcome)] == ["a", "b"]
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(60) == 0


@pytest.mark.parametrize("moment", ["at once", "ready", "at work"])
def test_it_ends_with_its_parent(moment: str, clouds: tuple[Path, ...], plan: Plan) -> None:
    with worker() as process:
        assert process.stdin is not None
        if moment != "at once":
            send(process, (plan, None))
            assert receive(process.stdout) == "ready"
        if moment == "at work":
            send(process, Task(str(clouds[0]), "a", config_text=Then("pass")))  # type: ignore[arg-type]
        process.stdin.close()
        # The time is that of a slow machine.
        process.wait(60)


def test_nonsense_ends_it(plan: Plan) -> None:
    with worker() as process:
        send(process, (plan, None))
        assert receive(process.stdout) == "ready"
        assert process.stdin is not None
        process.stdin.write(b"this is no pickle\n" * 10)
        process.stdin.flush()
        process.wait(60)


def test_the_cloud_that_comes_before_a_limit_is_a_good_one() -> None:
    outcome = run_job(Plan(None), Task("arc.ply", "arc", content=_arc()))
    assert outcome.failure is None
    assert outcome.verdict == "good"
    assert outcome.metrics["length"] == pytest.approx(0.4, rel=0.02)
    assert outcome.metrics["radius"] == pytest.approx(0.01, rel=0.02)


@pytest.mark.skipif(not can_limit_memory(), reason="needs Linux")
def test_a_limit_of_memory_is_no_higher_than_that_of_the_system() -> None:
    # As `ulimit -v` makes it, from which only an administrator gets away.
    code = """
import resource
from dlogen.batch.executors.worker_process import limit_memory
resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 7 << 30))
limit_memory(8 << 30)
assert resource.getrlimit(resource.RLIMIT_AS) == (6 << 30, 7 << 30)
limit_memory(1 << 30)
soft, hard = resource.getrlimit(resource.RLIMIT_AS)
assert 1 << 30 < soft < 6 << 30 and hard == 7 << 30
try: bytearray(5 << 28)  # 1.25 times the limit: what was given back meanwhile may be used as well
except MemoryError: pass
else: raise SystemExit("there is no limit")
"""
    subprocess.run([sys.executable, "-c", code], check=True)
