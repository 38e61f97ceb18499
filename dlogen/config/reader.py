"""Reading a configuration: from mappings, YAML files and KEY=VALUE texts to checked values by dotted key."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dlogen.config.fields import Keys, Problem, refuse, show, wrong_value
from dlogen.errors import ConfigError

#: A larger file is something else, given by mistake.
MAX_BYTES = 100_000

#: Values by dotted key.
Values = dict[str, Any]


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


def read_file(keys: Keys, path: str | Path, text: str | None = None) -> tuple[Values, dict[str, str]]:
    """A YAML file, or standard input for "-": its values, and for each of them where it stands.

    Args:
        keys: the keys that there are.
        path: the file.
        text: what it holds, if somebody has read it already.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong. All that is wrong is named.
    """
    from dlogen.config.strict_yaml import parse

    name = "standard input" if str(path) == "-" else str(path)
    text = read_text(path) if text is None else text
    try:
        document = parse(text)
    except ConfigError as error:
        raise ConfigError(error.message, error.hint, path=name) from None

    def line(path: tuple[object, ...]) -> int:
        return document.lines.get(tuple(str(key) for key in path), 0)

    def where(path: tuple[object, ...]) -> str:
        return f"line {line(path)}" if line(path) else ""

    problems = [
        Problem(f"line {again}", f"{show('.'.join(path))} is given twice, first in line {first}", "keep one of them")
        for path, first, again in document.duplicates
    ]
    values, wrong = read_mapping(keys, {} if document.data is None else document.data, where)
    refuse(sorted(problems + wrong, key=lambda problem: int(problem.where[len("line ") :] or 0)), name)
    places = {keys.find(".".join(path)): f"{name}, line {number}" for path, number in document.lines.items()}
    return values, {key: places[key] for key in values}


def read_text(path: str | Path) -> str:
    """The text of a configuration file, or of standard input for "-".

    Raises:
        ConfigError: it cannot be read, is too large, or not UTF-8.
    """
    name = "standard input" if str(path) == "-" else str(path)
    try:
        if str(path) == "-":
            raw = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(path).open("rb") as stream:
                raw = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        hint = "dlogen config show > my.yaml writes one to start from"
        raise ConfigError("no such configuration file", hint, path=name) from None
    except IsADirectoryError:
        raise ConfigError("a folder, not a configuration file", "name a YAML file in it", path=name) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ConfigError(f"cannot be read: {reason}", "check its name and permissions", path=name) from None
    if len(raw) > MAX_BYTES:
        hint = "-c takes a YAML file; clouds are given without a flag"
        raise ConfigError(f"larger than {MAX_BYTES // 1000} kB: not a configuration", hint, path=name)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"line {line}: not UTF-8 text", "save it as UTF-8", path=name) from None


def read_override(keys: Keys, text: str, problems: list[Problem]) -> tuple[Values, dict[str, str]]:
    """A "KEY=VALUE" with a dotted key: the value, and where it stands. Adds a problem if it is not allowed."""
    from dlogen.config.strict_yaml import resolve

    shown = text if len(text) <= 60 else f"{text[:57]}..."
    where = f"--set {shown if shown.isprintable() else ascii(shown)}"
    name, equals, value = (part.strip() for part in text.partition("="))
    key = keys.find(name)
    if not equals:
        problems.append(Problem(where, "expected KEY=VALUE", "such as --set e_max=0.005"))
    elif name in keys.sections:
        example = f"{name}.{next(iter(keys.of_section(name)))}"
        problems.append(Problem(where, f"{name} is a section", f"set its keys, such as --set {example}=..."))
    elif key is None:
        problems.append(keys.unknown(where, name))
    else:
        # A text is taken as it is: --set material.name=316 needs no quotes.
        read = read_value(keys, key, value if keys.settings[key].kind == "text" else resolve(value), where, problems)
        return read, dict.fromkeys(read, where)
    return {}, {}
