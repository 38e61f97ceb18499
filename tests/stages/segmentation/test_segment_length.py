"""The segment length of Eq. 17 against the geometry of chords."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.geometry.curvature import max_curvature
from dlogen.stages.segmentation.segment_length import max_segment_length

lengths = st.floats(1e-4, 10.0)


@given(lengths, lengths)
def test_equation_17_as_printed(e_max: float, radius: float) -> None:
    if e_max <= radius:
        printed = 2 * math.sqrt(max(radius**2 - (e_max - radius) ** 2, 0.0))
        assert max_segment_length(e_max, radius) == pytest.approx(printed, rel=1e-5)


@given(lengths, lengths)
def test_the_sagitta_of_the_chord_is_e_max(e_max: float, radius: float) -> None:
    length = max_segment_length(e_max, radius)
    assert length <= 2 * radius
    sagitta = radius - math.sqrt(max(radius**2 - (length / 2) ** 2, 0.0))
    assert sagitta == pytest.approx(min(e_max, radius), rel=1e-4)


def test_the_sagitta_measured_on_a_circle(circle) -> None:
    line = circle(0.145, 2 * np.pi)
    length = max_segment_length(0.010, 1 / max_curvature(line)[0])
    assert length == pytest.approx(0.1058, abs=5e-4)  # Table III: 10.59 cm
    angle = 2 * math.asin(length / 2 / 0.145)
    s = np.linspace(0, angle / (2 * np.pi), 1001)
    ends, between = line(s[[0, -1]]), line(s)
    along = (ends[1] - ends[0]) / length
    away = between - ends[0] - np.outer((between - ends[0]) @ along, along)
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.010, rel=1e-6)


def test_limits_of_equation_17() -> None:
    assert max_segment_length(0.01, math.inf) == math.inf
    assert max_segment_length(0.1, 0.1) == pytest.approx(0.2)
    # Beyond r_k the printed formula shrinks, and then is the root of a negative number.
    assert max_segment_length(0.15, 0.1) == pytest.approx(0.2)
    assert max_segment_length(5.0, 0.1) == pytest.approx(0.2)
    # Nearly straight: l = sqrt(8 e r), which the printed form loses to cancellation.
    assert max_segment_length(1e-3, 1e12) == pytest.approx(math.sqrt(8e9), rel=1e-9)


@given(lengths, lengths, st.floats(1.0, 3.0))
def test_more_error_and_weaker_bends_allow_longer_segments(e_max: float, radius: float, factor: float) -> None:
    length = max_segment_length(e_max, radius)
    assert max_segment_length(factor * e_max, radius) >= length * (1 - 1e-12)
    assert max_segment_length(e_max, factor * radius) >= length * (1 - 1e-12)
