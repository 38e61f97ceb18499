"""Synthetic lines and tubes against what is known of them by other means."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ellipe
from scipy.stats import kstest

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import (
    TABLE_I,
    centre_line,
    coil_centre_line,
    hose_centre_line,
    loop_centre_line,
    random_centre_line,
)
from dlogen.evaluation.synthetic import sample_tube, truth, truth_bytes, write_truth

RADIUS = 0.02

LINES: dict[str, CentreLine] = {
    **{name: centre_line(name) for name in ("bent", "straight", "helical")},
    "random": random_centre_line(3, clearance=0.06),
    "loop": loop_centre_line(),
    "coil": coil_centre_line(),
    "hose": hose_centre_line(),
    "points": from_points(centre_line("bent").points(40)),
}


@pytest.fixture(params=LINES)
def line(request: pytest.FixtureRequest) -> CentreLine:
    return LINES[request.param]


# Centre lines ------------------------------------------------------------------------------------------------------


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


def test_derivatives_are_those_of_the_curve(line: CentreLine) -> None:
    t, h = np.linspace(0.03, 0.97, 23), 1e-5
    for derivative in (0, 1):
        numeric = (line.curve(t + h, derivative) - line.curve(t - h, derivative)) / (2 * h)
        exact = line.curve(t, derivative + 1)
        # The third derivative of the spline through points jumps at its knots.
        assert np.abs(numeric - exact).max() < 1e-4 * max(1.0, np.abs(exact).max())


def test_lengths_in_closed_form() -> None:
    # `bent` is half an ellipse of the semi-axes 1 and 2.
    assert centre_line("bent").length == pytest.approx(2 * 2 * ellipe(1 - 1 / 4), rel=1e-12)
    assert centre_line("straight").length == pytest.approx(np.hypot(0.3, 1.0), rel=1e-14)
    assert centre_line("helical").length == pytest.approx(np.hypot(3 * np.pi / 2, 0.5), rel=1e-12)
    assert hose_centre_line().length == pytest.approx(1.7, abs=1e-12)
    assert coil_centre_line(0.9).length == pytest.approx(0.9, abs=1e-12)
    assert loop_centre_line(0.9).length == pytest.approx(0.9, abs=1e-12)


def test_arc_length_against_another_quadrature(line: CentreLine) -> None:
    def speed(t: float) -> float:
        return float(np.linalg.norm(line.curve(np.array([t]), 1)))

    for s in (0.13, 0.5, 0.81):
        t = float(line.parameter(s)[0])
        pieces = [0.0, *(float(knot) for knot in line.knots if 0 < knot < t), t]
        arc = sum(quad(speed, a, b, epsabs=1e-13)[0] for a, b in pairwise(pieces))
        assert arc == pytest.approx(s * line.length, abs=1e-10)


def test_points_are_even_in_arc_length(line: CentreLine) -> None:
    steps = np.linalg.norm(np.diff(line.points(20001), axis=0), axis=1)
    # A chord is shorter than its arc by kappa^2 h^2 / 24 of it, which is what is left.
    assert np.ptp(steps) / steps.mean() < line.max_curvature() ** 2 * steps.mean() ** 2 / 24 + 1e-9
    assert steps.sum() == pytest.approx(line.length, rel=1e-6)


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


def test_from_points_goes_through_the_points_in_order() -> None:
    given_points = centre_line("helical").points(60)
    line = from_points(given_points)
    s, distance = line.nearest(given_points)
    assert distance.max() < 1e-9
    assert (np.diff(s) > 0).all()
    assert line.length == pytest.approx(centre_line("helical").length, rel=1e-4)
    np.testing.assert_allclose(from_points([[0, 0, 0], [0, 3, 4]])(0.5), [[0, 1.5, 2]], atol=1e-12)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[0, 0, 0]], "two points"),
        ([[0, 0], [1, 1]], "two points"),
        ([[0, 0, 0], [np.nan, 0, 0]], "finite"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0]], "point 3"),
    ],
)
def test_from_points_refuses(points: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        from_points(points)


def test_nearest_finds_foot_points_of_points_off_the_line(line: CentreLine) -> None:
    rng = np.random.default_rng(0)
    s = rng.uniform(0.02, 0.98, 200)
    tangents = line.tangents(s)
    across = np.cross(tangents, rng.normal(size=(200, 3)))
    points = line(s) + 0.015 * across / np.linalg.norm(across, axis=1, keepdims=True)
    found, distance = line.nearest(points)
    np.testing.assert_allclose(distance, 0.015, atol=1e-12)
    np.testing.assert_allclose(found, s, atol=1e-9)


def test_a_moved_line_is_the_same_line_elsewhere() -> None:
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([5e5, 5e6, 100.0])
    line = centre_line("bent")
    moved = line.moved(turn, shift)
    np.testing.assert_allclose(moved.points(50), line.points(50) @ turn.T + shift, rtol=0, atol=2e-9)
    assert moved.length == pytest.approx(line.length, rel=1e-14)


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


# Clouds ------------------------------------------------------------------------------------------------------------


def test_points_lie_at_the_radius_and_normals_point_outwards(line: CentreLine) -> None:
    cloud = sample_tube(line, RADIUS, 1500, 1)
    assert cloud.points.shape == cloud.normals.shape == (1500, 3)
    s, distance = line.nearest(cloud.points)
    # Where strands pass each other, or at an end, the nearest place may be another one: that one is not nearer.
    own = np.abs(s - cloud.s) < 1e-6
    assert own.mean() > 0.97
    np.testing.assert_allclose(distance[own], RADIUS, rtol=0, atol=1e-9)
    np.testing.assert_allclose(cloud.points - RADIUS * cloud.normals, line(cloud.s), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(cloud.normals, axis=1), 1.0, atol=1e-12)
    assert np.abs(np.einsum("ij,ij->i", cloud.normals, line.tangents(cloud.s))).max() < 1e-12


def test_points_are_uniform_along_and_around(line: CentreLine) -> None:
    cloud = sample_tube(line, RADIUS, 4000, 2)
    assert kstest(cloud.s, "uniform").pvalue > 1e-3
    # Around a straight line the angle can be told: uniform there.
    straight = sample_tube(centre_line("straight"), RADIUS, 4000, 2)
    tangent = straight.truth.tangents([0.5])[0]
    first = np.cross(tangent, [0, 0, 1.0])
    angle = np.arctan2(straight.normals @ np.cross(tangent, first), straight.normals @ first)
    assert kstest(angle, "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 1e-3


def test_gaps_are_empty_and_the_rest_is_uniform() -> None:
    cloud = sample_tube(LINES["bent"], RADIUS, 4000, 3, gaps=[(0.6, 0.7), (0.2, 0.3), (0.25, 0.4)])
    assert not ((cloud.s > 0.2) & (cloud.s < 0.4)).any()
    assert not ((cloud.s > 0.6) & (cloud.s < 0.7)).any()
    closed_up = cloud.s - np.where(cloud.s > 0.3, 0.2, 0.0) - np.where(cloud.s > 0.65, 0.1, 0.0)
    assert kstest(closed_up, "uniform", args=(0, 0.7)).pvalue > 1e-3


@pytest.mark.parametrize("ratio", [10.0, 0.2])
def test_density_ratio(ratio: float) -> None:
    cloud = sample_tube(LINES["bent"], RADIUS, 20_000, 4, density_ratio=ratio, gaps=[(0.4, 0.5)])

    def cumulative(s: Any) -> Any:
        return (s + (ratio - 1) * s**2 / 2) / (1 + (ratio - 1) / 2)

    gap = cumulative(0.5) - cumulative(0.4)

    def with_gap(s: Any) -> Any:
        return (cumulative(s) - np.where(s > 0.45, gap, 0.0)) / (1 - gap)

    assert kstest(cloud.s, with_gap).pvalue > 1e-3
    counts = np.histogram(cloud.s, [0.0, 0.02, 0.98, 1.0])[0]
    assert counts[2] / counts[0] == pytest.approx(ratio, rel=0.35)


def test_one_side_faces_the_viewer() -> None:
    side = np.array([0.3, 0.2, -1.0])
    cloud = sample_tube(LINES["random"], RADIUS, 3000, 5, side=side, caps=True)
    assert (cloud.normals @ side < 1e-12).all()
    # All of the half is there: normals nearly across the view, and nearly against it.
    towards = cloud.normals @ -side / np.linalg.norm(side)
    assert towards.min() < 0.02 and towards.max() > 0.98


def test_stray_points() -> None:
    cloud = sample_tube(LINES["helical"], RADIUS, 2000, 6, stray_fraction=0.1)
    assert cloud.is_stray.sum() == 200
    assert np.isnan(cloud.normals[cloud.is_stray]).all() and np.isfinite(cloud.normals[~cloud.is_stray]).all()
    _, distance = cloud.truth.nearest(cloud.points)
    np.testing.assert_allclose(distance[~cloud.is_stray], RADIUS, atol=1e-9)
    assert np.median(distance[cloud.is_stray]) > 5 * RADIUS
    # Not all at the end of the file.
    assert kstest(np.flatnonzero(cloud.is_stray), "uniform", args=(0, 2000)).pvalue > 1e-3


def test_noise_has_its_standard_deviation() -> None:
    clean, noisy = (sample_tube(LINES["bent"], RADIUS, 4000, 7, noise=noise) for noise in (0.0, 0.002))
    assert (noisy.points - clean.points).std(axis=0) == pytest.approx([0.002] * 3, rel=0.05)
    np.testing.assert_array_equal(noisy.s, clean.s)


def test_caps_are_flat_discs_at_the_density_of_the_rest() -> None:
    line, radius = centre_line("straight"), 0.2
    cloud = sample_tube(line, radius, 20_000, 8, caps=True)
    for s_end, direction in ((0.0, -1), (1.0, 1)):
        outward = direction * line.tangents([s_end])[0]
        on_cap = np.abs(cloud.normals @ outward - 1) < 1e-9
        offset = cloud.points[on_cap] - line([s_end])
        assert np.abs(offset @ outward).max() < 1e-12
        rho = np.linalg.norm(offset, axis=1)
        assert kstest((rho / radius) ** 2, "uniform").pvalue > 1e-3
        share = radius**2 / (2 * radius**2 + 2 * radius * line.length)
        assert on_cap.mean() == pytest.approx(share, rel=0.06)
    assert not np.any(np.abs(sample_tube(line, radius, 500, 8).normals @ line.tangents([0.0])[0]) > 1e-9)


def test_seeds_reproduce_and_differ() -> None:
    kwargs: dict[str, Any] = {"noise": 1e-3, "stray_fraction": 0.1, "gaps": [(0.2, 0.3)], "caps": True}
    first, again, other = (sample_tube(LINES["loop"], RADIUS, 500, seed, **kwargs).points for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).all(axis=1).any()
    np.testing.assert_array_equal(random_centre_line(9).points(), random_centre_line(9).points())


def test_few_points_and_none() -> None:
    assert len(sample_tube(LINES["bent"], RADIUS, 0, 1).points) == 0
    assert len(sample_tube(LINES["bent"], RADIUS, 1, 1, caps=True, stray_fraction=1.0).points) == 1


@pytest.mark.parametrize(
    "bad",
    [
        {"radius": 0.0},
        {"count": -1},
        {"noise": -1.0},
        {"stray_fraction": 1.1},
        {"density_ratio": 0.0},
        {"gaps": [(0.5, 0.4)]},
        {"gaps": [(-0.1, 0.4)]},
        {"gaps": [(0.0, 0.6), (0.5, 1.0)]},
        {"side": (0, 0, 0)},
        {"side": (0, 1)},
        {"side": (-0.3, 1.0, 0.0)},
    ],
)
def test_impossible_clouds_are_refused(bad: dict[str, Any]) -> None:
    arguments = {"radius": RADIUS, "count": 100, "rng": 1, **bad}
    with pytest.raises(ValueError):
        sample_tube(LINES["straight"], **arguments)


# Truth files -------------------------------------------------------------------------------------------------------


def test_truth_file(tmp_path: Path) -> None:
    line = LINES["helical"]
    write_truth(tmp_path / "t.json", line, RADIUS, {"noise": 0.0}, 7)
    data = (tmp_path / "t.json").read_bytes()
    assert data == truth_bytes(truth(line, RADIUS, {"noise": 0.0}, 7))
    content = json.loads(data)
    assert (content["schema"], content["units"], content["curve"]) == ("dlogen.truth/1", "m", "helical")
    assert (content["radius"], content["seed"], content["settings"]) == (RADIUS, 7, {"noise": 0.0})
    assert content["length"] == pytest.approx(line.length, abs=1e-9)
    np.testing.assert_allclose(content["points"], line(np.linspace(0, 1, 1000)), atol=1e-9)
    assert b"-0.0]" not in data and b"-0.0," not in data
