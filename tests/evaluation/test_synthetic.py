"""Synthetic lines and tubes against what is known of them by other means."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from known_lines import LINES
from scipy.stats import kstest

from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.shapes import (
    centre_line,
    random_centre_line,
)
from dlogen.evaluation.synthetic import sample_tube, synth, truth, truth_bytes

RADIUS = 0.02

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


def test_truth_file() -> None:
    line = LINES["helical"]
    data = truth_bytes(truth(line, RADIUS, {"noise": 0.0}, 7))
    assert data == truth_bytes(truth(line, RADIUS, {"noise": 0.0}, 7))
    content = json.loads(data)
    assert (content["schema"], content["units"], content["curve"]) == ("dlogen.truth/1", "m", "helical")
    assert (content["radius"], content["seed"], content["settings"]) == (RADIUS, 7, {"noise": 0.0})
    assert content["length"] == pytest.approx(line.length, abs=1e-9)
    np.testing.assert_allclose(content["points"], line(np.linspace(0, 1, 1000)), atol=1e-9)
    assert b"-0.0]" not in data and b"-0.0," not in data


# Sensors -----------------------------------------------------------------------------------------------------------


def test_what_a_camera_sees_comes_with_its_truth() -> None:
    rope = {"length": 1.0, "bend_radius": 0.08, "diameter": 0.01}
    cloud = synth("hose", **rope, camera="azure-kinect", mask_grow=2, tilt=25.0, world=True, seed=3)
    assert cloud.viewpoint is not None and cloud.viewpoint[2] == pytest.approx(0.8 * np.cos(np.radians(25.0)))
    assert 0.1 < cloud.is_stray.mean() < 0.8
    np.testing.assert_array_equal(np.isnan(cloud.s), cloud.is_stray)
    np.testing.assert_array_equal(np.isnan(cloud.normals).any(axis=1), cloud.is_stray)
    # Normals go from the axis to the points; what is seen faces the camera.
    own = ~cloud.is_stray
    offset = cloud.points[own] - cloud.truth(cloud.s[own])
    np.testing.assert_allclose(np.cross(offset, cloud.normals[own]), 0.0, atol=1e-9)
    towards = cloud.viewpoint[:3] - cloud.points[own]
    assert (np.einsum("ij,ij->i", towards, cloud.normals[own]) > 0.0).mean() > 0.9
    again = synth("hose", **rope, camera="azure-kinect", mask_grow=2, tilt=25.0, world=True, seed=3)
    np.testing.assert_array_equal(cloud.points, again.points)
