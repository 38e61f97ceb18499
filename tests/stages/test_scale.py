"""Scale of raw clouds: radius, noise, spacing against the truth, whatever the order of the points."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.errors import FitError
from dlogen.evaluation.shapes import centre_line, coil_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.scale import estimate_scale

VIEW = [0.3, 0.2, -1.0]


def _line(seed, length=1.4, bend=0.1):
    return random_centre_line(seed, length, bend, clearance=min(0.06, bend))


@pytest.mark.parametrize(
    ("radius", "count", "options", "tolerance"),
    [
        (0.012, 5000, {}, 0.01),
        (0.012, 5000, {"noise": 0.001}, 0.03),
        (0.012, 300, {"noise": 0.0005}, 0.05),
        (0.012, 5000, {"noise": 0.0005, "density_ratio": 10.0}, 0.03),
        (0.012, 5000, {"noise": 0.0005, "stray_fraction": 0.1}, 0.03),
        (0.015, 5000, {"noise": 0.001, "side": VIEW}, 0.05),
        (0.015, 5000, {"noise": 0.001, "side": VIEW, "density_ratio": 10.0, "stray_fraction": 0.1}, 0.1),
        (0.0015, 5000, {"noise": 0.0005}, 0.15),
        (0.05, 20000, {"noise": 0.002}, 0.03),
    ],
)
@pytest.mark.parametrize("seed", [11, 12])
def test_radius(radius, count, options, tolerance, seed):
    cloud = sample_tube(_line(seed), radius, count, seed, **options)
    scale = estimate_scale(cloud.points)
    assert scale.radius == pytest.approx(radius, rel=tolerance)
    assert scale.radius_reliable
    assert scale.round
    assert scale.line_share > 0.8


@pytest.mark.parametrize("noise", [0.0005, 0.001, 0.002])
def test_noise(noise):
    cloud = sample_tube(_line(3, bend=0.3), 0.02, 5000, 3, noise=noise)
    # Bends inside the slabs look like noise, too, so that small noise is overestimated.
    assert noise * 0.8 < estimate_scale(cloud.points).noise < noise * 1.2 + 0.0005


def test_coverage_tells_one_side_from_all():
    full = estimate_scale(sample_tube(_line(4), 0.015, 5000, 4, noise=0.0005).points)
    half = estimate_scale(sample_tube(_line(4), 0.015, 5000, 4, noise=0.0005, side=VIEW).points)
    assert full.coverage > 0.9
    assert 0.35 < half.coverage < 0.65


@pytest.mark.parametrize("count", [3000, 100000])
def test_spacing_is_that_of_the_whole_cloud(count):
    from scipy.spatial import cKDTree

    points = sample_tube(_line(5), 0.012, count, 5).points
    truth = np.median(cKDTree(points).query(points, 2)[0][:, 1])
    assert estimate_scale(points).spacing == pytest.approx(truth, rel=0.15)


@pytest.mark.parametrize("name", ["bent", "straight", "helical"])
def test_points_per_radius(name):
    line = centre_line(name)
    scale = estimate_scale(sample_tube(line, 0.02, 5000, 1).points)
    assert scale.per_radius == pytest.approx(5000 * 0.02 / line.length, rel=0.15)


def test_units_scale_everything():
    points = sample_tube(_line(6), 0.012, 4000, 6, noise=0.0005).points
    one, thousand = estimate_scale(points), estimate_scale(1000.0 * points)
    # The hash takes other points of a cloud in other units, if it has to leave any out.
    assert thousand.radius == pytest.approx(1000.0 * one.radius, rel=1e-9)
    assert thousand.spacing == pytest.approx(1000.0 * one.spacing, rel=1e-9)


def test_order_of_the_points_does_not_matter():
    points = sample_tube(_line(7), 0.012, 20000, 7, noise=0.001).points
    shuffled = np.random.default_rng(0).permutation(points)
    assert estimate_scale(points) == estimate_scale(shuffled)


def test_far_from_the_origin():
    points = sample_tube(_line(8), 0.012, 5000, 8, noise=0.001).points
    near, far = estimate_scale(points), estimate_scale(points + 5e6)
    assert far.radius == pytest.approx(near.radius, rel=0.01)


def test_given_radius_is_kept():
    points = sample_tube(_line(9), 0.012, 3000, 9).points
    scale = estimate_scale(points, radius=0.0125)
    assert scale.radius == 0.0125
    assert scale.radius_reliable


def test_plane_and_ball_are_no_lines():
    rng = np.random.default_rng(1)
    plane = np.c_[rng.uniform(size=(4000, 2)), rng.normal(scale=0.001, size=4000)]
    ball = rng.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    for points in (plane, ball):
        scale = estimate_scale(points)
        assert scale.line_share < 0.35
        assert not scale.radius_reliable


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("pitch", [2.1, 2.5, 3.5])
def test_turns_close_together_have_the_radius_of_the_strand(pitch, seed):
    points = sample_tube(coil_centre_line(1.4, pitch * 0.012), 0.012, 5000, seed, noise=0.0005).points
    scale = estimate_scale(points)
    assert scale.radius == pytest.approx(0.012, rel=0.05)
    assert scale.radius_reliable
    # Points of the neighbours are counted as well where these touch.
    assert scale.per_radius == pytest.approx(5000 * 0.012 / 1.4, rel=0.7 if pitch < 2.3 else 0.4)
    order = np.random.default_rng(seed).permutation(len(points))
    assert estimate_scale(points[order]) == scale


def test_touching_turns_whose_normals_say_nothing_are_not_round():
    points = sample_tube(coil_centre_line(1.4, 0.0252), 0.012, 5000, 2, noise=0.0025).points
    scale = estimate_scale(points)
    assert not (scale.radius_reliable and scale.round)


@pytest.mark.parametrize("seed", [1, 2])
def test_no_radius_is_read_from_what_is_no_tube(seed):
    rng = np.random.default_rng(seed)
    ball = rng.normal(size=(5000, 3))
    shell = 0.1 * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    plane = np.c_[rng.uniform(0, 1, (5000, 2)), rng.normal(0, 0.001, 5000)]
    box = rng.uniform(-0.1, 0.1, (5000, 3))
    box[np.arange(5000), rng.integers(0, 3, 5000)] = 0.1
    for points in (ball, shell, plane, box):
        assert not estimate_scale(points).radius_reliable


def test_beads_on_a_string_show_no_width():
    t = np.linspace(0.0, 1.0, 30)
    scale = estimate_scale(np.c_[t, 0.1 * t**2, np.zeros(30)])
    assert not scale.resolved
    assert not scale.radius_reliable


def test_too_few_points():
    with pytest.raises(FitError, match="too few"):
        estimate_scale(np.zeros((10, 3)))


class TestSpatialSample:
    def test_size_and_evenness(self):
        points = np.random.default_rng(2).uniform(size=(50000, 3))
        index = spatial_sample(points, 5000)
        assert 4700 < len(index) < 5300
        np.testing.assert_allclose(points[index].mean(axis=0), 0.5, atol=0.02)

    def test_same_points_for_every_order(self):
        rng = np.random.default_rng(3)
        points = rng.normal(size=(20000, 3))
        shuffled = rng.permutation(points)
        np.testing.assert_array_equal(points[spatial_sample(points, 3000)], shuffled[spatial_sample(shuffled, 3000)])

    def test_duplicates_are_taken_once(self):
        points = np.repeat(np.random.default_rng(4).normal(size=(100, 3)), 3, axis=0)
        index = spatial_sample(points, 1000)
        assert len(index) == len(np.unique(points[index], axis=0)) == 100

    def test_negative_zero_is_zero(self):
        points = np.random.default_rng(5).normal(size=(5000, 3))
        points[:, 2] = 0.0
        negative = points * [1.0, 1.0, -1.0]
        np.testing.assert_array_equal(spatial_sample(points, 500), spatial_sample(negative, 500))

    def test_grids_are_sampled_evenly(self):
        """Coordinates with few bits must not all hash alike."""
        axis = np.arange(40) / 8.0
        grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        assert 0.08 < len(spatial_sample(grid, 6400)) / len(grid) < 0.12


def test_thousands_of_radii_are_seen_as_well_as_a_few() -> None:
    """A sample of so long an object is a string of beads: more of it is looked at."""
    strands = 30
    rng = np.random.default_rng(4)
    angle = rng.uniform(0.0, 2.0 * np.pi, 90_000)
    along, strand = rng.uniform(0.0, 0.6, len(angle)), rng.integers(0, strands, len(angle))
    points = np.stack([along, 0.05 * strand + 0.004 * np.cos(angle), 0.004 * np.sin(angle)], axis=1)
    found = estimate_scale(points)
    assert found.radius_reliable and found.radius == pytest.approx(0.004, rel=0.03)
    assert found.line_share == 1.0
    assert found.per_radius == pytest.approx(90_000 * 0.004 / (0.6 * strands), rel=0.15)
