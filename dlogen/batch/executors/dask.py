"""A Dask cluster as the place where the work of a batch is done.

Clouds travel in batches, each a Dask task; what happens to them there is in
`dlogen.batch.executors.dask_worker`.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import queue
import time
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlogen._version import __version__
from dlogen.batch.executors.dask_worker import Call, Order, ProcessSettings, Reply
from dlogen.batch.failures import WORKER_DIED
from dlogen.batch.job import Failure, Outcome, Plan, Task, run_job
from dlogen.errors import DlogenError, UsageError

# Dask has types in some of its versions, for some of its functions: hence `unused-ignore` below.
if TYPE_CHECKING:
    from distributed import Client, Future

#: Seconds to look for the scheduler, and to wait for workers before saying so.
CONNECT_SECONDS, PATIENCE_SECONDS = 10.0, 5.0

#: Seconds to wait for the file that a scheduler writes when it has started.
FILE_SECONDS = 30.0

#: A Dask task costs its scheduler some milliseconds. Seconds that one should take, and clouds and bytes in it at most.
BATCH_SECONDS, BATCH_CLOUDS, BATCH_BYTES = 5.0, 100, 1 << 20

#: Dask tasks for each thread of the workers: one that it is at and one that waits. Clusters that adapt
#: take more workers as long as there is work for more than 5 seconds.
TASKS_PER_THREAD = 2

#: Seconds between looks at how many workers there are, and for saying goodbye.
_LOOK_SECONDS, _CLOSE_SECONDS = 1.0, 5.0

_GO_ON = "run the same command again: it goes on where it stopped"


class DaskPool:
    """The workers of a Dask cluster, as a `Pool`. They may come and go.

    Args:
        plan: what they do. With a folder, all machines have to see it, and the clouds, under the same absolute paths;
            without one, clouds have their bytes with them.
        scheduler: address, such as tcp://10.0.0.1:8786.
        total: number of clouds.
        timeout: seconds that a cloud may take.
        memory: bytes that a cloud may take.
        say: for messages to the user.
    """

    def __init__(
        self,
        plan: Plan,
        scheduler: str,
        total: int,
        *,
        timeout: float | None = None,
        memory: int | None = None,
        say: Callable[[str], None] = lambda message: None,
    ) -> None:
        self._ship = plan.folder is None
        self._plan = replace(plan, folder=None if plan.folder is None else os.path.abspath(plan.folder))  # noqa: PTH100
        self._settings = pickle.dumps(ProcessSettings(self._plan, timeout, memory))
        self._scheduler, self._total, self._say = scheduler, total, say

    def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
        """As `Pool.run`."""
        cluster = _Cluster(self._scheduler, self._say)
        try:
            batches = _Batches(tasks, self._total)
            while True:
                while batch := batches.next(cluster.vacancies(), len(cluster.under_way)):
                    # What cannot be read fails here, as it does without a cluster.
                    for task in filter(self._is_unreadable, batch):
                        yield run_job(self._plan, task)
                    readable = [task for task in batch if not self._is_unreadable(task)]
                    if readable:
                        cluster.submit(readable, self._order(readable))
                if batches.is_empty() and not cluster.under_way:
                    return
                arrival = cluster.wait()
                if arrival is None:
                    continue
                batch, reply = arrival
                if reply is None:
                    yield from batches.died(batch)
                    continue
                self._check_sight(batch, reply)
                batches.ended(batch, reply)
                yield from reply.outcomes
        finally:
            cluster.close()

    def _order(self, batch: Sequence[Task]) -> Order:
        if not self._ship:
            batch = [replace(task, cloud=os.path.abspath(task.cloud)) for task in batch]  # noqa: PTH100
        return Order(self._settings, tuple(batch), 2 * BATCH_SECONDS)

    def _is_unreadable(self, task: Task) -> bool:
        return (self._ship and task.content is None) or (task.config is not None and task.config_text is None)

    def _check_sight(self, batch: Sequence[Task], reply: Reply) -> None:
        """A file that is here but not there is no failure of its cloud."""
        for task in batch:
            if task.key in reply.unseen and os.path.lexists(task.cloud):
                raise DlogenError(
                    f"the Dask worker {reply.worker} does not see {os.path.abspath(task.cloud)}",  # noqa: PTH100
                    "mount it under the same path everywhere, or use --ship to send clouds and results",
                )


class _Batches:
    """Deals out the clouds: few at a time while it is not known how long they take, and again towards the end."""

    def __init__(self, tasks: Iterator[Task], total: int) -> None:
        self._tasks, self._left = tasks, total
        #: Given back; they go first.
        self._again: deque[list[Task]] = deque()
        #: Those whose workers died, though each was in a task of its own: they may have been next to the one that did
        #: it. They go last, when there is nothing else.
        self._suspects: deque[Task] = deque()
        self._suspected: set[str] = set()
        self._seconds: float | None = None
        self._next = next(tasks, None)

    def is_empty(self) -> bool:
        """Whether nothing is left but what is under way."""
        return self._next is None and not self._again and not self._suspects

    def next(self, vacancies: int, under_way: int) -> list[Task]:
        """A batch for one of so many vacant places; empty if there is none now."""
        if not vacancies:
            return []
        if self._again:
            return self._again.popleft()
        if self._next is None:
            return [self._suspects.popleft()] if self._suspects and not under_way else []
        wanted = 1 if self._seconds is None else int(BATCH_SECONDS / max(self._seconds, 1e-6))
        wanted = min(wanted, BATCH_CLOUDS, self._left // (vacancies + under_way))
        batch: list[Task] = []
        size = 0
        while self._next is not None and (not batch or (len(batch) < wanted and size < BATCH_BYTES)):
            batch.append(self._next)
            size += len(self._next.content or b"")
            self._next = next(self._tasks, None)
        self._left -= len(batch)
        return batch

    def ended(self, batch: list[Task], reply: Reply) -> None:
        """A batch came back, perhaps with clouds that have still to be done."""
        done = len(reply.outcomes)
        if batch[done:]:
            self._again.append(batch[done:])
        if done:
            each = reply.seconds / done
            # Few of the others come at the same time: an average of the last ten or so.
            self._seconds = each if self._seconds is None else 0.9 * self._seconds + 0.1 * each

    def died(self, batch: list[Task]) -> Iterator[Outcome]:
        """Several Dask workers died that had this batch; yields the outcome of a cloud that is to blame."""
        if len(batch) > 1:
            self._again.extend([task] for task in batch)
        elif batch[0].key not in self._suspected:
            self._suspected.add(batch[0].key)
            self._suspects.append(batch[0])
        else:
            hint = "the logs of the Dask workers say why; if memory ran out, give --memory or ask for more per worker"
            yield Outcome(batch[0].key, Failure(WORKER_DIED.code, "every Dask worker that was at it died", hint))


class _Cluster:
    """The connection to a scheduler, with the tasks that it has."""

    def __init__(self, scheduler: str, say: Callable[[str], None]) -> None:
        self._scheduler, self._say = scheduler, say
        self._client = _connect(scheduler)
        self.under_way: dict[str, tuple[Future[Any], list[Task]]] = {}
        self._arrived: queue.SimpleQueue[tuple[str, Reply | BaseException]] = queue.SimpleQueue()
        self._run = f"dlogen-{uuid.uuid4().hex}"
        self._count = 0
        self._threads = 0
        self._looked = float("-inf")
        #: Since when there is no worker.
        self._alone_since: float | None = time.monotonic()

    def vacancies(self) -> int:
        """How many tasks more the workers should have."""
        now = time.monotonic()
        if now - self._looked >= _LOOK_SECONDS:
            self._looked = now
            self._threads = sum(self._ask(self._client.nthreads).values())
            if self._threads:
                self._alone_since = None
            elif self._alone_since is None:
                self._alone_since = now
            elif now - self._alone_since > PATIENCE_SECONDS:
                self._say(f"no Dask worker is connected to {self._scheduler}: waiting for one")
                self._alone_since = float("inf")
        # Clusters that adapt have no workers until there is something to do.
        return max(0, TASKS_PER_THREAD * max(self._threads, 1) - len(self.under_way))

    def submit(self, batch: list[Task], order: Order) -> None:
        """Send a batch."""
        self._count += 1
        key = f"{self._run}-{self._count}"
        call = pickle.dumps(Call(order), protocol=pickle.HIGHEST_PROTOCOL)
        future = self._ask(self._client.submit, pickle.loads, call, key=key, pure=False)
        self.under_way[key] = (future, batch)
        # The result is fetched by a thread of Dask's: here, it could be waited for without end if its worker dies now.
        future.add_done_callback(partial(_fetch, key, self._arrived))

    def wait(self) -> tuple[list[Task], Reply | None] | None:
        """The next batch that comes back, or None after a while. Without a reply if several workers died over it.

        Raises:
            DlogenError: the cluster cannot do the work.
        """
        try:
            key, reply = self._arrived.get(timeout=_LOOK_SECONDS / 2)
        except queue.Empty:
            return None
        future, batch = self.under_way.pop(key)
        if isinstance(reply, BaseException):
            if _is_killed_worker(reply):
                return batch, None
            raise self._why(reply)
        # The scheduler forgets it.
        future.release()  # type: ignore[no-untyped-call, unused-ignore]
        if reply.refusal is not None:
            raise DlogenError(*reply.refusal)
        return batch, reply

    def close(self) -> None:
        """Cancel what is under way. The workers notice within a second."""
        # Whatever goes wrong, there is nothing more to be had from the connection.
        with contextlib.suppress(Exception):
            self._client.cancel([future for future, _ in self.under_way.values()])  # type: ignore[no-untyped-call, unused-ignore]
        with contextlib.suppress(Exception):
            self._client.close(timeout=_CLOSE_SECONDS)  # type: ignore[no-untyped-call, unused-ignore]

    def _ask(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """The answer of the scheduler."""
        try:
            return function(*args, **options)
        except Exception as error:
            raise self._why(error) from error

    def _why(self, error: BaseException) -> DlogenError:
        """What an error that is not of a cloud means."""
        if isinstance(error, ImportError):
            return DlogenError(
                f"a Dask worker does not have dlogen: {error}",
                f"install the same version everywhere: pip install dlogen=={__version__}",
            )
        # Dask has its own and asyncio's.
        if isinstance(error, OSError) or "Cancelled" in type(error).__name__:
            return DlogenError(f"lost the Dask scheduler at {self._scheduler}", f"when it is back, {_GO_ON}")
        return DlogenError(
            f"the Dask cluster cannot do the work: {type(error).__name__}: {error}",
            f"does it have the same versions of Python, Dask and dlogen ({__version__})?",
        )


def scheduler_of(path: str, patience: float = FILE_SECONDS) -> str:
    """The address in a file that a scheduler has written (`dask scheduler --scheduler-file`).

    Args:
        path: of the file.
        patience: seconds to wait for the file. A script starts the scheduler and goes on at once, and the scheduler
            takes some seconds until it writes it.

    Raises:
        UsageError: it is not such a file.
    """
    given_up = time.monotonic() + patience
    while True:
        try:
            return str(json.loads(Path(path).read_text(encoding="utf-8"))["address"])
        except OSError as error:
            reason, hint = (
                f"cannot be read: {error.strerror}",
                "dask scheduler --scheduler-file writes it when it starts",
            )
            may_come = isinstance(error, FileNotFoundError)
        except (ValueError, LookupError, TypeError) as error:
            reason, hint = "is not the scheduler file of Dask", "it is JSON with an address"
            may_come = isinstance(error, ValueError) and not Path(path).stat().st_size  # it is being written
        if not may_come or time.monotonic() >= given_up:
            raise UsageError(reason, hint, path=path)
        time.sleep(0.1)


def _fetch(key: str, arrived: queue.SimpleQueue[tuple[str, Reply | BaseException]], future: Future[Any]) -> None:
    try:
        arrived.put((key, future.result()))
    except BaseException as error:  # of the task, or because it was cancelled
        arrived.put((key, error))


def _is_killed_worker(error: BaseException) -> bool:
    from distributed.scheduler import KilledWorker

    return isinstance(error, KilledWorker)


def _connect(scheduler: str) -> Client:
    from distributed import Client
    from distributed.comm.addressing import get_address_host_port

    hint = "dask scheduler prints its address when it starts, such as tcp://10.0.0.1:8786"
    try:
        # A client with a wrong address takes half a minute to give up.
        get_address_host_port(scheduler)
    except ValueError as error:
        raise UsageError(f"--scheduler {scheduler!r} is not an address: {error}", hint) from None
    try:
        return Client(  # type: ignore[no-untyped-call, unused-ignore]
            scheduler, timeout=CONNECT_SECONDS, set_as_default=False, name="dlogen"
        )
    except (OSError, ValueError, TypeError, ImportError, RuntimeError) as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DlogenError(
            f"cannot connect to a Dask scheduler at {scheduler}: {said}", f"{hint}; is it reachable from here?"
        ) from error


def prepare_dask(verbose: bool) -> None:
    """Import Dask.

    Args:
        verbose: let its own messages through.

    Raises:
        DlogenError: it is not installed.
    """
    try:
        import distributed
    except ImportError as error:
        raise DlogenError(f"--scheduler needs dask.distributed: {error}", "pip install 'dlogen[distributed]'") from None
    if not verbose:
        # What matters is said as errors of ours.
        for name in (
            "distributed",
            "distributed.client",
            "distributed.gc",
            "tornado",
            "tornado.application",
            "asyncio",
        ):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        warnings.filterwarnings("ignore", module=rf"{distributed.__name__}\.")
