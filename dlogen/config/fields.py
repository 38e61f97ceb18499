"""What a configuration key may hold, which keys there are, and how to say that something is wrong with one."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

from dlogen.errors import ConfigError

Auto = Literal["auto"]
#: The value that leaves a setting to dlogen.
AUTO: Final = "auto"

_Value = TypeVar("_Value")


def given(value: _Value | Auto) -> _Value | None:
    """A setting as the user gave it; None where it is left to dlogen."""
    return None if isinstance(value, str) and value == AUTO else value


_DECIMAL = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)"


@dataclass(frozen=True)
class Setting:
    """What one key may hold.

    Attributes:
        kind: the type of its values. Whole floats such as 21.0 count as integers, as they do in JSON Schema.
        help: one sentence.
        unit: of a number.
        auto: what "auto" does; None where "auto" is not allowed.
        above: numbers must be greater than this.
        least, most: smallest and largest number allowed, or number of characters of a text.
        pattern: regular expression that a whole text has to match; its help says what that means.
        choices: the words that a "choice" can be.
        also: other spellings of the key that are accepted.
        sought: names under which people look for it; they are not accepted, but lead to a hint.
    """

    kind: Literal["number", "integer", "flag", "choice", "text"]
    help: str
    unit: str = ""
    auto: str | None = None
    above: float | None = None
    least: float | None = None
    most: float | None = None
    pattern: str = ""
    choices: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    sought: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """What is allowed, in words."""
        if self.kind == "flag":
            return "true or false"
        if self.kind == "choice":
            return "one of " + ", ".join(self.choices) if len(self.choices) > 1 else self.choices[0]
        if self.kind == "text":
            return f"text of {self.least:g} to {self.most:g} printable characters"
        what = "a whole number" if self.kind == "integer" else "a number"
        limits = [
            f"{sign} {limit:.12g}"
            for sign, limit in ((">", self.above), (">=", self.least), ("<=", self.most))
            if limit is not None
        ]
        if limits:
            what += " " + " and ".join(limits)
        if self.unit:
            what += f" ({self.unit})"
        return f"{what}, or auto" if self.auto is not None else what

    def read(self, value: object) -> Any:
        """The value with the type that the key's field has.

        Raises:
            ValueError: it is not allowed. The text is a hint, or empty.
        """
        if self.auto is not None and isinstance(value, str) and value == AUTO:
            return AUTO
        if self.kind == "flag":
            return self._read_flag(value)
        if self.kind == "choice":
            return self._read_choice(value)
        if self.kind == "text":
            return self._read_text(value)
        return self._read_number(value)

    def _read_flag(self, value: object) -> bool:
        if not isinstance(value, bool):
            raise ValueError("write true or false")
        return value

    def _read_choice(self, value: object) -> str:
        if not isinstance(value, str) or value not in self.choices:
            import difflib

            near = difflib.get_close_matches(str(value).casefold(), self.choices, n=1, cutoff=0.7)
            raise ValueError(f"did you mean {near[0]!r}?" if near else "")
        return value

    def _read_text(self, value: object) -> str:
        if not isinstance(value, str):
            raise ValueError("put it in quotes")
        if not (self.least or 0) <= len(value) <= (self.most or math.inf) or not value.isprintable():
            raise ValueError("")
        if self.pattern and not re.fullmatch(self.pattern, value):
            raise ValueError("")
        return value

    def _read_number(self, value: object) -> int | float:
        if isinstance(value, str):
            raise ValueError(self._text_hint(value))
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ValueError("")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError("it must be finite")
        if self.kind == "integer" and not number.is_integer():
            raise ValueError("it must be whole")
        if (
            (self.above is not None and number <= self.above)
            or (self.least is not None and number < self.least)
            or (self.most is not None and number > self.most)
        ):
            raise ValueError("")
        return int(number) if self.kind == "integer" else number

    def _text_hint(self, text: str) -> str:
        """What to write instead of a text where a number belongs."""
        text = text.strip()
        if self.auto is not None and text.casefold() == AUTO:
            return "write auto in small letters"
        if re.fullmatch(rf"[-+]?{_DECIMAL}([eE][-+]?[0-9]+)?", text):
            return "write it without quotes"
        if re.fullmatch(r"[0-9]*,[0-9]+", text):
            return "the decimal mark is a point"
        length = re.fullmatch(rf"({_DECIMAL})\s*(mm|cm|m)", text)
        if length and self.unit == "m":
            metres = float(length[1]) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0}[length[2]]
            return f"lengths are metres, without a unit: {metres:.12g}"
        return ""


class Keys:
    """The keys of a configuration.

    Args:
        settings: every setting by its dotted key ("normals.neighbours"), in the order of declaration.
        sections: what each section is about, by its name.
    """

    def __init__(self, settings: Mapping[str, Setting], sections: Mapping[str, str]) -> None:
        self.settings = dict(settings)
        self.sections = dict(sections)
        self._spellings = {spelling: key for key, item in settings.items() for spelling in (key, *item.also)}

    def find(self, name: object) -> str | None:
        """The dotted key that is spelt so, if there is one."""
        return self._spellings.get(name) if isinstance(name, str) else None

    def of_section(self, section: str) -> dict[str, Setting]:
        """The settings of a section by their names in it; "" is the top level."""
        parts = ((key.rpartition("."), item) for key, item in self.settings.items())
        return {name: item for (before, _, name), item in parts if before == section}

    def nearest(self, name: str) -> list[str]:
        """Keys that somebody who wrote this may have meant: the same letters, another name for it, or a slip."""
        whole: dict[str, list[str]] = {_letters(section): [section] for section in self.sections}
        last: dict[str, list[str]] = {}
        for key, setting in self.settings.items():
            section, _, leaf = key.rpartition(".")
            for word in (leaf, *setting.also, *setting.sought):
                whole.setdefault(_letters(section + word), []).append(key)
                last.setdefault(_letters(word), []).append(key)
        leaf = name.rpartition(".")[2]
        for table, word in ((whole, _letters(name)), (last, _letters(leaf))):
            if word in table:
                # Another section may have what was looked for, too.
                return list(dict.fromkeys([*table[word], *last.get(word, ())]))
        import difflib

        similar = [
            (difflib.SequenceMatcher(None, word, known).ratio(), keys)
            for table, word in ((whole, _letters(name)), (last, _letters(leaf)))
            for known, keys in table.items()
            if len(word) > 2  # those of one or two letters are all alike
        ]
        ratio, keys = max(similar, key=lambda pair: pair[0], default=(0.0, []))
        return keys if ratio >= 0.7 else []

    def unknown(self, where: str, name: object, section: str = "") -> Problem:
        """A key that does not exist, with the nearest that do."""
        shown = f"{section}.{name}" if section else str(name)
        if near := self.nearest(shown):
            hint = "did you mean " + " or ".join(repr(key) for key in near) + "?"
        else:
            known = [*self.of_section(section), *(() if section else self.sections)]
            hint = f"known {f'in {section}' if section else 'keys'}: {', '.join(known)}"
        return Problem(where, f"unknown key {show(shown)}", hint)


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name.casefold())


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
