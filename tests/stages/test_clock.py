"""Seconds per stage, and the name of the stage in errors."""

from __future__ import annotations

import time

import pytest

from dlogen.errors import FitError, InputError
from dlogen.stages.clock import Clock


def test_stages_are_timed_in_their_order() -> None:
    clock = Clock()
    with clock.stage("one"):
        time.sleep(0.02)
    with clock.stage("two"):
        pass
    assert list(clock.seconds) == ["one", "two"]
    assert clock.seconds["one"] >= 0.02
    assert 0.0 <= clock.seconds["two"] < 0.02


def test_an_error_gets_the_stage_that_it_came_out_of() -> None:
    clock = Clock()
    with pytest.raises(FitError) as caught, clock.stage("sorting"):
        raise FitError("no", "try again")
    assert caught.value.stage == "sorting"
    assert "sorting" in clock.seconds


def test_a_stage_that_is_known_already_stays() -> None:
    clock = Clock()
    with pytest.raises(InputError) as caught, clock.stage("outer"), clock.stage("inner"):
        raise InputError("no", "try again")
    assert caught.value.stage == "inner"
    assert list(clock.seconds) == ["inner", "outer"]


def test_other_errors_are_left_alone() -> None:
    clock = Clock()
    with pytest.raises(ZeroDivisionError) as caught, clock.stage("outer"):
        raise ZeroDivisionError
    assert not hasattr(caught.value, "stage")
    assert "outer" in clock.seconds
