"""Ends that are cut obliquely are told from square ones."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit

RADIUS = 0.012
CLOUDS = [{}, {"noise": 1e-3}, {"noise": 1e-3, "side": (0, 0, -1)}, {"noise": 5e-4, "density_ratio": 10}]


def cut(line: CentreLine, points: np.ndarray, degrees: float) -> np.ndarray:
    """Without what lies beyond a plane through the axis at s = 0.9, that far from the cross-section."""
    place, tangent = line(0.9)[0], line.tangents(0.9)[0]
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    normal = np.cos(np.radians(degrees)) * tangent + np.sin(np.radians(degrees)) * across
    s = line.nearest(points)[0]
    return points[(s < 0.86) | ((s < 0.94) & ((points - place) @ normal < 0.0))]


@pytest.mark.parametrize("sampling", CLOUDS)
def test_oblique_ends_are_found_and_square_ones_are_not(sampling: dict[str, Any]) -> None:
    found = []
    for seed in range(6):
        rng = np.random.default_rng(1000 + seed)
        line = random_centre_line(rng, clearance=0.03)
        points = sample_tube(line, RADIUS, 5000, rng, **sampling).points
        square, oblique = (
            [item for item in fit(cut(line, points, degrees)).quality.findings if item.code == "end-cut-off"]
            for degrees in (0.0, 45.0)
        )
        assert not square
        for finding in oblique:
            assert finding.severity == "doubtful" and finding.s in (0.0, 1.0)
            assert np.linalg.norm(np.array(finding.position) - line(0.9)[0]) < 2 * RADIUS
            said = re.search(r"the (first|last) end is cut off at (\d+) degrees", finding.message)
            assert said is not None
            assert said[1] == ("first" if finding.s == 0.0 else "last")
            assert float(said[2]) == pytest.approx(45.0, abs=12.0)
        found.append(len(oblique))
    # Where few points happen to lie at the edge, it cannot be told.
    assert sum(found) >= 4 and max(found) == 1


def seen_less_far(line: CentreLine, points: np.ndarray, radii: float, share: float) -> np.ndarray:
    """A square end at s = 0.9, of which that share of the circumference was seen so many radii less far."""
    tangent = line.tangents(0.9)[0]
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    s = line.nearest(points)[0]
    offset = points - line(s)
    angle = np.arctan2(offset @ np.cross(tangent, across), offset @ across) % (2.0 * np.pi)
    short = np.where(angle < 2.0 * np.pi * share, radii * RADIUS, 0.0)
    return points[s * line.length < 0.9 * line.length - short]


@pytest.mark.parametrize("sampling", CLOUDS[:2] + CLOUDS[3:])
def test_an_end_that_was_seen_less_far_on_one_side_is_a_note(sampling: dict[str, Any]) -> None:
    noted = 0
    for seed in range(3):
        rng = np.random.default_rng(2000 + seed)
        line = random_centre_line(rng, clearance=0.03)
        points = sample_tube(line, RADIUS, 20_000, rng, **sampling).points
        for radii, share in ((2.0, 0.5), (3.0, 0.4)):
            result = fit(seen_less_far(line, points, radii, share))
            assert result.skeleton.length == pytest.approx(0.9 * line.length, abs=0.2 * RADIUS)
            noted += [item.severity for item in result.quality.findings if item.code == "end-cut-off"] == ["note"]
        # The plane of a view or of a crop stays one.
        (finding,) = (item for item in fit(cut(line, points, 45.0)).quality.findings if item.code == "end-cut-off")
        assert finding.severity == "doubtful"
    # Of six: where the points happen to lie badly, it is not told from a cut.
    assert noted >= 4
