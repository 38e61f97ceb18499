"""The metrics of a batch, and limits on them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from dlogen.batch.metrics import METRICS, Threshold, metrics_of
from dlogen.errors import UsageError
from dlogen.types import FitData


def test_figures_are_those_of_the_result(make_result: Callable[..., FitData], circle: Callable[..., Any]) -> None:
    result = make_result(circle(0.5, 2.0), 0.01, 0.004)
    metrics = metrics_of(result)
    assert list(metrics) == [item.name for item in METRICS]
    assert metrics["length"] == pytest.approx(1.0, rel=1e-4)
    assert metrics["radius"] == 0.01
    assert metrics["e_max"] == 0.004
    assert metrics["points"] == 400
    assert isinstance(metrics["segment_count"], int)
    # A chord of an arc with this sagitta: (n - 1) of them, and a shorter one.
    chord = 2 * math.sqrt(2 * 0.5 * 0.004 - 0.004**2)
    assert metrics["segment_length"] == pytest.approx(chord, rel=0.02)
    assert metrics["last_segment_length"] <= metrics["segment_length"]
    assert metrics["max_deviation"] == pytest.approx(0.004, rel=0.05)
    assert metrics["mdtw_mean"] <= metrics["mdtw_max"]
    assert all(type(value) in (int, float) for value in metrics.values())


def test_what_is_not_a_number_is_left_out(make_result: Callable[..., FitData], circle: Callable[..., Any]) -> None:
    result = make_result(circle(0.5, 2.0))
    wrong = replace(result, residual=replace(result.residual, rms=math.nan), max_deviation=math.inf)
    assert set(metrics_of(result)) - set(metrics_of(wrong)) == {"residual_rms", "max_deviation"}


def test_limits() -> None:
    limit = Threshold.parse(" max_deviation = 1e-2 ")
    assert limit == Threshold("max_deviation", 0.01)
    assert not limit.exceeded({"max_deviation": 0.01})
    assert limit.exceeded({"max_deviation": 0.010001})
    assert not limit.exceeded({"max_deviation": None})
    assert not limit.exceeded({})
    assert Threshold.parse("segment_count=20").exceeded({"segment_count": 21})


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("max_deviaton=1", "no figure 'max_deviaton'", "did you mean 'max_deviation'?"),
        ("colour=1", "no figure 'colour'", "known: points, "),
        ("", "no figure ''", "known: points, "),
        ("max_deviation", "'' is not a number", "max_deviation=0.01"),
        ("max_deviation=1mm", "'1mm' is not a number", "metres"),
        ("max_deviation=nan", "'nan' is not a number", "metres"),
        ("max_deviation=1=2", "'1=2' is not a number", "metres"),
    ],
)
def test_wrong_limits_teach(text: str, message: str, hint: str) -> None:
    with pytest.raises(UsageError) as raised:
        Threshold.parse(text)
    assert message in raised.value.message
    assert hint in str(raised.value.hint)
