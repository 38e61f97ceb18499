"""Worker processes on this machine as the place where the work of a batch is done."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Iterator

from dlogen.batch.executors.worker import NotStarted, Worker
from dlogen.batch.job import Outcome, Plan, Task


class LocalPool:
    """So many worker processes.

    Args:
        plan: what they do.
        jobs: number of processes.
        timeout: seconds that a cloud may take.
        memory: bytes that a cloud may take, beyond what the program itself does.
    """

    def __init__(self, plan: Plan, jobs: int, *, timeout: float | None = None, memory: int | None = None) -> None:
        self.plan, self.jobs, self.timeout, self.memory = plan, jobs, timeout, memory

    def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
        """As `Pool.run`. One task more than there are workers is waiting, so that none is idle."""
        inbox: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        results: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        workers: list[Worker] = []
        under_way = not_started = 0
        try:
            while True:
                while under_way <= self.jobs and (task := next(tasks, None)) is not None:
                    inbox.put(task)
                    under_way += 1
                    if len(workers) < self.jobs:
                        workers.append(Worker(self.plan, timeout=self.timeout, memory=self.memory))
                        threading.Thread(target=_serve, args=(workers[-1], inbox, results), daemon=True).start()
                if not under_way:
                    return
                result = _interruptibly(results)
                if isinstance(result, NotStarted):
                    not_started += 1
                    if not_started == len(workers):
                        raise result
                elif isinstance(result, Exception):
                    raise result
                else:
                    under_way -= 1
                    yield result
        finally:
            for worker in workers:
                worker.close()
                inbox.put(None)


def _serve(
    worker: Worker, inbox: queue.SimpleQueue[Task | None], results: queue.SimpleQueue[Outcome | Exception]
) -> None:
    while (task := inbox.get()) is not None:
        try:
            results.put(worker.run_job(task))
        except NotStarted as error:
            # The others do it: there may be room for fewer workers than the user thought.
            inbox.put(task)
            results.put(error)
            return
        except Exception as error:  # of ours: it must not be lost in a thread
            results.put(error)


def _interruptibly(results: queue.SimpleQueue[Outcome | Exception]) -> Outcome | Exception:
    """The next result. On Windows a wait without end would not hear Ctrl-C."""
    while True:
        try:
            return results.get(timeout=1.0)
        except queue.Empty:
            continue
