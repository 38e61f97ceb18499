from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.curvature import max_curvature
from dlogen.stages.quality.checks import (
    check_bends,
    check_followed,
    check_line,
    check_radius,
    check_radius_along,
    on_surface,
)
from dlogen.stages.quality.residual import foot_points
from dlogen.stages.quality.walk import check_walk
from dlogen.stages.scale import estimate_scale


def line_findings(line, cloud, radius: float):
    _, distance = foot_points(cloud.points, line)
    return check_line(line, radius, distance, on_surface(distance, radius), max_curvature(line))


def walk_findings(line, cloud, unreached: int = 0):
    s, distance = foot_points(cloud.points, line)
    return check_walk(line, cloud.radius, s, on_surface(distance, cloud.radius), unreached)


def codes(findings) -> dict[str, str]:
    return {finding.code: finding.severity for finding in findings}


class TestLine:
    def test_a_good_fit_has_no_findings(self, exact_line, tube, half_tube, bent) -> None:
        for cloud in (tube, half_tube, bent):
            assert line_findings(exact_line(cloud.truth), cloud, cloud.radius) == []
            assert walk_findings(exact_line(cloud.truth), cloud) == []

    def test_noise_and_strays_are_no_findings_of_the_line(self, exact_line) -> None:
        line = random_centre_line(3, clearance=0.08)
        noisy = sample_tube(line, 0.015, 5000, 0, noise=0.001, stray_fraction=0.1)
        assert line_findings(exact_line(line), noisy, 0.015) == []

    def test_a_bend_tighter_than_the_radius(self, exact_line) -> None:
        line = exact_line(centre_line("helical-printed"))
        cloud = sample_tube(centre_line("helical-printed"), 0.02, 5000, 0)
        found = line_findings(line, cloud, 0.02)
        finding = next(item for item in found if item.code == "bend-tighter-than-radius")
        assert finding.severity == "bad"
        # The printed curve folds at the peaks of its sine, s = 1/6, 1/2, 5/6.
        assert min(abs(finding.s - s) for s in (1 / 6, 1 / 2, 5 / 6)) < 0.01
        assert np.array(finding.position) == pytest.approx(line(finding.s))
        assert "20 mm" in finding.message

    def test_a_cloud_that_is_no_tube(self, exact_line, tube) -> None:
        rng = np.random.default_rng(0)
        ball = tube.truth(rng.random(3000)) + rng.normal(scale=0.02, size=(3000, 3))
        line = exact_line(tube.truth)
        _, distance = foot_points(ball, line)
        found = codes(check_line(line, 0.015, distance, on_surface(distance, 0.015), (1.0, 0.5)))
        assert "points-off-the-tube" in found
        assert "radius-mismatch" in found

    def test_a_radius_that_does_not_fit_the_points(self, exact_line, tube) -> None:
        for wrong in (0.7 * tube.radius, 1.5 * tube.radius):
            assert "radius-mismatch" in codes(line_findings(exact_line(tube.truth), tube, wrong))
        assert codes(line_findings(exact_line(tube.truth), tube, 1.05 * tube.radius)) == {}

    def test_millimetres_taken_for_metres(self, exact_line) -> None:
        line = random_centre_line(3)

        def large(s, derivative):
            return 1000 * line.curve(s, derivative)

        found = check_line(exact_line(large), 15.0, np.full(100, 15.0), np.ones(100, bool), (0.01, 0.5))
        assert codes(found) == {"units": "doubtful"}
        assert "1400 m" in found[0].message

    def test_metres_taken_for_millimetres(self, exact_line) -> None:
        line = random_centre_line(3)

        def small(s, derivative):
            return 0.001 * line.curve(s, derivative)

        found = check_line(exact_line(small), 1.5e-5, np.full(100, 1.5e-5), np.ones(100, bool), (1e4, 0.5))
        assert codes(found) == {"units": "doubtful"}
        assert "1.4 mm" in found[0].message

    def test_points_that_are_all_far_away(self, exact_line, tube) -> None:
        line = exact_line(tube.truth)
        found = codes(check_line(line, 0.015, np.full(100, 1.0), np.zeros(100, bool), (1.0, 0.5)))
        assert found["points-off-the-tube"] == "bad"


