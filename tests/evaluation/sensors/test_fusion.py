"""Several views in one cloud: ghosts, voxels, frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dlogen.errors import UsageError
from dlogen.evaluation.sensors.capture import sensor_cloud
from dlogen.evaluation.sensors.fusion import fused_cloud, thinned
from dlogen.evaluation.sensors.models import Sensor
from dlogen.evaluation.shapes import hose_centre_line

EXACT = Sensor("exact", 640, 480, (500.0, 500.0), 0.7, 0.2, 5.0, grazing=0.0)
ROPE = hose_centre_line(0.8, 0.06)
RADIUS = 0.01


def test_one_view_is_that_of_the_sensor() -> None:
    one = fused_cloud(ROPE, RADIUS, "azure-kinect", seed=3, world=True)
    alone = sensor_cloud(ROPE, RADIUS, "azure-kinect", seed=3, world=True)
    np.testing.assert_array_equal(one.points, alone.points)
    np.testing.assert_array_equal(one.viewpoint, alone.viewpoint)


def test_views_from_around_see_more_of_the_circumference() -> None:
    one, four = (fused_cloud(ROPE, RADIUS, EXACT, views=views, tilt=40.0, world=True) for views in (1, 4))
    assert len(four.points) > 3 * len(one.points)
    s, distance = four.line.nearest(four.points)
    inner = (s > 0) & (s < 1)
    assert np.quantile(np.abs(distance - RADIUS)[inner], 0.95) < 1e-5
    # The first view goes along y: surface that faces that way is hidden from it, and seen from the other side.
    hidden = [
        ((seen.points - seen.line(seen.line.nearest(seen.points)[0]))[:, 1] > 0.9 * RADIUS) for seen in (one, four)
    ]
    assert not hidden[0].any() and hidden[1].sum() > 100


@pytest.mark.parametrize("registration", [0.002, 0.006])
def test_views_are_apart_by_the_error_of_the_registration(registration: float) -> None:
    shifts = []
    for seed in range(12):
        options: dict[str, Any] = {"tilt": 0.0, "seed": seed, "world": True}
        both = fused_cloud(ROPE, RADIUS, EXACT, views=2, registration=registration, **options)
        exact = fused_cloud(ROPE, RADIUS, EXACT, views=2, **options)
        assert len(both.points) == len(exact.points)
        moved = both.points - exact.points
        half = len(moved) // 3
        # The first view is where it was.
        np.testing.assert_array_equal(moved[:half], 0.0)
        shifts.append(moved[-half:].mean(axis=0))
    assert np.std(shifts) == pytest.approx(registration, rel=0.35)


def test_the_frame_of_the_first_view() -> None:
    own, world = (
        fused_cloud(ROPE, RADIUS, "zed2", views=2, registration=0.003, seed=1, world=world) for world in (False, True)
    )
    np.testing.assert_array_equal(own.viewpoint, [0, 0, 0, 1, 0, 0, 0])
    assert np.linalg.norm(world.viewpoint[:3]) == pytest.approx(0.6)
    # Distances from the sensor and from the axis are the same in both.
    np.testing.assert_allclose(
        np.linalg.norm(own.points, axis=1), np.linalg.norm(world.points - world.viewpoint[:3], axis=1), atol=1e-9
    )
    np.testing.assert_allclose(
        own.line.nearest(own.points[::50])[1], world.line.nearest(world.points[::50])[1], atol=1e-9
    )


def test_a_voxel_keeps_one_point() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, size=(5000, 3))
    is_object = points[:, 0] < 0.0
    voxel = 0.25
    for kind in ("centroid", "centre"):
        kept, mine = thinned(points, is_object, voxel, kind)
        assert len(kept) == len(mine) == 8**3
        assert len(np.unique(np.floor(kept / voxel), axis=0)) == len(kept)
        np.testing.assert_array_equal(mine, kept[:, 0] < 0.0)
        centres = (np.floor(kept / voxel) + 0.5) * voxel
        assert np.allclose(kept, centres) == (kind == "centre")
    first = kept[0]
    inside = (np.abs(points - first) < 0.5 * voxel).all(axis=1)
    centroids, _ = thinned(points, is_object, voxel, "centroid")
    np.testing.assert_allclose(centroids[0], points[inside].mean(axis=0))


def test_voxels_in_a_capture() -> None:
    seen = fused_cloud(ROPE, RADIUS, "realsense-l515", voxel=0.004, voxel_point="centre", world=True)
    np.testing.assert_allclose(seen.points / 0.004 - 0.5, np.round(seen.points / 0.004 - 0.5), atol=1e-9)
    assert len(seen.points) == len(seen.is_object)


@pytest.mark.parametrize(
    "options", [{"views": 0}, {"registration": -0.1}, {"voxel": -1.0}, {"voxel_point": "corner"}, {"tilt": 90.0}]
)
def test_what_is_out_of_range_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="range") as caught:
        fused_cloud(ROPE, RADIUS, EXACT, **options)
    assert caught.value.hint
