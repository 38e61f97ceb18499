"""Shapes of synthetic objects: the paper's, and what is promised of the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipe

from dlogen.evaluation.shapes import (
    TABLE_I,
    centre_line,
    coil_centre_line,
    hose_centre_line,
    loop_centre_line,
    random_centre_line,
)


def test_table_1_is_the_papers() -> None:
    s = np.linspace(0, 1, 7)
    sine = np.sin(3 * np.pi * s) / 2 + 0.5
    expected = {
        "bent": (np.sin(np.pi * s), 2 * np.cos(np.pi * s) - 1, 0 * s),
        "straight": (-0.3 * s + 0.55, s - 1, 0 * s),
        "helical-printed": (sine, sine, s / 2 - 1),
        "helical": (sine, np.cos(3 * np.pi * s) / 2 + 0.5, s / 2 - 1),
    }
    assert expected.keys() == TABLE_I.keys()
    for name, columns in expected.items():
        np.testing.assert_allclose(TABLE_I[name](s, 0), np.stack(columns, axis=1), atol=1e-15)


def test_lengths_in_closed_form() -> None:
    # `bent` is half an ellipse of the semi-axes 1 and 2.
    assert centre_line("bent").length == pytest.approx(2 * 2 * ellipe(1 - 1 / 4), rel=1e-12)
    assert centre_line("straight").length == pytest.approx(np.hypot(0.3, 1.0), rel=1e-14)
    assert centre_line("helical").length == pytest.approx(np.hypot(3 * np.pi / 2, 0.5), rel=1e-12)
    assert hose_centre_line().length == pytest.approx(1.7, abs=1e-12)
    assert coil_centre_line(0.9).length == pytest.approx(0.9, abs=1e-12)
    assert loop_centre_line(0.9).length == pytest.approx(0.9, abs=1e-12)


def test_printed_helical_bends_to_4_mm_and_helical_is_a_helix() -> None:
    assert 1 / centre_line("helical-printed").max_curvature() == pytest.approx(0.004, abs=2e-4)
    # Radius 1/2, 0.5 m of rise over an angle of 3 pi: the curvature of a helix is r / (r^2 + c^2).
    pitch = 0.5 / (3 * np.pi)
    kappa = centre_line("helical").curvature(np.linspace(0, 1, 50))
    np.testing.assert_allclose(kappa, 0.5 / (0.25 + pitch**2), rtol=1e-10)
    off_axis = np.linalg.norm(centre_line("helical").points(50)[:, :2] - 0.5, axis=1)
    np.testing.assert_allclose(off_axis, 0.5, atol=1e-12)


def test_hose_is_the_papers() -> None:
    hose = hose_centre_line()
    s = np.linspace(0, 1, 10001)
    kappa = hose.curvature(s)
    assert 1 / hose.max_curvature() == pytest.approx(0.145, rel=1e-6)
    assert s[kappa.argmax()] == pytest.approx(0.33, abs=2e-4)
    assert np.abs(hose.points()[:, 2]).max() == 0.0
    # It does not touch itself.
    points = hose.points(500)
    apart = np.abs(np.subtract.outer(np.arange(500), np.arange(500))) * hose.length / 499 > 0.2
    assert np.linalg.norm(points[:, None] - points, axis=2)[apart].min() > 0.1


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    length=st.floats(0.2, 3.0),
    bend=st.floats(0.03, 0.3),
    dimensions=st.sampled_from([2, 3]),
)
def test_random_lines_keep_their_bend_radius(seed: int, length: float, bend: float, dimensions: int) -> None:
    line = random_centre_line(seed, length, bend, dimensions)
    assert line.length == pytest.approx(length, rel=1e-9)
    assert 1 / line.max_curvature() >= bend
    if dimensions == 2:
        assert np.ptp(line.points(100)[:, 2]) == 0.0


def test_clearance_is_kept() -> None:
    for seed in range(3):
        line = random_centre_line(seed, 2.0, 0.1, clearance=0.06)
        points = line.points(800)
        apart = np.abs(np.subtract.outer(np.arange(800), np.arange(800))) * line.length / 799 > 0.1
        assert np.linalg.norm(points[:, None] - points, axis=2)[apart].min() > 0.059


def test_a_line_that_cannot_keep_away_from_itself_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dlogen.evaluation.shapes._comes_near_itself", lambda *_: True)
    with pytest.raises(ValueError, match="keeps"):
        random_centre_line(0, clearance=0.05)


def test_strands_of_loop_and_coil_pass_at_the_separation() -> None:
    for line, separation in ((loop_centre_line(1.4, 0.05), 0.05), (coil_centre_line(1.4, 0.05), 0.05)):
        points = line.points(1000)
        apart = np.abs(np.subtract.outer(np.arange(1000), np.arange(1000))) * line.length / 999 > 0.3
        assert np.linalg.norm(points[:, None] - points, axis=2)[apart].min() == pytest.approx(separation, rel=0.02)


@pytest.mark.parametrize(
    "make",
    [
        lambda: random_centre_line(0, length=-1),
        lambda: random_centre_line(0, clearance=0.2),
        lambda: loop_centre_line(0.01),
        lambda: coil_centre_line(0.05),
        lambda: hose_centre_line(0.3),
        lambda: hose_centre_line(min_bend_radius=0),
    ],
)
def test_impossible_lines_are_refused(make: Any) -> None:
    with pytest.raises(ValueError):
        make()
