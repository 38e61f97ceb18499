"""What a worker of a cluster does: processes of its own, kept for the next order, and orders that run out of time."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import pytest

from dlogen.batch.executors import dask_worker
from dlogen.batch.job import Plan

if sys.platform == "win32":
    pytest.skip("signals", allow_module_level=True)

# Generous: the machine may be busy.
DEADLINE = 90.0


def wait_for(condition: Callable[[], Any]) -> Any:
    """Its value, as soon as it is true."""
    limit = time.monotonic() + DEADLINE
    while not (value := condition()):
        assert time.monotonic() < limit, "waited too long"
        time.sleep(0.02)
    return value


class TestProcesses:
    def test_kept_for_the_next_order_and_ended_for_others(self) -> None:
        processes = dask_worker._Processes()
        settings = dask_worker.ProcessSettings(Plan(None))
        with processes.lend(b"one", settings) as first, processes.lend(b"one", settings) as second:
            assert first is not second
        with processes.lend(b"one", settings) as again:
            assert again in (first, second)
        with processes.lend(b"two", settings) as other:
            assert other not in (first, second)
        assert first.closed
        assert second.closed
        processes.close()
        assert other.closed

    def test_ended_when_idle(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(dask_worker, "IDLE_SECONDS", 0.01)
        processes = dask_worker._Processes()
        with processes.lend(b"one", dask_worker.ProcessSettings(Plan(None))) as worker:
            pass
        wait_for(lambda: worker.closed)
        with processes.lend(b"one", dask_worker.ProcessSettings(Plan(None))) as other:
            assert other is not worker
        processes.close()
