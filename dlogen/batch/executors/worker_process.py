"""A worker process of a batch: takes clouds from its standard input, one after another, and answers on standard output.

The parent is told by end of file, on either side: a worker whose parent is gone ends at once, whatever it is at.
"""

from __future__ import annotations

import gc
import importlib
import math
import os
import pickle
import queue
import threading
from dataclasses import replace
from typing import Any, BinaryIO

from dlogen.batch.job import Task, run_job

_NEEDED = (
    "dlogen.io.cloud_files",
    "dlogen.io.clouds.ply",
    "dlogen.io.report",
    "dlogen.pipeline",
    "dlogen.batch.metrics",
    "dlogen.stages.refined.ordering",
    "dlogen.stages.refined.refine",
    "dlogen.stages.quality.cut_ends",
)


#: More than any machine has, and less than the system's numbers can be.
_MOST_MEMORY = 1 << 60


def main() -> None:
    """Entry point; the pool starts it. First comes (plan, memory limit in bytes or None), then tasks."""
    # Only answers may go to the pipe: what a library prints goes to the log.
    inbox, outbox = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    plan, memory = pickle.load(inbox)
    # All that most clouds need, so that a limit of time is about the cloud.
    for module in _NEEDED:
        importlib.import_module(module)
    if memory is not None:
        # And that all else is there which is taken once and kept, such as the buffers of OpenBLAS: without room for
        # those it ends the process, or tries for ever.
        run_job(replace(plan, folder=None), Task("arc.ply", "arc", content=_arc()))
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
    # Before there is a limit: its stack is memory as well.
    threading.Thread(target=_listen, args=(inbox, tasks), daemon=True).start()
    if memory is not None:
        limit_memory(memory)
    # What is there now stays: garbage collections that pass it over make a fit 5 % faster.
    gc.freeze()
    _answer(outbox, "ready")
    while True:
        _answer(outbox, run_job(plan, tasks.get()))


def _arc() -> bytes:
    """A small cloud that is easy to work on: a bent tube, as a PLY file."""
    lines = [
        "ply",
        "format ascii 1.0",
        "element vertex 400",
        *(f"property float {axis}" for axis in "xyz"),
        "end_header",
    ]
    for i in range(400):
        # Around the tube by the golden angle: even, and never twice in the same direction.
        bend, turn = i / 400, 2.4 * i
        distance = 0.4 + 0.01 * math.cos(turn)
        lines.append(f"{distance * math.cos(bend)} {distance * math.sin(bend)} {0.01 * math.sin(turn)}")
    return "\n".join([*lines, ""]).encode()


def _listen(inbox: BinaryIO, tasks: queue.SimpleQueue[Task]) -> None:
    try:
        while True:
            tasks.put(pickle.load(inbox))
    finally:  # the parent is gone, or speaks another language
        os._exit(0)


def _answer(outbox: BinaryIO, what: Any) -> None:
    try:
        pickle.dump(what, outbox, protocol=pickle.HIGHEST_PROTOCOL)
        outbox.flush()
    except OSError:
        os._exit(0)


def limit_memory(limit: int) -> None:
    """Let this process take so many bytes more than it has now. Beyond, allocations fail with MemoryError."""
    import resource

    with open("/proc/self/statm", encoding="ascii") as stream:  # noqa: PTH123
        taken = int(stream.read().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = [min(taken + limit, _MOST_MEMORY)] + [value for value in (soft, hard) if value != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min(wanted), hard))


def can_limit_memory() -> bool:
    """Whether this system has what `limit_memory` needs."""
    try:
        import resource
    except ImportError:
        return False
    return hasattr(resource, "RLIMIT_AS") and os.path.exists("/proc/self/statm")  # noqa: PTH110
