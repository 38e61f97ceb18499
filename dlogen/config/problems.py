"""How to say that something is wrong with a configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dlogen.config.fields import Setting
from dlogen.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Problem:
    """Something wrong with a configuration.

    Attributes:
        where: the place in the input ("line 3"), or nothing.
        message: what is wrong.
        hint: what to try.
    """

    where: str
    message: str
    hint: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


def wrong_value(where: str, key: str, value: object, setting: Setting, hint: str) -> Problem:
    """A value that a setting does not allow."""
    if value is None and not hint:
        hint = "leave the key out for the default" + (", or write auto" if setting.auto is not None else "")
    return Problem(where, f"{key} = {show(value)}: expected {setting.expected}", hint or setting.help)


def refuse(problems: Sequence[Problem], path: str | Path | None = None) -> None:
    """Raise one `ConfigError` that names all problems; nothing happens when there are none."""
    if len(problems) == 1:
        raise ConfigError(str(problems[0]), problems[0].hint, path=path)
    if problems:
        listed = "".join(f"\n  {problem} ({problem.hint})" for problem in problems)
        hint = "dlogen config show lists all keys and what they may hold"
        raise ConfigError(f"{len(problems)} problems:{listed}", hint, path=path)


def show(value: object) -> str:
    """A value as the user wrote it, about: shortened, and without characters that would garble the message."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a section"
    if isinstance(value, (list, tuple)):
        return "a list"
    if isinstance(value, int) and abs(value) > 10**30:
        return "a very large number"
    # repr escapes what is not printable.
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
