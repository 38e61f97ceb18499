"""Messages for people: stderr only, stdout is for data."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click


def use_colour() -> bool:
    """Colour only on a terminal, and never when NO_COLOR is set (https://no-color.org)."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


class Console:
    """Writes messages to stderr at the level that the user chose.

    Args:
        level: -1 with `-q` (errors only), 0 by default, 1 with `-v`.
    """

    def __init__(self, level: int = 0) -> None:
        self.level = level

    def info(self, message: str) -> None:
        """A result or a step that everybody wants to see, unless quiet."""
        if self.level >= 0:
            click.echo(message, err=True)

    def detail(self, message: str) -> None:
        """Shown with `-v`."""
        if self.level >= 1:
            click.echo(message, err=True)

    def warning(self, message: str) -> None:
        """Something is not as it should be; shown unless quiet."""
        if self.level >= 0:
            click.echo(_styled("warning: ", fg="yellow") + message, err=True)

    def error(self, message: str, hint: str | None = None) -> None:
        """Always shown."""
        click.echo(_styled("error: ", fg="red", bold=True) + message, err=True)
        if hint:
            click.echo(_styled("hint: ", fg="cyan") + hint, err=True)

    def hint(self, message: str) -> None:
        """What to try about a warning; shown unless quiet."""
        if self.level >= 0:
            click.echo(_styled("hint: ", fg="cyan") + message, err=True)

    @contextmanager
    def status(self, message: str) -> Iterator[None]:
        """A spinner while something runs, on a terminal only."""
        if self.level < 0 or not sys.stderr.isatty():
            yield
            return
        from rich.console import Console as RichConsole

        with RichConsole(stderr=True, no_color=not use_colour()).status(message):
            yield


def _styled(text: str, **style: Any) -> str:
    return click.style(text, **style) if use_colour() else text


def print_json(data: Any) -> None:
    """Data to stdout: the same text for the same data."""
    # Imported here: `dlogen --help` need not wait for it.
    from dlogen.io.json_text import dump_json

    click.echo(dump_json(data), nl=False)
