"""Types of command line parameters: what they take, what they make of it, and what they refuse."""

from __future__ import annotations

from typing import Any

import click
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.cli.types import Auto, Count, Number, Numbers


def refused(kind: click.ParamType, text: str) -> str:
    with pytest.raises(click.BadParameter) as caught:
        kind.convert(text, None, None)
    return caught.value.message


@given(st.floats(0.5, 1e9))
def test_numbers_of_a_range(value: float) -> None:
    assert Number(0.5).convert(repr(value), None, None) == value
    assert Auto().convert(repr(value), None, None) == value


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999"])
def test_what_is_not_finite_is_refused(text: str) -> None:
    assert text in refused(Number(), text)
    refused(Auto(), text)
    refused(Numbers("X,Y"), f"1,{text}")


def test_a_range_holds() -> None:
    refused(Number(0.0, 1.0), "1.1")
    refused(Number(0.0, min_open=True), "0")
    assert Number(0.0, 1.0).convert("1", None, None) == 1.0


def test_auto_is_none() -> None:
    assert Auto().convert("auto", None, None) is None
    for text in ("0", "-1", "Auto", "x", ""):
        assert "neither auto nor a number above 0" in refused(Auto(), text)


@pytest.mark.parametrize(
    ("form", "text", "expected"),
    [("X,Y,Z", "1,-2.5,3e-2", (1.0, -2.5, 0.03)), ("S0:S1", "0.25:0.5", (0.25, 0.5)), ("X", "7", (7.0,))],
)
def test_tuples(form: str, text: str, expected: tuple[float, ...]) -> None:
    assert Numbers(form).convert(text, None, None) == expected
    assert Numbers(form).convert(expected, None, None) is expected


@pytest.mark.parametrize(
    ("form", "text"),
    [("X,Y,Z", "1,2"), ("X,Y,Z", "1,2,3,4"), ("X,Y,Z", "1:2:3"), ("S0:S1", "0.1,0.2"), ("X,Y", "a,b"), ("X,Y", "")],
)
def test_tuples_of_another_form_are_refused(form: str, text: str) -> None:
    assert f"is not {form}" in refused(Numbers(form), text)


def test_counts() -> None:
    made: Any = Count().convert("17", None, None)
    assert made == 17 and type(made) is int
    assert Count().convert("all", None, None) is None
    for text in ("0", "-3", "1.5", "ALL", ""):
        assert "whole number from 1 on" in refused(Count(), text)
