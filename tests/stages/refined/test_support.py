"""Where along a curve the points are."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.errors import FitError
from dlogen.stages.refined.support import on_support
from dlogen.stages.refined.tube_curve import TubeCurve, from_polyline

RADIUS, SPACING, MOST = 0.01, 0.02, 256


def straight(length: float) -> TubeCurve:
    return from_polyline(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]), SPACING, 0.0, 1e-3)


def extent(places: np.ndarray, curve: TubeCurve, **options: float) -> tuple[float, float]:
    """First and last place of the new curve on the x axis, metres."""
    x = np.clip(places / curve.step, 0.0, curve.intervals)
    moved, feet = on_support(curve, x, np.ones(len(x), dtype=bool), RADIUS, 1.0, SPACING, MOST, **options)
    ends = moved(np.array([0.0, float(moved.intervals)]))[:, 0]
    inside = (places > ends[0]) & (places < ends[1]) & (places > 0.0) & (places < curve.length)
    assert moved(feet[inside])[:, 0] == pytest.approx(places[inside], abs=1e-6)  # the feet stay where they are
    return float(ends[0]), float(ends[1])


def test_the_curve_is_cut_and_extended_by_a_margin() -> None:
    places = np.linspace(0.1, 1.0, 2000)
    first, last = extent(places, straight(1.0))
    assert first == pytest.approx(0.1 - RADIUS, abs=0.5 * RADIUS)
    assert last == pytest.approx(1.0 + RADIUS, abs=0.5 * RADIUS)


def test_a_tip_beyond_a_gap_counts_only_if_the_gap_may_be_a_strand_that_crosses() -> None:
    tip = np.linspace(0.83, 0.835, 6)
    places = np.concatenate([np.linspace(0.0, 0.8, 3000), tip])
    assert extent(places, straight(1.0))[1] < 0.83
    assert extent(places, straight(1.0), over=5.0)[1] > 0.835


def test_too_few_points() -> None:
    with pytest.raises(FitError, match="hardly any points"):
        extent(np.array([0.5]), straight(1.0))
