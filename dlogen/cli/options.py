"""Options that several commands have."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from dlogen.batch.executors.pool import Pool
    from dlogen.batch.job import Plan
    from dlogen.cli.console import Console

_Function = Callable[..., Any]


def config_options(function: _Function) -> _Function:
    """`-c`, `--set`, `--profile`: the command gets `config_path` and `overrides`."""

    @wraps(function)
    def wrapped(*args: Any, overrides: tuple[str, ...], profile: str | None, **rest: Any) -> Any:
        # A flag wins over --set.
        flags = [] if profile is None else [f"profile={profile}"]
        return function(*args, overrides=(*overrides, *flags), **rest)

    return _with(
        wrapped,
        click.option(
            "-c", "--config", "config_path", metavar="FILE", help="YAML configuration, see dlogen config show."
        ),
        click.option(
            "--set", "overrides", metavar="KEY=VALUE", multiple=True, help="Set one configuration key; repeatable."
        ),
        click.option("--profile", type=click.Choice(["refined", "paper"]), help="Shorthand for --set profile=..."),
    )


def format_option(default: str) -> Callable[[_Function], _Function]:
    """`--format`: the command gets `formats`."""
    return click.option(
        "--format",
        "formats",
        metavar="NAME,...",
        default=default,
        show_default=True,
        help="Model formats to write (see dlogen formats), or all.",
    )


def units_option(what: str, *choices: str) -> Callable[[_Function], _Function]:
    """`--units`: the command gets `units`; metres, or the first of the choices before it, by default."""
    return click.option(
        "--units",
        type=click.Choice([*choices, "m", "cm", "mm"]),
        default=[*choices, "m"][0],
        show_default=True,
        help=what,
    )


encoding_option = click.option(
    "--encoding", help="How the cloud is stored (see dlogen formats --json).  [default: binary]"
)


def worker_options(function: _Function) -> _Function:
    """Who does the work, and what a cloud may take: the command gets `workers`, a `Workers`."""

    @wraps(function)
    def wrapped(
        *args: Any,
        jobs: int | None,
        timeout: float | None,
        memory: int | None,
        scheduler: str | None,
        scheduler_file: str | None,
        ship: bool,
        **rest: Any,
    ) -> Any:
        return function(*args, workers=Workers(jobs, timeout, memory, scheduler, scheduler_file, ship), **rest)

    return _with(
        wrapped,
        click.option("-j", "--jobs", type=click.IntRange(1), metavar="N", help="Processes.  [default: all cores]"),
        click.option(
            "--timeout",
            # Longer ones are more than the system's clocks can wait.
            type=click.FloatRange(0.0, 1e9, min_open=True),
            metavar="SECONDS",
            help="Time that a cloud may take.",
        ),
        click.option("--memory", type=_Size(), metavar="SIZE", help="Memory that a cloud may take, such as 2G."),
        click.option(
            "--scheduler", metavar="ADDRESS", help="Let a Dask cluster do the work (needs dlogen[distributed])."
        ),
        click.option(
            "--scheduler-file", metavar="FILE", help="As --scheduler, with the address from the scheduler's own file."
        ),
        click.option("--ship", is_flag=True, help="Send clouds and results: the cluster does not see the files here."),
    )


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


class _Size(click.ParamType):
    """A number of bytes, with the units of people: 500M, 2G, 1.5GB."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([kMGT]?)(?:i?B)?\s*", value, re.IGNORECASE)
        size = float(match[1]) * 1024 ** " KMGT".index(match[2].upper() or " ") if match else 0.0
        if size < 1.0:
            self.fail(f"{value!r} is not a size such as 500M or 2G.", param, ctx)
        return int(size)


def _with(function: _Function, *options: Callable[[_Function], _Function]) -> _Function:
    """With these options, in this order."""
    for option in reversed(options):
        function = option(function)
    return function


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
