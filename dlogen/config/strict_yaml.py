"""YAML as a configuration should be read: YAML 1.2 core scalars, no surprises, and the line of every key.

PyYAML's own loader follows YAML 1.1: it reads `1e-3` as text, `on` as true, `010` as 8, `1:30` as 90, and keeps the
last of two equal keys. Here only its parser is used; what the scalars mean is decided below, by section 10.3 of the
YAML 1.2.2 specification. Tags, anchors and aliases are refused: a configuration needs none, and they are how YAML
files run code or grow without bound.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from dlogen.errors import ConfigError

#: Deeper nesting than this is no configuration.
MAX_DEPTH = 20

_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED_INTEGER = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(inf|Inf|INF)")
_WORDS: dict[str, object] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}
# Python refuses to convert longer ones (sys.set_int_max_str_digits); no setting needs a tenth of it.
_LONGEST_INTEGER = 400


@dataclass
class Document:
    """What a YAML text holds.

    Attributes:
        data: dicts, lists and scalars; None for an empty text.
        lines: line, counted from 1, of every mapping key by its path of keys.
        duplicates: path, first line and line of every key that came again; the first value is kept in `data`.
    """

    data: Any = None
    lines: dict[tuple[str, ...], int] = field(default_factory=dict)
    duplicates: list[tuple[tuple[str, ...], int, int]] = field(default_factory=list)


def resolve(text: str) -> object:
    """What an unquoted scalar means: None, bool, int, float or the text itself (YAML 1.2 core schema)."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) and len(text) <= _LONGEST_INTEGER:
        return int(text)
    if _BASED_INTEGER.fullmatch(text) and len(text) <= _LONGEST_INTEGER:
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITY.fullmatch(text):
        return float("-inf" if text.startswith("-") else "inf")
    return text


def parse(text: str) -> Document:
    """Read one YAML document.

    Raises:
        ConfigError: the text is not YAML, or uses tags, anchors, aliases, keys that are not scalars, several documents
            or more than `MAX_DEPTH` levels. The message starts with the line.
    """
    import yaml

    builder = _Builder()
    try:
        event: Any
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            line = event.start_mark.line + 1
            if isinstance(event, yaml.NodeEvent):
                _refuse_extras(event, line)
            if isinstance(event, yaml.ScalarEvent):
                builder.scalar(event.value, not event.style, line)
            elif isinstance(event, yaml.CollectionStartEvent):
                builder.start({} if isinstance(event, yaml.MappingStartEvent) else [], line)
            elif isinstance(event, yaml.CollectionEndEvent):
                builder.end()
            elif isinstance(event, yaml.DocumentStartEvent):
                builder.begin_document(line)
    except yaml.MarkedYAMLError as error:
        raise _syntax_error(error) from None
    except yaml.reader.ReaderError as error:
        number = text.count("\n", 0, error.position) + 1
        raise ConfigError(
            f"line {number}: the character U+{error.character:04X} is not allowed in YAML", "is this a text file?"
        ) from None
    except (ValueError, OverflowError) as error:
        # PyYAML converts escapes such as "\\U00110000" and the numbers of %YAML without checking them.
        raise ConfigError(f"not valid YAML: {error}", "write plain words and numbers") from None
    return builder.document


def _syntax_error(error: Any) -> ConfigError:
    """PyYAML's finding as a message with a line."""
    problem, mark = error.problem or "syntax error", error.problem_mark or error.context_mark
    hint = "write `key: value`, one a line, and indent the keys of a section by two spaces"
    if "'\\t'" in problem:
        problem, hint = "a tab where a space is needed", "indent with spaces"
    elif problem == "could not find expected ':'":
        # The scanner stands behind the word by now, often on the next line.
        problem, mark = "a ':' is missing", error.context_mark or mark
    where = f"line {mark.line + 1}: " if mark else ""
    return ConfigError(f"{where}not valid YAML: {problem}", hint)


def _refuse_extras(event: Any, line: int) -> None:
    """Refuse aliases, anchors and explicit tags."""
    anchor, tag = event.anchor, getattr(event, "tag", None)
    if anchor is not None:
        raise ConfigError(f"line {line}: anchors and aliases ({anchor!r}) are not supported", "write the value out")
    if tag is not None:
        short = tag.replace("tag:yaml.org,2002:", "!!")
        raise ConfigError(f"line {line}: tags ({short!r}) are not supported", "write the plain value without a tag")


class _Builder:
    """Makes dicts, lists and scalars from a stream of events. A stack, not recursion, so that depth can be bounded."""

    def __init__(self) -> None:
        self.document = Document()
        self.documents = 0
        self.path: list[str] = []  # the keys that lead to the next value
        self.open: list[dict[str, Any] | list[Any]] = []  # containers, the innermost last
        self.keys: list[str | None] = []  # for each of them the key that waits for its value
        self.repeated: list[bool] = []  # and whether it has that key already

    def begin_document(self, line: int) -> None:
        self.documents += 1
        if self.documents > 1:
            raise ConfigError(f"line {line}: a second document starts here", "keep one document in the file")

    def scalar(self, text: str, plain: bool, line: int) -> None:
        if self._wants_key():
            self._begin_key(text, line)
        else:
            self._put(resolve(text) if plain else text)
            self._value_done()

    def start(self, container: dict[str, Any] | list[Any], line: int) -> None:
        if self._wants_key():
            raise ConfigError(f"line {line}: a key must be a word, not a list or a mapping", "write `key: value`")
        if len(self.open) == MAX_DEPTH:
            raise ConfigError(f"line {line}: more than {MAX_DEPTH} levels", "sections go one level deep")
        self._put(container)
        self.open.append(container)
        self.keys.append(None)
        self.repeated.append(False)

    def end(self) -> None:
        for stack in (self.open, self.keys, self.repeated):
            stack.pop()
        self._value_done()

    def _wants_key(self) -> bool:
        return bool(self.open) and isinstance(self.open[-1], dict) and self.keys[-1] is None

    def _begin_key(self, name: str, line: int) -> None:
        self.path.append(name)
        path = tuple(self.path)
        self.keys[-1] = name
        self.repeated[-1] = name in self.open[-1]
        if self.repeated[-1]:
            self.document.duplicates.append((path, self.document.lines[path], line))
        else:
            self.document.lines.setdefault(path, line)

    def _put(self, value: Any) -> None:
        if not self.open:
            self.document.data = value
            return
        container, key = self.open[-1], self.keys[-1]
        if isinstance(container, list):
            container.append(value)
        elif not self.repeated[-1] and key is not None:
            container[key] = value

    def _value_done(self) -> None:
        if self.open and isinstance(self.open[-1], dict):
            self.path.pop()
            self.keys[-1] = None
