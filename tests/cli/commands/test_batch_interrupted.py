"""Batches that are killed, interrupted, starved or run twice: nothing is lost or done twice."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sqlite3
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import pytest
from batch_runs import (
    DLOGEN,
    PATIENCE,
    QUICK,
    Run,
    files,
    records,
    run,
    running,
    status,
    summary,
    wait_for,
)

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")


def is_reading(number: int, size: int) -> bool:
    """Whether a process has read so many bytes."""
    try:
        return int(Path(f"/proc/{number}/io").read_text().split()[1]) > size
    except OSError:
        return False


def at_the_big_one(started: Run, out: Path, but: set[int]) -> int:
    """Number of the worker that is at the big cloud, other than those."""

    def look() -> int | None:
        if status(out).get("big") != "running":
            assert started.process.poll() is None
            return None
        # Its modules are half of that, the cloud is four times as much.
        return next((number for number in started.workers() - but if is_reading(number, 25_000_000)), None)

    return wait_for(look, "no worker reads the big cloud")  # type: ignore[no-any-return]


@pytest.mark.parametrize("times", [1, 2])
def test_a_worker_that_is_killed_costs_its_cloud_a_second_try(slow: Path, tmp_path: Path, times: int) -> None:
    killed: set[int] = set()
    with running(slow, "in", "-o", tmp_path, "-j", 2, "--format", "json") as started:
        for _ in range(times):
            number = at_the_big_one(started, tmp_path, killed)
            killed.add(number)
            os.kill(number, signal.SIGKILL)
        _, err = started.end()
    others = dict.fromkeys(("a0", "a1", "z0", "z1"), "done")
    assert status(tmp_path) == others | {"big": "done" if times == 1 else "worker-died"}
    assert started.process.returncode == times - 1
    if times == 2:
        assert "signal 9, SIGKILL" in err
        assert "[worker-died]: in/big.ply" in err
        # It may have been the machine: it is tried again without being asked.
        assert run(slow, "in", "-o", tmp_path, "--format", "json").returncode == 0
        assert status(tmp_path) == others | {"big": "done"}
    assert not list(tmp_path.glob(".dlogen-*"))


def test_a_worker_that_hangs_is_ended_in_time(slow: Path, tmp_path: Path) -> None:
    with running(slow, "in", "-o", tmp_path, "-j", 1, "--timeout", 5, "--format", "json") as started:
        # It hangs well: a process that is stopped does nothing.
        number = at_the_big_one(started, tmp_path, set())
        os.kill(number, signal.SIGSTOP)
        _, err = started.end()
    assert started.process.returncode == 1
    assert "took longer than 5 s [timeout]: in/big.ply" in err
    assert status(tmp_path) == dict.fromkeys(("a0", "a1", "z0", "z1"), "done") | {"big": "timeout"}


def test_a_cloud_may_take_so_much_memory(slow: Path, tmp_path: Path) -> None:
    result = run(slow, "in", "-o", tmp_path, "-j", 1, "--memory", "10M", "--format", "json")
    assert result.returncode == 1
    assert "not enough memory for this cloud [memory]: in/big.ply" in result.stderr
    assert status(tmp_path) == dict.fromkeys(("a0", "a1", "z0", "z1"), "done") | {"big": "memory"}


def check_consistent(out: Path) -> None:
    """No half file under a name of its own, and records that sqlite likes."""
    if not out.exists():
        return
    for path in out.rglob("*"):
        if path.name.startswith("."):
            continue
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".urdf":
            ElementTree.parse(path)
    if (out / "dlogen.sqlite").exists():
        with contextlib.closing(sqlite3.connect(out / "dlogen.sqlite")) as database:
            assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    for key, row in records(out).items():
        if row["status"] == "done":
            assert (out / f"{key}.json").exists()
            assert (out / f"{key}.urdf").exists()
            assert (out / f"{key}.report.json").exists()


def test_killed_at_any_moment_it_goes_on_where_it_was(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "killed"
    moments: list[Callable[[Run], object]] = [
        lambda started: out.exists(),
        lambda started: (out / "dlogen.sqlite").exists(),
        lambda started: started.workers(),
        lambda started: list(out.glob(".dlogen-*")) or "done" in status(out).values(),
        *(lambda started, n=n: list(status(out).values()).count("done") >= n for n in (3, 7)),
    ]
    for moment in moments:
        with running(captures, "in", "-o", "killed", "-j", 2) as started:
            wait_for(lambda: moment(started) or started.process.poll() is not None, "the moment did not come")  # noqa: B023
            started.process.kill()
            started.end()
        check_consistent(out)
    result = run(captures, "in", "-o", "killed", "-j", 2)
    assert result.returncode == 0, result.stderr
    assert files(out) == undisturbed
    assert set(status(out).values()) == {"done"}


def test_signals_end_it_tidily(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "signalled"
    for number, to_all, enough in (
        # Workers that are about to start, and workers at work.
        (signal.SIGINT, True, lambda started: started.workers()),
        (signal.SIGTERM, False, lambda started: started.workers()),
        (signal.SIGINT, True, lambda started: list(status(out).values()).count("done") >= 1),
        (signal.SIGTERM, True, lambda started: list(status(out).values()).count("done") >= 3),
    ):
        with running(captures, "in", "-o", "signalled", "-j", 2) as started:
            wait_for(lambda: enough(started), "the moment did not come")  # noqa: B023
            # As a terminal does it; or a service manager, which does not know who belongs to whom.
            if number == signal.SIGTERM and to_all:
                for worker in started.workers():
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(worker, number)
            (os.killpg if to_all else os.kill)(started.process.pid, number)
            _, err = started.end()
        assert started.process.returncode == 128 + number, err
        assert "Traceback" not in err
        done = list(status(out).values()).count("done")
        assert f"error: interrupted: {done} of 10 clouds are done and recorded" in err
        assert "hint: run the same command again" in err
        assert summary(out)["done"] == done
        assert summary(out)["failed"] == 0
        check_consistent(out)
    result = run(captures, "in", "-o", "signalled", "-j", 2)
    assert result.returncode == 0, result.stderr
    assert f"{done} of 10 clouds are done already" in result.stderr
    assert files(out) == undisturbed


def test_nobody_reads_its_lines_any_more(captures: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with running(captures, "in", "-o", out, "-j", 1, "--json") as started:
        # Before there is anything to read: it finds out when it prints its first line.
        assert started.process.stdout is not None
        started.process.stdout.close()
        assert started.process.stderr is not None
        assert started.process.stderr.read() == b""
        assert started.process.wait(PATIENCE) != 0
        wait_for(lambda: not started.workers(), "workers are left")
    check_consistent(out)
    assert 0 < summary(out)["done"] == list(status(out).values()).count("done") < 10
    assert run(captures, "in", "-o", out).returncode == 0


def test_standard_streams_that_lead_nowhere(captures: Path, tmp_path: Path) -> None:
    def said(streams: str) -> tuple[int, str, dict[str, str]]:
        command = [*DLOGEN, "batch", "in/c0.ply", "in/c2.ply", "-j", "1", "-o", tmp_path / streams, "--json", *QUICK]
        shell = ["bash", "-c", f'"$0" "$@" {streams.replace("_", "/")}', *map(str, command)]
        result = subprocess.run(shell, cwd=captures, capture_output=True, text=True, timeout=PATIENCE)
        return result.returncode, result.stderr, status(tmp_path / streams)

    done = {"in/c0": "done", "in/c2": "done"}
    assert said("<&- >&- 2>&-") == (0, "", done)
    code, err, _ = said(">_dev_full")
    assert code == 1
    assert "error: cannot print: No space left on device; 1 of 2 clouds are done and recorded\nhint: " in err
    assert "Traceback" not in err


def test_a_second_run_on_the_same_folder_says_so(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "twice"
    with running(captures, "in", "-o", "twice", "-j", 1) as first:
        wait_for(first.workers, "no worker starts")
        os.kill(first.process.pid, signal.SIGSTOP)
        before = status(out)
        second = run(captures, "in", "-o", "./twice")
        assert second.returncode == 2
        assert "another dlogen process is writing to this folder" in second.stderr
        assert "hint: " in second.stderr
        assert status(out) == before
        os.kill(first.process.pid, signal.SIGCONT)
        first.end()
    assert first.process.returncode == 0
    assert files(out) == undisturbed