class TestRadius:
    @pytest.mark.parametrize("side", [None, [0.3, 0.2, -1.0]])
    def test_a_given_radius_is_held_against_the_cross_sections(self, side) -> None:
        cloud = sample_tube(random_centre_line(3, clearance=0.08), 0.015, 5000, 0, noise=0.0005, side=side)
        free = estimate_scale(cloud.points)
        for right in (0.014, 0.015, 0.016, None):
            assert check_radius(right, free) == []
        for wrong in (0.010, 0.019):
            (finding,) = check_radius(wrong, free)
            assert (finding.code, finding.severity) == ("radius-mismatch", "doubtful")
            assert f"{1e3 * wrong:.3g} mm was given" in finding.message

    def test_what_the_cloud_does_not_know_it_does_not_contradict(self) -> None:
        rng = np.random.default_rng(0)
        thread = np.c_[rng.random(3000), rng.normal(0.0, 0.002, (3000, 2))]
        free = estimate_scale(thread)
        assert check_radius(0.001, free) == []
        # But a guess is no radius.
        assert codes(check_radius(None, free)) == {"radius-unknown": "doubtful"}

    @pytest.mark.parametrize("seed", range(5))
    def test_the_same_everywhere(self, exact_line, seed: int) -> None:
        truth = random_centre_line(seed, clearance=0.06)
        for options in ({"noise": 0.003}, {"side": [0.0, 0.0, -1.0]}, {"stray_fraction": 0.3}, {"gaps": [(0.3, 0.5)]}):
            s, distance = foot_points(sample_tube(truth, 0.015, 5000, seed, **options).points, exact_line(truth))
            assert check_radius_along(exact_line(truth), 0.015, s, distance) == []

    def test_a_thick_part_is_found_where_it_is(self, exact_line) -> None:
        truth = random_centre_line(3, clearance=0.08)
        s, distance = foot_points(sample_tube(truth, 0.015, 5000, 0).points, exact_line(truth))
        thick = np.where(abs(s - 0.625) < 0.03, 1.6 * distance, distance)
        (finding,) = check_radius_along(exact_line(truth), 0.015, s, thick)
        assert (finding.code, finding.severity) == ("radius-varies", "doubtful")
        assert finding.s == pytest.approx(0.625)
        assert "24 mm here, 15 mm in the model" in finding.message

    def test_a_taper(self, exact_line, tube) -> None:
        s, distance = foot_points(tube.points, exact_line(tube.truth))
        (finding,) = check_radius_along(exact_line(tube.truth), tube.radius, s, distance * (1.4 - 0.8 * s))
        assert min(finding.s, 1.0 - finding.s) < 0.1


class TestBends:
    def test_a_bend_without_points_is_a_guess(self, circle) -> None:
        bow = circle(0.03, np.pi * 1.8)  # 170 mm long, 17 radii
        line = circle(0.05, 1.9 * np.pi)
        s = np.random.default_rng(0).random(3000)
        assert check_bends(line, 0.01, s) == []
        (finding,) = check_bends(line, 0.01, s[abs(s - 0.4) > 0.06])
        assert (finding.code, finding.severity) == ("gap", "doubtful")
        assert finding.s == pytest.approx(0.4, abs=0.05)
        assert check_bends(bow, 0.01, s[abs(s - 0.4) > 0.1]) == []  # too short to tell

    def test_a_gap_on_the_way_straight_on_is_none(self, exact_line, tube) -> None:
        s, _ = foot_points(tube.points, exact_line(tube.truth))
        for middle in np.linspace(0.1, 0.9, 9):
            assert check_bends(exact_line(tube.truth), tube.radius, s[abs(s - middle) > 0.02]) == []

    @pytest.mark.parametrize("seed", range(10))
    def test_chance_makes_none(self, circle, seed: int) -> None:
        rng = np.random.default_rng(seed)
        for count in (200, 1000, 5000):
            assert check_bends(circle(0.03, 25 * np.pi), 0.01, rng.random(count) ** 1.5) == []


class TestFollowed:
    @pytest.mark.parametrize(("share", "severity"), [(0.0, None), (0.1, "doubtful"), (0.4, "bad")])
    def test_a_line_that_ends_early(self, exact_line, tube, share: float, severity) -> None:
        s = np.linspace(0.0, 1.0, 150)
        part = (1.0 - share) * np.linspace(0.0, 1.0, 4000)
        distance = np.linalg.norm(tube.points[:, None] - tube.truth(part)[None, ::20], axis=2).min(axis=1)
        found = codes(check_followed(tube.points, tube.truth(s), distance, tube.radius))
        assert found == ({} if severity is None else {"points-not-reached": severity})

    def test_strays_were_never_part_of_it(self, exact_line) -> None:
        truth = random_centre_line(3, clearance=0.08)
        cloud = sample_tube(truth, 0.015, 5000, 0, stray_fraction=0.3)
        _, distance = foot_points(cloud.points, exact_line(truth))
        assert check_followed(cloud.points, truth.points(100), distance, 0.015) == []


class TestOnSurface:
    def test_clean_points_within_half_a_radius(self) -> None:
        distance = np.array([0.010] * 50 + [0.0149, 0.0151, 0.0051, 0.0049, 0.5])
        assert on_surface(distance, 0.010)[-5:].tolist() == [True, False, True, False, False]

    def test_noise_widens_it_up_to_a_radius(self) -> None:
        rng = np.random.default_rng(0)
        distance = 0.010 + rng.normal(scale=0.002, size=5000)
        assert on_surface(distance, 0.010).mean() > 0.999
        assert not on_surface(np.array([*distance, 0.0201]), 0.010)[-1]
