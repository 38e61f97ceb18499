"""Reading a configuration: YAML files and KEY=VALUE texts."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from dlogen.config.keys import Keys
from dlogen.config.problems import Problem, refuse, show
from dlogen.config.rules import contradictions
from dlogen.config.schema import Config, config_keys
from dlogen.config.values import Values, flat, nested, read_mapping, read_value
from dlogen.errors import ConfigError

#: A larger file is something else, given by mistake.
MAX_BYTES = 100_000


def load_config(
    path: str | Path | None = None,
    overrides: Sequence[str] = (),
    *,
    base: Config | None = None,
    text: str | None = None,
) -> Config:
    """Read a YAML file and apply overrides to it.

    Args:
        path: the file; "-" for standard input; None for the defaults.
        overrides: "KEY=VALUE" with dotted keys, such as "normals.neighbours=20". Later ones win over earlier ones, and
            all of them over the file.
        base: what the file and the overrides change; the defaults if left out.
        text: what the file holds, where that is known already; it is not opened then.

    Returns:
        The configuration; what is said nowhere has its default.

    Raises:
        ConfigError: the file cannot be read or is not YAML; a key is unknown, given twice or holds what it may not;
            two keys contradict each other. All that is wrong is named, with lines.

    >>> import dlogen
    >>> dlogen.load_config(None, ["e_max=0.005", "joints.dof=3"]).e_max
    0.005
    """
    values: Values = {} if base is None else flat(base.to_dict())
    places: dict[str, str] = {}
    if path is not None:
        read, places = read_file(config_keys(), path, text)
        values |= read
    problems: list[Problem] = []
    for override in overrides:
        value, place = read_override(config_keys(), override, problems)
        values |= value
        places |= place
    refuse(problems)
    refuse(contradictions(values, places))
    return Config.from_dict(nested(values))


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
