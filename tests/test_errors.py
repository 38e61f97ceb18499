"""Errors: what they say, where, and what the command line exits with."""

from __future__ import annotations

from pathlib import Path

import pytest

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
    ("kind", "code"),
    [(DlogenError, 1), (FitError, 1), (InputError, 2), (ConfigError, 2), (UsageError, 2), (OutputError, 2)],
)
def test_exit_codes_are_those_of_the_contract(kind: type[DlogenError], code: int) -> None:
    error = kind("what", "try this")
    assert isinstance(error, DlogenError)
    assert (error.exit_code, error.message, error.hint, error.stage) == (code, "what", "try this", None)


def test_a_text_says_what_in_which_file_and_stage_and_what_to_try() -> None:
    error = FitError("no line", "check r", path=Path("a.ply"), stage="refine")
    assert str(error) == "a.ply: refine: no line (check r)"
    assert str(FitError("no line")) == "no line"
    assert str(InputError("cut off", path="a.ply")) == "a.ply: cut off"


def test_a_signal_exits_as_in_shells() -> None:
    assert Interrupted("ended").exit_code == 130
    assert Interrupted("ended", signal=15).exit_code == 143
    # Of one error, not of all.
    assert Interrupted.exit_code == 1


def test_a_full_disk_is_full_for_all() -> None:
    assert OutputError("full", for_all=True).for_all
    assert not OutputError("not there", path="x").for_all
    assert OutputError("not there", path="x").path == "x"
