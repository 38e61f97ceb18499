"""What a worker of a Dask cluster does with the clouds that `dlogen.batch.executors.dask` sends.

Each of its threads has a worker process of its own, as on one machine, so that limits of time and memory hold here as
well, numerical libraries are single-threaded, and a cloud that kills its process costs no other.
"""

from __future__ import annotations

import atexit
import os
import pickle
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from dlogen._version import __version__
from dlogen.batch import store
from dlogen.batch.executors.worker import Worker
from dlogen.batch.job import Outcome, Plan, Task
from dlogen.errors import DlogenError

#: Seconds that a process is kept that has nothing to do.
IDLE_SECONDS = 60.0

#: Seconds between looks at whether the work is still wanted.
_LOOK_SECONDS = 0.5


@dataclass(frozen=True)
class Order:
    """What is to be done.

    Attributes:
        settings: of the processes (`ProcessSettings`), pickled. The same bytes for all orders of a run.
        tasks: the clouds.
        seconds: when they are over, clouds that were not begun are left to another order.
    """

    settings: bytes
    tasks: tuple[Task, ...]
    seconds: float


@dataclass(frozen=True)
class ProcessSettings:
    """As of `Worker`."""

    plan: Plan
    timeout: float | None = None
    memory: int | None = None


@dataclass(frozen=True)
class Reply:
    """What came of it.

    Attributes:
        worker: address of the Dask worker.
        outcomes: of the first tasks; those without one have to be done again.
        seconds: that they took.
        unseen: keys of clouds that this machine does not see.
        refusal: message and hint, if no cloud can be done here.
    """

    worker: str
    outcomes: tuple[Outcome, ...] = ()
    seconds: float = 0.0
    unseen: tuple[str, ...] = ()
    refusal: tuple[str, str | None] | None = None


class Call:
    """A call of `serve`, made by unpickling.

    Dask's scheduler unpickles functions that it passes on, and would need dlogen for it; bytes it leaves alone.
    """

    def __init__(self, order: Order) -> None:
        self._order = pickle.dumps(order, protocol=pickle.HIGHEST_PROTOCOL)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return serve, (__version__, self._order)


def serve(version: str, pickled: bytes) -> Reply:
    """Do the clouds of an order, one after another.

    Args:
        version: of dlogen, where the order comes from. What is in an order may differ between versions.
        pickled: the order.
    """
    from distributed import get_worker

    here = get_worker().address
    if version != __version__:
        hint = f"install the same version everywhere: pip install dlogen=={version}"
        return Reply(here, refusal=(f"the Dask worker {here} has dlogen {__version__}, and this is {version}", hint))
    # Nannies set it, so that Dask workers give memory back at once; fits would take 15 % longer.
    os.environ.pop("MALLOC_TRIM_THRESHOLD_", None)
    order: Order = pickle.loads(pickled)
    settings: ProcessSettings = pickle.loads(order.settings)
    shared = settings.plan.folder
    # Results would go to a folder of this machine, where nobody looks.
    if shared is not None and not os.path.exists(os.path.join(shared, store.NAME)):  # noqa: PTH110, PTH118
        hint = "mount it under the same path everywhere, or use --ship to send clouds and results"
        return Reply(here, refusal=(f"the Dask worker {here} does not see the folder {shared}", hint))
    start = time.monotonic()
    outcomes: list[Outcome] = []
    unseen: list[str] = []
    try:
        with _processes.lend(order.settings, settings) as process, _ended_when_unwanted(process):
            for task in order.tasks:
                if process.closed or time.monotonic() - start > order.seconds:
                    break
                if task.content is None and not os.path.lexists(task.cloud):
                    unseen.append(task.key)
                outcome = process.run_job(task)
                if process.closed:
                    # By us: that is nothing about the cloud, should somebody want to know after all.
                    break
                outcomes.append(outcome)
    except DlogenError as error:
        return Reply(here, refusal=(f"the Dask worker {here}: {error.message}", error.hint))
    except OSError as error:
        hint = "are there memory, processes and room for temporary files left on that machine?"
        return Reply(here, refusal=(f"the Dask worker {here} cannot start a process: {error.strerror or error}", hint))
    return Reply(here, tuple(outcomes), time.monotonic() - start, tuple(unseen))


class _Processes:
    """The worker processes of this Dask worker: one for each thread that is at it, kept from order to order."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[bytes, Worker, threading.Timer]] = []

    @contextmanager
    def lend(self, key: bytes, settings: ProcessSettings) -> Iterator[Worker]:
        """One for the time of the block. Idle ones with other settings end."""
        with self._lock:
            same = [entry for entry in self._idle if entry[0] == key]
            others = [entry for entry in self._idle if entry[0] != key]
            taken = same.pop() if same else None
            self._idle = same
        for entry in (*others, *([taken] if taken else [])):
            entry[2].cancel()
        for _, worker, _ in others:
            worker.close()
        worker = taken[1] if taken else Worker(settings.plan, timeout=settings.timeout, memory=settings.memory)
        try:
            yield worker
        except BaseException:
            worker.close()
            raise
        if worker.closed:
            return
        timer = threading.Timer(IDLE_SECONDS, self._end, (worker,))
        timer.daemon = True
        with self._lock:
            self._idle.append((key, worker, timer))
        timer.start()

    def close(self) -> None:
        """End all that are idle. Those at work end with this process."""
        with self._lock:
            entries, self._idle = self._idle, []
        for _, worker, timer in entries:
            timer.cancel()
            worker.close()

    def _end(self, worker: Worker) -> None:
        with self._lock:
            idle = any(entry[1] is worker for entry in self._idle)
            self._idle = [entry for entry in self._idle if entry[1] is not worker]
        if idle:
            worker.close()


_processes = _Processes()
atexit.register(_processes.close)


@contextmanager
def _ended_when_unwanted(process: Worker) -> Iterator[None]:
    """Ends the process as soon as nobody waits for the task of this thread any more.

    Dask does not interrupt a task that is cancelled, or whose client is gone: it would go on to write results, perhaps
    over those of the next run.
    """
    from distributed import get_worker

    dask_worker = get_worker()
    key = dask_worker.get_current_task()
    over = threading.Event()

    def look() -> None:
        while not over.wait(_LOOK_SECONDS):
            task = dask_worker.state.tasks.get(key)
            if task is None or task.state != "executing":
                process.close()
                return

    watch = threading.Thread(target=look, daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        # Or it would end the process when the next order has it.
        watch.join()
