"""Batches that run by themselves: their processes, files and records."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube

DLOGEN = [sys.executable, "-m", "dlogen"]


QUICK = ["--profile", "paper", "--set", "mdtw.samples=50"]


#: For what takes a moment on an idle machine.
PATIENCE = 120.0


AXES = "".join(f"property float {axis}\n" for axis in "xyz")


def tube(seed: int) -> np.ndarray:
    return sample_tube(random_centre_line(seed, clearance=0.08), 0.015, 400, seed).points


class Run:
    """A batch that runs by itself, in a process group of its own.

    All its processes have a mark in their environment, by which they are found whoever their parent is now.
    """

    def __init__(self, folder: Path, *arguments: object, **options: Any) -> None:
        self.mark = f"DLOGEN_TEST={uuid.uuid4()}"
        name, _, value = self.mark.partition("=")
        self.process = subprocess.Popen(
            [*DLOGEN, "batch", *QUICK, *map(str, arguments)],
            cwd=folder,
            env=os.environ | {name: value},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            **options,
        )

    def workers(self) -> set[int]:
        """Numbers of its worker processes."""
        found = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self.process.pid:
                with contextlib.suppress(OSError):
                    # Of a process that has ended it is empty.
                    if self.mark.encode() in (entry / "environ").read_bytes():
                        found.add(int(entry.name))
        return found

    def end(self) -> tuple[str, str]:
        out, err = self.process.communicate(timeout=PATIENCE)
        wait_for(lambda: not self.workers(), "workers are left")
        return out.decode(), err.decode()


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < deadline, what
        time.sleep(0.005)
    return found


@contextlib.contextmanager
def running(folder: Path, *arguments: object, **options: Any) -> Iterator[Run]:
    started = Run(folder, *arguments, **options)
    try:
        yield started
    finally:
        for number in (started.process.pid, *started.workers()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        started.process.communicate()


def run(folder: Path, *arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [*DLOGEN, "batch", *QUICK, *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, capture_output=True, timeout=2 * PATIENCE, encoding="utf-8", errors="replace", **options
    )


def files(folder: Path) -> dict[str, bytes]:
    """All but the records, with what they hold."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(("dlogen.sqlite", ".dlogen.lock"))
    }


def records(folder: Path) -> dict[str, sqlite3.Row]:
    """By key; nothing if there are none yet."""
    if not (folder / "dlogen.sqlite").exists():
        return {}
    with contextlib.closing(sqlite3.connect(folder / "dlogen.sqlite", timeout=60.0)) as database:
        database.row_factory = sqlite3.Row
        try:
            return {row["key"]: row for row in database.execute("SELECT * FROM clouds")}
        except sqlite3.OperationalError:  # not yet
            return {}


def status(folder: Path) -> dict[str, str]:
    return {key: row["code"] or row["status"] for key, row in records(folder).items()}


def summary(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "summary.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))
