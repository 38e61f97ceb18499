"""A `repr` that fits on a screen."""

from __future__ import annotations

from dataclasses import dataclass, field, make_dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.types.short_repr import ShortRepr


@dataclass(repr=False)
class One(ShortRepr):
    value: Any


@dataclass(repr=False)
class Hidden(ShortRepr):
    shown: int
    hidden: int = field(default=2, repr=False)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.zeros((5000, 3)), "array (5000, 3)"),
        (np.zeros(()), "array ()"),
        (1 / 3, "0.333333"),
        (np.float64(1 / 3), "0.333333"),
        (1e-12, "1e-12"),
        (12345678, "12345678"),
        (True, "True"),
        (None, "None"),
        ("bent", "'bent'"),
        ({"a": 1, "b": 2}, "{2 keys}"),
        ({}, "{0 keys}"),
        ((1, 2, 3), "(1, 2, 3)"),
        ([1, 2, 3, 4], "(4 items)"),
        ((), "()"),
        ((np.zeros(2), 0.5), "(array (2,), 0.5)"),
        (One(np.zeros(3)), "One"),
    ],
)
def test_each_kind_of_value(value: Any, text: str) -> None:
    assert repr(One(value)) == f"One(value={text})"


def test_a_field_that_is_not_to_be_shown_is_not() -> None:
    assert repr(Hidden(1)) == "Hidden(shown=1)"


def test_without_fields() -> None:
    @dataclass(repr=False)
    class Empty(ShortRepr):
        pass

    assert repr(Empty()) == "Empty()"


def test_a_long_value_is_cut() -> None:
    text = repr(One("x" * 500))
    assert text.endswith("...)")
    assert len(text) < 70


@given(st.lists(st.text("ab", max_size=60) | st.integers() | st.floats(), max_size=40))
def test_three_lines_at_most_none_too_long(values: list[Any]) -> None:
    """And all of it where that has room: nothing is left out silently."""
    names = [f"field_{number}" for number in range(len(values))]
    made = make_dataclass("Many", names, bases=(ShortRepr,), repr=False)(*values)
    text = repr(made)
    lines = text.splitlines()
    assert len(lines) <= 3
    # ", ...)" may stand at the end of a full line.
    assert max(map(len, lines)) <= 116
    assert text.startswith("Many(") and text.endswith(")")
    shown = [name for name in names if f"{name}=" in text]
    assert shown == names[: len(shown)]
    assert (shown == names) != text.endswith(", ...)")
    assert shown or not names
