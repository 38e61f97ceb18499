"""Types of command line parameters that click does not have."""

from __future__ import annotations

import math
from typing import Any

import click


class Number(click.FloatRange):
    """A finite number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """As click's, without nan and inf."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class Auto(click.ParamType):
    """A number above 0, or "auto", which becomes None."""

    name = "auto|number"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float | None:
        """The number, or None."""
        if value == "auto":
            return None
        try:
            return Number(0.0, min_open=True).convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is neither auto nor a number above 0.", param, ctx)


class Numbers(click.ParamType):
    """A tuple of finite numbers: `Numbers("X,Y,Z")`, `Numbers("S0:S1")`.

    Args:
        form: names of the numbers and what separates them.
    """

    def __init__(self, form: str) -> None:
        self.name = form
        self.separator = "," if "," in form else ":"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """The numbers."""
        if isinstance(value, tuple):
            return value
        words = str(value).split(self.separator)
        try:
            numbers = tuple(float(word) for word in words)
        except ValueError:
            numbers = ()
        if len(numbers) != self.name.count(self.separator) + 1 or not all(map(math.isfinite, numbers)):
            self.fail(f"{value!r} is not {self.name}, finite numbers without blanks.", param, ctx)
        return numbers


class Count(click.ParamType):
    """A whole number from 1 on, or "all", which becomes None."""

    name = "count|all"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | None:
        """The number, or None."""
        if value == "all":
            return None
        try:
            return int(click.IntRange(1).convert(value, param, ctx))
        except click.BadParameter:
            self.fail(f"{value!r} is neither all nor a whole number from 1 on.", param, ctx)
