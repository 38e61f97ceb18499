"""Where a line touches itself: distances against known curves, and verdicts on clouds whose strands lie close."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import loop_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.pipeline import fit
from dlogen.stages.quality.contacts import check_contacts, find_contacts
from dlogen.stages.quality.residual import foot_points

RADIUS = 0.01


def _vertices(points):
    return resample(points, round(arc_lengths(points)[-1] / RADIUS) + 1)


def _spiral(pitch, turns=4.0):
    """In a plane, its strands `pitch` radii apart."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 4000)
    away = 0.05 + pitch * RADIUS * angle / (2.0 * np.pi)
    return np.c_[away * np.cos(angle), away * np.sin(angle), 0.0 * angle]


def _loop(separation):
    """One crossing, the strands so many radii apart."""
    return loop_centre_line(1.4, separation * RADIUS).points(3000)


@pytest.mark.parametrize("separation", [0.3, 1.2, 2.1, 2.5])
def test_distance_place_and_run_of_a_crossing(separation):
    line = _vertices(_loop(separation))
    (contact,) = find_contacts(line, RADIUS)
    assert contact.distance == pytest.approx(separation * RADIUS, abs=0.1 * RADIUS)
    assert abs(contact.position[0]) < RADIUS and abs(contact.position[2]) < RADIUS
    assert contact.run < 8.0 * RADIUS
    there = line[round(contact.s * (len(line) - 1))]
    assert np.linalg.norm(there - contact.position) < 3.0 * RADIUS


def test_a_line_that_keeps_off_itself_has_no_contacts():
    assert find_contacts(_vertices(_loop(3.5)), RADIUS) == []
    assert find_contacts(_vertices(_spiral(3.0)), RADIUS) == []


def test_turns_of_a_spiral_are_as_far_apart_as_they_are():
    # Each turn has one beside it on either side: stretches that overlap are not the same place.
    (contact,) = find_contacts(_vertices(_spiral(2.15)), RADIUS)
    assert contact.distance == pytest.approx(2.15 * RADIUS, rel=0.03)
    assert contact.run > 50.0 * RADIUS


@pytest.mark.parametrize(
    ("fitted", "rough", "code", "severity"),
    [
        (2.1, 2.0, "crossing", "note"),
        (2.1, 0.5, "crossing", "doubtful"),
        (1.2, 1.2, "crossing", "doubtful"),
        (0.6, 1.2, "branch", "bad"),
        (3.5, 0.5, "crossing", "doubtful"),
    ],
)
def test_the_fitted_line_decides(fitted, rough, code, severity):
    (finding,) = check_contacts(_vertices(_loop(fitted)), _vertices(_loop(rough)), RADIUS)
    assert (finding.code, finding.severity) == (code, severity)


def test_a_dense_spiral_is_right_and_not_called_bad():
    cloud = sample_tube(from_points(_spiral(2.15)), RADIUS, 20000, 5)
    result = fit(cloud.points, {"r": RADIUS})
    truth = cloud.truth.points(8000)
    assert foot_points(truth, result.skeleton)[1].max() < 0.2 * RADIUS
    assert result.quality.verdict == "doubtful"
    assert "side-by-side" in {finding.code for finding in result.quality.findings}


def test_strands_in_one_place_are_bad():
    cloud = sample_tube(from_points(_loop(0.5)), RADIUS, 8000, 5)
    assert fit(cloud.points).quality.verdict == "bad"
