"""Checked values by dotted key, from nested data and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dlogen.config.keys import Keys
from dlogen.config.problems import Problem, show, wrong_value

#: Values by dotted key.
Values = dict[str, Any]


def flat(nested: Mapping[str, Any]) -> Values:
    """Nested data, with mappings for sections, by dotted key."""
    values: Values = {}
    for name, value in nested.items():
        values |= (
            {f"{name}.{leaf}": item for leaf, item in value.items()} if isinstance(value, Mapping) else {name: value}
        )
    return values


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted key as nested data; the opposite of `flat`."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        section, _, name = key.rpartition(".")
        (out.setdefault(section, {}) if section else out)[name] = value
    return out


def read_value(keys: Keys, key: str, value: object, where: str, problems: list[Problem]) -> Values:
    """One checked value under its key. If it is not allowed, nothing, and a problem is added."""
    setting = keys.settings[key]
    try:
        return {key: setting.read(value)}
    except ValueError as error:
        problems.append(wrong_value(where, key, value, setting, str(error)))
        return {}


def read_mapping(
    keys: Keys, data: object, where: Callable[[tuple[object, ...]], str] = lambda path: ""
) -> tuple[Values, list[Problem]]:
    """Nested data as a YAML file has it.

    Args:
        keys: the keys that there are.
        data: a mapping, with mappings for sections.
        where: says where a path of keys stands in the input.
    """
    if not isinstance(data, Mapping):
        return {}, [Problem("", f"expected keys and values, got {show(data)}", "write `key: value`, one a line")]
    values: Values = {}
    problems: list[Problem] = []
    paths: dict[str, tuple[object, ...]] = {}

    def take(path: tuple[object, ...], section: str, value: object) -> None:
        name = path[-1]
        key = keys.find(f"{section}.{name}" if section else name)
        if key is None:
            problems.append(keys.unknown(where(path), name, section))
        elif "." in key and not section:
            inner, _, leaf = key.partition(".")
            problems.append(
                Problem(where(path), f"unknown key {show(name)}", f"write it in its section: {inner}: {{{leaf}: ...}}")
            )
        elif key in paths:
            first = paths[key]
            place = f" in {where(first)}" if where(first) else ""
            problems.append(Problem(where(path), f"{name} and {first[-1]}{place} are the same key", "keep one of them"))
        else:
            paths[key] = path
            values.update(read_value(keys, key, value, where(path), problems))

    for name, value in data.items():
        if not isinstance(name, str) or name not in keys.sections:
            take((name,), "", value)
        elif isinstance(value, Mapping):
            for inner, item in value.items():
                take((name, inner), name, item)
        elif value is not None:  # None: a section whose keys are all commented out
            hint = f"its keys: {', '.join(keys.of_section(name))}"
            problems.append(Problem(where((name,)), f"{name} = {show(value)}: expected a section", hint))
    return values, problems
