"""Who does the work of a batch: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dlogen.batch.executors.pool import Pool
    from dlogen.batch.job import Plan
    from dlogen.cli.console import Console


@dataclass(frozen=True)
class Workers:
    """Who does the work of a batch, as the options say.

    Attributes:
        jobs: number of processes on this machine; None for all cores.
        timeout: seconds that a cloud may take.
        memory: bytes that a cloud may take.
        scheduler, scheduler_file: of a Dask cluster.
        ship: send the clouds' bytes there, and take those of the results.
    """

    jobs: int | None
    timeout: float | None
    memory: int | None
    scheduler: str | None
    scheduler_file: str | None
    ship: bool

    def check(self) -> None:
        """Find out what is wrong before anything is done.

        Raises:
            UsageError: the options contradict each other, or this system cannot do what they say.
        """
        from dlogen.batch.executors.worker_process import can_limit_memory
        from dlogen.errors import UsageError

        if self.timeout is not None and math.isnan(self.timeout):
            raise UsageError("--timeout nan is not a time", "give it in seconds, such as 60")
        if self._cluster:
            if self.scheduler is not None and self.scheduler_file is not None:
                raise UsageError("--scheduler and --scheduler-file contradict each other", "keep one of them")
            if self.jobs is not None:
                raise UsageError(
                    "--jobs is for this machine, not for a cluster",
                    "leave it away: the Dask workers have their own number of threads",
                )
        elif self.ship:
            raise UsageError("--ship is for clusters", "give their --scheduler as well")
        elif self.memory is not None and not can_limit_memory():
            raise UsageError("--memory needs Linux", "leave it away, and use fewer --jobs")

    def pool(self, plan: Plan, clouds: int, console: Console) -> Pool:
        """For so many clouds.

        Raises:
            DlogenError: Dask is wanted, but not installed.
            UsageError: the scheduler's file cannot be read.
        """
        clouds = max(1, clouds)
        if self._cluster:
            # Dask is imported only when it is wanted.
            from dlogen.batch.executors.dask import DaskPool, prepare_dask, scheduler_of

            prepare_dask(verbose=console.level > 0)
            address = self.scheduler or scheduler_of(self.scheduler_file or "")
            return DaskPool(plan, address, clouds, timeout=self.timeout, memory=self.memory, say=console.info)
        from dlogen.batch.executors.local import LocalPool

        return LocalPool(plan, min(self.jobs or cores(), clouds), timeout=self.timeout, memory=self.memory)

    @property
    def _cluster(self) -> bool:
        return self.scheduler is not None or self.scheduler_file is not None


def cores(limits: Path = Path("/sys/fs/cgroup/cpu.max")) -> int:
    """Those that this process may use: by affinity, and by the share of time that its container has.

    Args:
        limits: where Linux says what a container has (control groups, version 2).
    """
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = limits.read_text(encoding="ascii").split()
        return min(count, max(1, round(int(quota) / int(period))))
    except (OSError, ValueError, ZeroDivisionError):  # no limit: the quota is "max"
        return count
