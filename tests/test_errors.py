"""The errors: what they say, where, with which exit code."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlogen import errors
from dlogen.errors import (
    ConfigError,
    DlogenError,
    FitError,
    InputError,
    Interrupted,
    OutputError,
    UsageError,
)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({}, "no line"),
        ({"hint": "give r"}, "no line (give r)"),
        ({"stage": "skeleton"}, "skeleton: no line"),
        ({"path": Path("a/b.ply")}, f"{Path('a/b.ply')}: no line"),
        ({"path": "b.ply", "stage": "skeleton", "hint": "give r"}, "b.ply: skeleton: no line (give r)"),
        ({"hint": ""}, "no line"),
    ],
)
def test_the_text_says_where_what_and_what_to_do(given: dict[str, str], text: str) -> None:
    assert str(DlogenError("no line", **given)) == text


def test_parts_are_kept_apart() -> None:
    error = InputError("no points", "look at it", path="b.ply", stage="input")
    assert (error.message, error.hint, error.path, error.stage) == ("no points", "look at it", "b.ply", "input")
    bare = InputError("no points")
    assert (bare.hint, bare.path, bare.stage) == (None, None, None)


def test_a_stage_that_becomes_known_later_is_said() -> None:
    error = FitError("no line")
    error.stage = "sorting"
    assert str(error) == "sorting: no line"


def test_everything_here_is_a_dlogen_error() -> None:
    """So that `except DlogenError` catches them all, and nothing of Python's own."""
    found = [item for item in vars(errors).values() if isinstance(item, type) and issubclass(item, BaseException)]
    assert len(found) == 7
    assert all(issubclass(item, DlogenError) for item in found)
    assert not issubclass(DlogenError, (OSError, ValueError, KeyboardInterrupt))


@pytest.mark.parametrize(
    ("kind", "code"),
    [(DlogenError, 1), (FitError, 1), (InputError, 2), (ConfigError, 2), (UsageError, 2), (OutputError, 2)],
)
def test_exit_codes(kind: type[DlogenError], code: int) -> None:
    assert kind("no").exit_code == code


def test_a_place_that_cannot_be_written_is_a_usage_error() -> None:
    one = OutputError("cannot write", "another folder", path="a.urdf")
    assert isinstance(one, UsageError)
    assert not one.for_all
    assert str(one) == "a.urdf: cannot write (another folder)"
    assert OutputError("disk full", for_all=True).for_all


@pytest.mark.parametrize(("signal", "code"), [(2, 130), (15, 143)])
def test_an_interrupt_ends_as_shells_say(signal: int, code: int) -> None:
    error = Interrupted("stopped", "run it again", signal=signal)
    assert error.exit_code == code
    assert (error.message, error.hint) == ("stopped", "run it again")
    assert Interrupted("stopped").exit_code == 130
    # Of this one, not of all of them.
    assert DlogenError("no").exit_code == 1
