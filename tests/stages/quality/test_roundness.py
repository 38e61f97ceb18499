"""Cables that are not round, hardly seen, out of register or on a table: what is said, and what is not."""

from __future__ import annotations

import numpy as np
import pytest
from partly_seen import arc, on_table, oval, two_views
from scipy.spatial import cKDTree

from dlogen.pipeline import fit
from dlogen.stages.quality.roundness import _can_be, is_round
from dlogen.stages.quality.section import Ellipse, Section


def codes(points: np.ndarray, **config: float) -> set[str]:
    """Codes of the findings that are no notes."""
    return {item.code for item in fit(points, config).quality.findings if not item.is_note}


@pytest.mark.parametrize("height", [0.3, 0.5, 0.7])
@pytest.mark.parametrize(("width", "noise", "seed"), [(0.02, 0.0002, 0), (0.008, 0.0001, 1)])
def test_an_oval_cable_is_said_to_be_one(height: float, width: float, noise: float, seed: int) -> None:
    result = fit(oval(width, height * width, 6000, noise, seed))
    quality = result.quality
    assert quality.verdict == "doubtful"
    (finding,) = (item for item in quality.findings if item.code == "not-round")
    # "... but 20.1 mm by 10.2 mm, ..., and their middle is 9.1 mm above the line ..."
    sizes = [float(part.split()[-1]) for part in finding.message.split(" mm")[:3]]
    assert sizes[:2] == pytest.approx([1e3 * width, 1e3 * height * width], rel=0.08)
    # Where the middle is said to be is the true axis, at z = 0.
    line = result.skeleton_points
    assert "above the line" in finding.message
    assert np.median(line[:, 2]) + 1e-3 * sizes[2] == pytest.approx(0.0, abs=0.03 * width)


@pytest.mark.parametrize("shift", [0.4, 0.5, 0.6])
@pytest.mark.parametrize(("radius", "noise", "seed"), [(0.01, 0.05, 0), (0.004, 0.02, 1)])
def test_views_out_of_register(shift: float, radius: float, noise: float, seed: int) -> None:
    assert codes(two_views(radius, shift * radius, 8000, noise * radius, seed)) & {"not-round", "side-by-side"}


@pytest.mark.parametrize(("half", "noise"), [(30.0, 0.0002), (40.0, 0.001), (50.0, 0.0005)])
@pytest.mark.parametrize("hanging", [False, True])
def test_a_narrow_arc_does_not_tell_the_radius(half: float, noise: float, hanging: bool) -> None:
    points = arc(0.02, half, 8000, noise, 3, hanging)
    result = fit(points)
    assert {item.code for item in result.quality.findings if not item.is_note} == {"radius-unknown"}
    (finding,) = (item for item in result.quality.findings if item.code == "radius-unknown")
    said = float(finding.message.split(" degrees")[0].split()[-1])
    assert said == pytest.approx(2.0 * half, abs=7.0)
    assert codes(points, r=0.02) == set()


@pytest.mark.parametrize("half", [60.0, 70.0, 84.0, 180.0])
@pytest.mark.parametrize("noise", [0.0002, 0.001])
@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_said_of_round_cables(half: float, noise: float, seed: int) -> None:
    assert codes(arc(0.01, half, 8000, noise, seed)) == set()


@pytest.mark.parametrize("height", [1.4, 2.0])
def test_an_oval_cable_that_stands_upright(height: float) -> None:
    assert "not-round" in codes(oval(0.014, 0.014 * height, 6000, 0.0001))


@pytest.mark.parametrize(("half", "height", "possible"), [(65, 0.03, False), (95, 0.03, True), (65, 0.01, True)])
def test_what_is_higher_than_wide_shows_its_sides(half: float, height: float, possible: bool) -> None:
    section = Section(np.zeros(0, dtype=int), np.zeros(0), np.zeros(0), float(np.radians(half)), False)
    assert _can_be(Ellipse(0.02, height, 0.0, 0.0, 0.0, 0.0), section) is possible


def test_nothing_is_said_of_views_in_register() -> None:
    assert codes(two_views(0.01, 0.0, 8000, 0.0005)) == set()


def test_a_table_that_touches_the_cable_is_noticed() -> None:
    """Seen at a slant, the table goes on where the cable ends on one side: nothing is empty above it."""
    line = arc(1e-9, 1.0, 40_000, seed=5)
    tree = cKDTree(line)
    lower, strip = arc(0.005, 150.0, 12_000, seed=4), on_table(0.005, 0.004, 5000, seed=2)[5000:]
    lower, strip = (cloud[cloud[:, 1] > line[tree.query(cloud)[1], 1]] for cloud in (lower, strip))
    points = np.concatenate([arc(0.005, 84.0, 5000), lower[lower[:, 2] < 0.0], strip])
    points += 0.0003 * np.random.default_rng(0).normal(size=points.shape)
    result = fit(points)
    assert result.chain.radius > 1.1 * 0.005
    assert {item.code for item in result.quality.findings} & {"not-round", "side-by-side"}


def test_what_may_be_a_circle() -> None:
    ellipse = Ellipse(0.02, 0.016, 0.0, 0.0, 0.02, 0.0)
    assert not is_round(ellipse, 1.0)
    # The same points are worth fewer, and two standard deviations more.
    assert is_round(ellipse, 9.0)
    assert is_round(Ellipse(0.02, 0.0176, 0.0, 0.0, 0.0, 0.0), 1.0)
    assert not is_round(Ellipse(0.016, 0.02, 0.0, 0.0, 0.02, 0.0), 1.0)
