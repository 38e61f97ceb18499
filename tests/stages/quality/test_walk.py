"""Findings about the sorting walk of the paper: points not reached, gaps, rings."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.quality.checks import on_surface
from dlogen.stages.quality.residual import foot_points
from dlogen.stages.quality.walk import check_walk


def walk_findings(line, cloud, unreached: int = 0):
    s, distance = foot_points(cloud.points, line)
    return check_walk(line, cloud.radius, s, on_surface(distance, cloud.radius), unreached)


def codes(findings) -> dict[str, str]:
    return {finding.code: finding.severity for finding in findings}


class TestWalk:
    @pytest.mark.parametrize(("share", "severity"), [(0.01, None), (0.05, "doubtful"), (0.3, "bad")])
    def test_points_that_were_not_reached(self, exact_line, tube, share: float, severity) -> None:
        found = codes(walk_findings(exact_line(tube.truth), tube, int(share * 5000)))
        assert found == ({} if severity is None else {"points-not-reached": severity})

    def test_gaps_where_they_are(self, exact_line) -> None:
        truth = random_centre_line(3, clearance=0.08)
        cloud = sample_tube(truth, 0.015, 5000, 0, gaps=[(0.2, 0.26), (0.7, 0.74)])
        found = walk_findings(exact_line(truth), cloud)
        assert [item.code for item in found] == ["gap", "gap"]
        assert [item.s for item in found] == pytest.approx([0.23, 0.72], abs=0.002)
        assert np.array([item.position for item in found]) == pytest.approx(truth([0.23, 0.72]), abs=0.005)
        assert "84 mm" in found[0].message or "85 mm" in found[0].message
        assert "56 mm" in found[1].message or "57 mm" in found[1].message

    @pytest.mark.parametrize("seed", range(10))
    def test_chance_makes_no_gaps(self, exact_line, seed: int) -> None:
        truth = random_centre_line(seed, clearance=0.06)
        for count in (300, 5000):
            assert walk_findings(exact_line(truth), sample_tube(truth, 0.015, count, seed)) == []

    def test_uneven_density_makes_no_gaps(self, exact_line) -> None:
        truth = random_centre_line(3, clearance=0.08)
        assert walk_findings(exact_line(truth), sample_tube(truth, 0.015, 5000, 0, density_ratio=10)) == []

    def test_a_ring(self, circle) -> None:
        ring = circle(0.3, 2 * np.pi * 0.995)
        rng = np.random.default_rng(0)
        s = rng.random(2000)
        found = check_walk(ring, 0.01, s, np.ones(2000, bool), 0)
        assert codes(found) == {"closed-ring": "bad"}

    def test_a_horseshoe_and_a_hairpin_are_no_rings(self, circle, exact_line) -> None:
        s = np.random.default_rng(0).random(2000)
        horseshoe = circle(0.3, 1.8 * np.pi)  # ends far apart
        assert check_walk(horseshoe, 0.01, s, np.ones(2000, bool), 0) == []

        def hairpin(s, derivative):  # ends side by side, but the line does not go on from one into the other
            t = 2 * s - 1
            x, y = ((t**2, 0.02 * t), (4 * t, np.full_like(t, 0.04)))[derivative]
            return np.stack([x, y, np.zeros_like(s)], axis=-1)

        assert check_walk(exact_line(hairpin), 0.02, s, np.ones(2000, bool), 0) == []

    def test_no_points_on_the_tube(self, circle) -> None:
        assert check_walk(circle(0.3, 2.0), 0.01, np.zeros(5), np.zeros(5, bool), 0) == []

    @pytest.mark.parametrize(("count", "code"), [(100, None), (101, "doubtful"), (750, "doubtful"), (751, "bad")])
    def test_from_which_share_on_points_are_missing(self, circle, count: int, code) -> None:
        # More than 2 % and more than 15 % of 5000.
        s = np.random.default_rng(1).random(5000)
        found = check_walk(circle(0.3, 4.0), 0.01, s, np.ones(5000, bool), count)
        assert codes(found) == ({} if code is None else {"points-not-reached": code})

    def test_points_off_the_tube_fill_no_gap(self, circle) -> None:
        s = np.sort(np.random.default_rng(2).random(4000))
        inside = (s > 0.4) & (s < 0.5)
        (finding,) = check_walk(circle(0.3, 4.0), 0.01, s, ~inside, 0)
        assert finding.code == "gap"
        assert finding.s == pytest.approx(0.45, abs=0.002)
        assert finding.position == pytest.approx([0.3 * np.cos(1.8), 0.3 * np.sin(1.8), 0.0], abs=0.003)
        # Shorter than a diameter it is none: 0.1 of 1.2 m are 120 mm.
        assert check_walk(circle(0.3, 4.0), 0.065, s, ~inside, 0) == []
        assert codes(check_walk(circle(0.3, 4.0), 0.055, s, ~inside, 0)) == {"gap": "doubtful"}
