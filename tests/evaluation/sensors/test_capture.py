"""Whole captures: where points are, in which frame, what is hidden, what is refused."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlogen.errors import UsageError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.capture import SensorCloud, sensor_cloud, sensor_scene
from dlogen.evaluation.sensors.models import REALSENSE_D435, SENSORS, Sensor
from dlogen.evaluation.shapes import hose_centre_line, loop_centre_line
from dlogen.geometry.rotations import from_quaternion
from dlogen.types import Array

#: A stereo camera's optics without its noise, edges and holes.
EXACT = Sensor("exact", 1280, 720, (640.0, 640.0), 0.5, 0.2, 5.0, grazing=0.0)
ROPE = hose_centre_line(1.0, 0.08)
RADIUS = 0.004


def bar(*points: tuple[float, float, float]) -> CentreLine:
    return from_points(points)


@pytest.fixture(scope="module")
def rope() -> SensorCloud:
    return sensor_cloud(ROPE, RADIUS, "realsense-d435", distance=0.46, seed=1, mask_grow=2)


def test_points_are_in_the_pixels_of_the_colour_image(rope: SensorCloud) -> None:
    x, y, z = rope.points.T
    column, row = 918.0 * x / z + 639.5, 918.0 * y / z + 359.5
    np.testing.assert_allclose(column, np.round(column), atol=1e-6)
    np.testing.assert_allclose(row, np.round(row), atol=1e-6)
    assert len(np.unique(np.round(column) + 1280 * np.round(row))) == len(rope.points)


def test_exact_points_are_on_the_tube_on_the_table() -> None:
    seen = sensor_cloud(ROPE, RADIUS, EXACT)
    s, distance = seen.line.nearest(seen.points)
    inner = (s > 0) & (s < 1)
    assert np.abs(distance - RADIUS)[inner].max() < 0.02 * RADIUS
    assert np.quantile(np.abs(distance - RADIUS)[inner], 0.97) < 1e-6
    np.testing.assert_allclose(seen.line.points(50)[:, 2], 0.5 - RADIUS)
    assert seen.line.length == pytest.approx(ROPE.length, rel=1e-9)


def test_a_pixel_is_as_large_as_the_focal_length_says() -> None:
    # Near the middle of the image, where perspective adds little to the silhouette.
    points = sensor_cloud(bar((-0.05, -0.02, 0), (0.05, 0.02, 0)), 0.01, EXACT).points
    area = 0.02 * np.hypot(0.1, 0.04) * (640 / 0.49) ** 2
    assert len(points) == pytest.approx(area, rel=0.02)


def test_the_picture_is_not_mirrored() -> None:
    # From above: up (y) on its way to the right (x). In the image y goes down.
    seen = sensor_cloud(bar((-0.2, -0.05, 0), (0.2, 0.05, 0)), RADIUS, EXACT)
    x, y, _ = seen.points.T
    assert y[x > 0.15].max() < -0.03 and y[x < -0.15].min() > 0.03


def test_a_wider_mask_adds_the_table(rope: SensorCloud) -> None:
    exact = sensor_cloud(ROPE, RADIUS, EXACT, mask_grow=2)
    table = ~exact.is_object
    assert 0.2 < table.mean() < 0.45
    np.testing.assert_allclose(exact.points[table, 2], 0.5)
    assert exact.points[exact.is_object, 2].max() < 0.5
    narrow, same = (sensor_cloud(ROPE, RADIUS, EXACT, mask_grow=grow) for grow in (-2, 0))
    assert len(narrow.points) < len(same.points) < len(exact.points)
    assert same.is_object.all() and narrow.is_object.all()
    # Of ten pixels across four are gone.
    assert len(narrow.points) / len(same.points) == pytest.approx(0.6, abs=0.07)
    assert 0.05 < (~rope.is_object).mean() < 0.4


@pytest.mark.parametrize("tilt", [0.0, 35.0])
def test_both_frames_are_one_scene(tilt: float) -> None:
    options: dict[str, Any] = {"tilt": tilt, "azimuth": 50.0, "seed": 4, "mask_grow": 3}
    own = sensor_cloud(ROPE, RADIUS, EXACT, distance=0.7, **options)
    world = sensor_cloud(ROPE, RADIUS, EXACT, distance=0.7, world=True, **options)
    np.testing.assert_array_equal(own.viewpoint, [0, 0, 0, 1, 0, 0, 0])
    place, rotation = world.viewpoint[:3], from_quaternion(world.viewpoint[3:])
    np.testing.assert_allclose(own.points @ rotation.T + place, world.points, atol=1e-12)
    np.testing.assert_allclose(own.line.points(20) @ rotation.T + place, world.line.points(20), atol=1e-12)
    # The table is z = 0, the object on it, the sensor above.
    np.testing.assert_allclose(world.points[~world.is_object, 2], 0.0, atol=1e-12)
    assert world.points[world.is_object, 2].max() == pytest.approx(2 * RADIUS, abs=1e-5)
    assert place[2] == pytest.approx(0.7 * np.cos(np.radians(tilt)))
    assert np.linalg.norm(place) == pytest.approx(0.7)
    # It looks at the middle of the table.
    np.testing.assert_allclose(rotation[:, 2], -place / 0.7, atol=1e-12)


def test_the_upper_strand_hides_the_lower_one() -> None:
    loop = loop_centre_line(0.8, 2.1 * RADIUS)
    seen = sensor_cloud(loop, RADIUS, EXACT)
    points = seen.points
    s, _ = seen.line.nearest(points)
    # The curve crosses itself where its own parameter is -1 and 1 of -1.65 to 1.65; z upwards is highest at t = 1.
    t = seen.line.parameter(s) * 3.3 - 1.65
    at = points[np.abs(points[:, :2] - crossing(seen.line)).max(axis=1) < 0.5 * RADIUS]
    near = seen.line.parameter(seen.line.nearest(at)[0]) * 3.3 - 1.65
    assert len(at) > 10
    assert len(np.unique(np.sign(near))) == 1
    # Elsewhere both are seen.
    assert (t < -1.2).any() and (t > 1.2).any()


def crossing(line: CentreLine) -> Array:
    """x, y of the place where the loop crosses itself."""
    at = np.array([0.65 / 3.3, 2.65 / 3.3])
    place: Array = line.curve(at, 0)[:, :2].mean(axis=0)
    return place


def test_noise_on_a_rope_is_that_of_real_frames() -> None:
    """Figures of seven frames of a real rope 5.3 mm thick at 0.46 m: see tests/tools/sensor_check.py."""
    seen = sensor_cloud(ROPE, 0.00265, "realsense-d435", distance=0.46, seed=2)
    assert 21_400 < len(seen.points) < 23_100
    residual = 1e3 * (seen.points[:, 2] - (seen.line.points(2)[0, 2] - 0.00265))
    assert residual.std() == pytest.approx(1.3, abs=0.3)
    steps = np.diff(np.unique(np.round(seen.points[:, 2], 6)))
    assert np.median(steps) == pytest.approx(1e-3)
    # Averaged over a stretch longer than the correlation it is still there.
    s, _ = seen.line.nearest(seen.points)
    stretch = np.floor(s * seen.line.length / 0.004).astype(int)
    count = np.maximum(np.bincount(stretch), 1)
    assert (np.bincount(stretch, residual) / count).std() > 0.7


def test_holes_and_frames() -> None:
    whole, holed = (sensor_cloud(ROPE, RADIUS, EXACT, holes=share) for share in (0.0, 0.3))
    assert len(holed.points) == pytest.approx(0.7 * len(whole.points), rel=0.01)
    noisy = replace(EXACT, depth_std=(0.001, 0.0, 0.0))
    one, nine = (sensor_cloud(ROPE, RADIUS, noisy, frames=frames).points[:, 2] for frames in (1, 9))
    exact = whole.points[:, 2]
    assert (one - exact).std() == pytest.approx(0.001, rel=0.05)
    assert (nine - exact).std() == pytest.approx(0.001 / 3, rel=0.05)


def test_a_laser_scans_in_lines() -> None:
    seen = sensor_cloud(bar((-0.1, -0.1, 0), (0.1, 0.1, 0)), 0.006, "line-laser", world=True)
    at_table = seen.points * (0.6 / (0.6 - seen.points[:, 2:]))
    columns, rows = (np.unique(np.round(at_table[:, axis], 6)) for axis in (0, 1))
    assert np.median(np.diff(columns)) == pytest.approx(0.25e-3, abs=2e-6)
    assert np.median(np.diff(rows)) == pytest.approx(0.5e-3, abs=2e-6)
    s, distance = seen.line.nearest(seen.points)
    assert (distance - 0.006)[(s > 0) & (s < 1)].std() < 0.012e-3


def test_the_scene_and_its_background() -> None:
    seen = sensor_scene(ROPE, RADIUS, "zed2", seed=3, tilt=10.0)
    for cloud in (seen.scene, seen.background):
        assert (cloud.width, cloud.height, len(cloud.points)) == (1280, 720, 1280 * 720)
        assert cloud.viewpoint is not None
    assert np.isfinite(seen.background.points).all()
    shown = seen.is_object
    assert 0.001 < shown.mean() < 0.05
    # The object is before the table by up to its width, and elsewhere there is only noise.
    ahead = seen.background.points[:, 2] - seen.scene.points[:, 2]
    assert np.nanmedian(ahead[shown]) == pytest.approx(1.6 * RADIUS, rel=0.4)
    assert abs(np.nanmedian(ahead[~shown])) < 1e-4


@pytest.mark.parametrize("name", SENSORS)
def test_every_sensor_sees_a_hose(name: str) -> None:
    seen = sensor_cloud(ROPE, 0.012, name, distance=None, seed=5)
    again = sensor_cloud(ROPE, 0.012, name, distance=None, seed=5)
    other = sensor_cloud(ROPE, 0.012, name, distance=None, seed=6)
    np.testing.assert_array_equal(seen.points, again.points)
    assert seen.points.shape != other.points.shape or not np.array_equal(seen.points, other.points)
    s, distance = seen.line.nearest(seen.points[::5])
    inner = seen.is_object[::5] & (s > 0) & (s < 1)
    noise = SENSORS[name].noise(np.array([SENSORS[name].usual]))[0]
    assert np.median(np.abs(distance - 0.012)[inner]) < 1.5 * noise + 0.3e-3
    # It is seen from end to end.
    assert s.min() < 0.02 and s.max() > 0.98


def test_points_do_as_a_curve() -> None:
    line = bar((0, 0, 0), (0.1, 0.05, 0), (0.2, 0, 0))
    points = [(0, 0, 0), (0.1, 0.05, 0), (0.2, 0, 0)]
    np.testing.assert_array_equal(
        sensor_cloud(line, RADIUS, "azure-kinect").points, sensor_cloud(points, RADIUS, "azure-kinect").points
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensor": "kinect-v9"}, "kinect-v9"),
        ({"distance": 0.3}, "whole object"),
        ({"distance": 0.2}, "depths"),
        ({"distance": 20.0}, "depths"),
        ({"distance": -1.0}, "range"),
        ({"tilt": 85.0}, "range"),
        ({"holes": 1.0}, "range"),
        ({"frames": 0}, "range"),
        ({"radius": 0.0}, "range"),
        ({"mask_grow": -20}, "nothing"),
    ],
)
def test_what_cannot_be_seen_is_refused_with_a_hint(options: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {"sensor": "realsense-d435", "radius": RADIUS} | options
    with pytest.raises(UsageError, match=words) as caught:
        sensor_cloud(ROPE, **arguments)
    assert caught.value.hint


def test_the_distance_that_is_named_is_enough() -> None:
    with pytest.raises(UsageError, match="whole object") as caught:
        sensor_cloud(ROPE, RADIUS, REALSENSE_D435, distance=0.3)
    distance = float((caught.value.hint or "").split("about ")[1].split(" m")[0])
    sensor_cloud(ROPE, RADIUS, REALSENSE_D435, distance=distance + 0.01)


def test_a_frame_is_fast() -> None:
    start = time.process_time()
    sensor_cloud(ROPE, 0.00265, "realsense-d435", distance=0.46)
    assert time.process_time() - start < 2.5
