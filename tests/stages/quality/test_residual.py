from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.quality.residual import foot_points, tube_residual


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 1000))
def test_points_of_a_tube_are_a_radius_away(exact_line, seed: int) -> None:
    cloud = sample_tube(random_centre_line(seed, clearance=0.05), 0.012, 1000, seed)
    s, distance = foot_points(cloud.points, exact_line(cloud.truth))
    assert distance == pytest.approx(np.full(1000, 0.012), abs=3e-6)
    assert s == pytest.approx(cloud.s, abs=1e-3)  # nowhere near another strand


def test_foot_points_against_newton(exact_line) -> None:
    rng = np.random.default_rng(0)
    truth = random_centre_line(5)
    points = truth(rng.random(500)) + rng.normal(scale=0.02, size=(500, 3))
    s, distance = foot_points(points, exact_line(truth))
    true_s, true_distance = truth.nearest(points)
    assert distance == pytest.approx(true_distance, abs=4e-6)
    assert np.median(np.abs(s - true_s)) < 1e-4


def test_s_is_the_lines_own_coordinate_not_arc_length(exact_line) -> None:
    truth = centre_line("bent")  # at uneven speed
    own = np.array([0.1, 0.2, 0.45, 0.9])
    s, distance = foot_points(truth.curve(own, 0), exact_line(truth))
    assert s == pytest.approx(own, abs=1e-4)
    assert distance == pytest.approx(np.zeros(4), abs=2e-5)  # the sagitta of chords of 5 mm


def test_points_beyond_the_ends_belong_to_the_ends(straight) -> None:
    line = straight([0, 0, 0], [1, 0, 0])
    points = np.array([[-0.3, 0, 0.4], [1.3, 0.4, 0], [0.25, 0, 0.1], [0, 0, 0]])
    s, distance = foot_points(points, line)
    assert s == pytest.approx([0, 1, 0.25, 0], abs=1e-12)
    assert distance == pytest.approx([0.5, 0.5, 0.1, 0], abs=1e-12)


def test_few_samples(straight) -> None:
    s, distance = foot_points(np.array([[0.7, 0.1, 0]]), straight([0, 0, 0], [1, 0, 0]), samples=2)
    assert s == pytest.approx([0.7])
    assert distance == pytest.approx([0.1])


def test_residual_by_hand() -> None:
    found = tube_residual(np.array([0.010, 0.012, 0.009, 0.010]), 0.010)
    assert found.rms == pytest.approx(np.sqrt((0 + 4 + 1 + 0) / 4) * 1e-3)
    assert found.median == pytest.approx(0.5e-3)
    assert found.radius == 0.010


def test_residual_is_the_noise(exact_line) -> None:
    cloud = sample_tube(random_centre_line(2, clearance=0.06), 0.015, 5000, 2, noise=0.001)
    found = tube_residual(foot_points(cloud.points, exact_line(cloud.truth))[1], 0.015)
    assert found.rms == pytest.approx(0.001, rel=0.05)
    assert found.median == pytest.approx(0.6745 * 0.001, rel=0.05)
    # A radius that is wrong by a millimetre shows.
    wrong = tube_residual(foot_points(cloud.points, exact_line(cloud.truth))[1], 0.016)
    assert wrong.rms == pytest.approx(np.hypot(0.001, 0.001), rel=0.05)
