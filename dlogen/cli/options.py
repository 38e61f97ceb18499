"""Options that several commands have."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    pass

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
        from dlogen.cli.workers import Workers

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
