"""What a configuration key may hold, and how a key is declared.

A key is a field of a dataclass, made by one of the functions below: `r: float | Auto = length(AUTO, "Radius of the
object.", auto="estimated from the cloud")`. They state the type of the value to type checkers, as
`dataclasses.field` does, and return a field that has its `Setting` as metadata.
"""

from __future__ import annotations

import math
import numbers
import re
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeVar

Auto = Literal["auto"]
#: The value that leaves a setting to dlogen.
AUTO: Final = "auto"

_Default = TypeVar("_Default")
_Number = TypeVar("_Number", bound="float | Auto")
_Integer = TypeVar("_Integer", bound="int | Auto")
_Word = TypeVar("_Word", bound=str)

_Value = TypeVar("_Value")

_DECIMAL = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)"


def given(value: _Value | Auto) -> _Value | None:
    """A setting as the user gave it; None where it is left to dlogen."""
    return None if isinstance(value, str) and value == AUTO else value


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
        words: that may stand in place of a number, besides "auto", and what each means.
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
    words: tuple[tuple[str, str], ...] = ()
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
        what += "".join(f", {word} ({meaning})" for word, meaning in self.words)
        return f"{what}, or auto" if self.auto is not None else what

    def read(self, value: object) -> Any:
        """The value with the type that the key's field has.

        Raises:
            ValueError: it is not allowed. The text is a hint, or empty.
        """
        if self.auto is not None and isinstance(value, str) and value == AUTO:
            return AUTO
        if isinstance(value, str) and any(value == word for word, _ in self.words):
            return value
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


def number(
    default: _Number,
    help: str,
    *,
    unit: str = "",
    auto: str | None = None,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    also: tuple[str, ...] = (),
    sought: tuple[str, ...] = (),
) -> _Number | float:
    """A number. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("number", help, unit, auto, above, least, most, also=also, sought=sought))


def length(default: _Number, help: str, *, auto: str, sought: tuple[str, ...] = ()) -> _Number | float:
    """A length in metres, greater than 0. The arguments are the attributes of `Setting`."""
    return number(default, help, unit="m", auto=auto, above=0, sought=sought)


def length_or(
    default: _Word, help: str, *, auto: str, words: tuple[tuple[str, str], ...], sought: tuple[str, ...] = ()
) -> _Word | float:
    """A length in metres, greater than 0, or a word. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("number", help, "m", auto, 0, words=words, sought=sought))


def integer(
    default: _Integer,
    help: str,
    *,
    auto: str | None = None,
    least: int | None = None,
    most: int | None = None,
    sought: tuple[str, ...] = (),
) -> _Integer | int:
    """A whole number. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("integer", help, auto=auto, least=least, most=most, sought=sought))


def flag(default: bool, help: str, *, sought: tuple[str, ...] = ()) -> bool:
    """True or false. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("flag", help, sought=sought))


def choice(
    default: _Word, help: str, *, choices: tuple[_Word, ...], auto: str | None = None, sought: tuple[str, ...] = ()
) -> _Word:
    """One of some words. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("choice", help, auto=auto, choices=choices, sought=sought))


def text(
    default: str,
    help: str,
    *,
    least: int,
    most: int,
    auto: str | None = None,
    pattern: str = "",
    sought: tuple[str, ...] = (),
) -> str:
    """Printable characters. The arguments are the attributes of `Setting`."""
    return _declared(default, Setting("text", help, "", auto, None, least, most, pattern, sought=sought))


def _declared(default: _Default, setting: Setting) -> _Default:
    """A field of a dataclass. To type checkers it is its default, as it is of `dataclasses.field`."""
    return field(default=default, metadata={"setting": setting})
