"""How far a batch is: a bar on a terminal, a plain line now and then in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dlogen.cli.console import Console, use_colour

if TYPE_CHECKING:
    from collections.abc import Callable

#: Seconds between the lines in a log: many at first, fewer when it takes long.
_FIRST, _LATER, _LATER_AFTER = 10.0, 60.0, 600.0


@contextmanager
def progress(console: Console, total: int, *, bar: bool = True) -> Iterator[Callable[[int, int], None]]:
    """Shows the progress while the block runs.

    Args:
        console: what the user wants to see.
        total: number of clouds.
        bar: whether there may be a bar.

    Yields:
        A function to be called with the clouds that are done and those that failed.
    """
    if console.level < 0 or not total:
        yield lambda done, failed: None
    elif bar and sys.stderr.isatty():
        yield from _bar(total)
    else:
        yield _lines(console, total)


def _bar(total: int) -> Iterator[Callable[[int, int], None]]:
    from rich.console import Console as RichConsole
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[failed]}"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    start = time.monotonic()
    terminal = RichConsole(stderr=True, no_color=not use_colour())
    # Standard output is for data, and may lead elsewhere.
    with Progress(*columns, console=terminal, transient=True, redirect_stdout=False) as bar:
        task = bar.add_task("", total=total, failed="", rate="")

        def show(done: int, failed: int) -> None:
            rate = (done + failed) / max(time.monotonic() - start, 1e-3)
            bar.update(task, completed=done + failed, failed=_failures(failed), rate=f"{rate:.1f}/s")

        yield show


def _lines(console: Console, total: int) -> Callable[[int, int], None]:
    start = time.monotonic()
    last = start

    def show(done: int, failed: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= (_FIRST if now - start < _LATER_AFTER else _LATER):
            last = now
            console.info(line(done, failed, total, now - start))

    return show


def line(done: int, failed: int, total: int, seconds: float) -> str:
    """`420 of 1000 clouds (3 failed), 8.2 a second, 1 min 11 s left`."""
    ended = done + failed
    rate = ended / max(seconds, 1e-3)
    left = duration((total - ended) / rate) if ended else "?"
    failures = f" ({_failures(failed)})" if failed else ""
    return f"{ended} of {total} clouds{failures}, {rate:.1f} a second, {left} left"


def duration(seconds: float) -> str:
    """As people say it."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole % 3600 // 60
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {whole % 60} s" if minutes else f"{whole} s"


def _failures(failed: int) -> str:
    return f"{failed} failed" if failed else ""
