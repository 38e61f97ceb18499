"""A worker process as its parent has it. It is at one cloud at a time, so that one that dies costs no other.

What runs in the process is in `dlogen.batch.executors.worker_process`.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from typing import IO, Any

from dlogen.batch.failures import TIMEOUT, WORKER_DIED
from dlogen.batch.job import Failure, Outcome, Plan, Task
from dlogen.batch.output_files import remove_temporaries
from dlogen.errors import DlogenError

#: How often a cloud is tried whose worker dies.
ATTEMPTS = 2

#: Numerical libraries with a thread for every core, in a process for every core, are many times slower.
_SINGLE_THREADED = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


class NotStarted(DlogenError):
    """No worker process starts."""


class Worker:
    """A worker process, started when it is first needed and again when it has died.

    Args:
        plan: what it does.
        timeout: seconds that a cloud may take.
        memory: bytes that a cloud may take.
    """

    def __init__(self, plan: Plan, *, timeout: float | None = None, memory: int | None = None) -> None:
        self._plan, self._timeout, self._memory = plan, timeout, memory
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def run_job(self, task: Task) -> Outcome:
        """Send a task and wait for the answer; again, once, if the process dies over it.

        Raises:
            NotStarted: no process starts.
        """
        end = None
        for _ in range(ATTEMPTS):
            process = self._running()
            timer = None if self._timeout is None else _Deadline(process, self._timeout)
            try:
                _send(process, task)
                outcome: Outcome = _receive(process)
                return outcome
            except _GONE:
                end = _end_of(process)
            finally:
                if timer is not None:
                    timer.cancel()
            if self._plan.folder is not None:
                remove_temporaries(self._plan.folder, task.key, self._plan.outputs, process.pid)
            if timer is not None and timer.passed:
                hint = "give it more --timeout, or look at the cloud with dlogen info"
                return Outcome(task.key, Failure(TIMEOUT.code, f"took longer than {self._timeout:g} s", hint))
            if self._closed:
                break
        return Outcome(task.key, died(end))

    @property
    def closed(self) -> bool:
        """Whether it has been closed: it takes no more tasks."""
        return self._closed

    def close(self) -> None:
        """End the process, at once."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()
                _close_pipes(self._process)

    def _running(self) -> subprocess.Popen[bytes]:
        """The process, ready for a task."""
        if self._process is not None and self._process.poll() is None:
            return self._process
        for _ in range(ATTEMPTS):
            with _log() as log:
                process = self._start(log)
                try:
                    _send(process, (self._plan, self._memory))
                    _receive(process)
                    return process
                except _GONE:
                    end = _end_of(process)
                    said = _last_line(log)
            if end >= 0:
                # Not somebody who killed it.
                break
        raise NotStarted(f"a worker process does not start: {said or _how(end)}", _START_HINT)

    def _start(self, log: IO[bytes] | None) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._closed:
                raise NotStarted("the worker is closed")
            if self._process is not None:
                _close_pipes(self._process)
            try:
                self._process = _start(log)
            except OSError as error:
                raise NotStarted(f"a worker process does not start: {error.strerror or error}", _START_HINT) from error
            return self._process


#: What comes of talking to a process that has ended.
_GONE = (OSError, EOFError, pickle.UnpicklingError)

_START_HINT = "does dlogen fit work here? Otherwise there may be too little memory, or too many processes: try --jobs 1"


class _Deadline:
    """Kills a process after some time, unless it is cancelled before."""

    def __init__(self, process: subprocess.Popen[bytes], seconds: float) -> None:
        self.passed = False
        self._process = process
        self._timer = threading.Timer(seconds, self._kill)
        self._timer.daemon = True
        self._timer.start()

    def cancel(self) -> None:
        self._timer.cancel()

    def _kill(self) -> None:
        self.passed = True
        self._process.kill()


@contextlib.contextmanager
def _log() -> Iterator[IO[bytes] | None]:
    """Where a process says why it does not start; None where no file can be made.

    A file and not a pipe: nobody reads it any more once the process has started.
    """
    try:
        log = tempfile.TemporaryFile()  # noqa: SIM115 - the block must not be in this try
    except OSError:
        yield None
        return
    with log:
        yield log


def _last_line(log: IO[bytes] | None) -> str:
    if log is None:
        return ""
    log.seek(0)
    lines = log.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "")


def _start(log: IO[bytes] | None) -> subprocess.Popen[bytes]:
    # Modules come from where ours came from, and not from the current folder.
    code = f"import sys; sys.path[:] = {sys.path!r}; from dlogen.batch.executors.worker_process import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if log is None else log,
        env=os.environ | _SINGLE_THREADED,
        # Ctrl-C is for the parent, which ends the workers.
        start_new_session=True,
    )


def _send(process: subprocess.Popen[bytes], what: Any) -> None:
    assert process.stdin is not None
    pickle.dump(what, process.stdin, protocol=pickle.HIGHEST_PROTOCOL)
    process.stdin.flush()


def _receive(process: subprocess.Popen[bytes]) -> Any:
    assert process.stdout is not None
    return pickle.load(process.stdout)


def _end_of(process: subprocess.Popen[bytes]) -> int:
    """Exit code of a process that does not talk any more."""
    try:
        return process.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _close_pipes(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # what was not yet sent cannot be
                pipe.close()


def died(end: int | None) -> Failure:
    """A cloud whose worker ended, whenever it was tried.

    Args:
        end: exit code, or minus a signal's number; None where it is not known.
    """
    hint = "look at the cloud with dlogen info; with -9, memory may have run out: try fewer --jobs, or --memory"
    return Failure(WORKER_DIED.code, f"its worker ended {ATTEMPTS} times over it ({_how(end)})", hint)


def _how(end: int | None) -> str:
    if end is None:
        return "no exit code"
    if end >= 0:
        return f"exit code {end}"
    try:
        return f"signal {-end}, {signal.Signals(-end).name}"
    except ValueError:
        return f"signal {-end}"
