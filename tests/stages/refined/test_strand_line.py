"""What is said of a strip."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from strips import Strip, loop, strip, wave

import dlogen


def codes(result: dlogen.Result) -> dict[str, str]:
    return {item.code: item.severity for item in result.quality.findings}


@pytest.mark.parametrize("seed", [1, 2])
def test_a_rope_before_a_depth_camera(seed: int) -> None:
    """The camera is recognised by its pixels."""
    cloud = strip(wave(), 0.003, noise=0.0015, seed=seed)
    result = dlogen.fit(cloud.points)
    assert not result.quality.is_bad and codes(result)["strand"] == "note"
    assert result.skeleton.length == pytest.approx(cloud.length, rel=0.02)
    assert cKDTree(cloud.axis).query(result.skeleton_points)[0].mean() < 0.3 * 0.003 + 0.0005


def test_strands_that_cross_are_followed_straight_on() -> None:
    cloud = strip(loop(), 0.004, noise=0.0012, seed=3)
    result = dlogen.fit(cloud.points)
    assert not result.quality.is_bad
    assert result.skeleton.length == pytest.approx(cloud.length, rel=0.02)
    # In order: equal shares of the length are in the same place, or in that of the reversed line.
    even = np.linspace(0.0, 1.0, 200)
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(cloud.axis, axis=0), axis=1))) / cloud.length
    truth = np.stack([np.interp(even, s, column) for column in cloud.axis.T], axis=1)
    line = result.skeleton_points[np.linspace(0, 999, 200).round().astype(int)]
    assert min(np.linalg.norm(line - way, axis=1).max() for way in (truth, truth[::-1])) < 0.02
    assert codes(result)["crossing"] == "note"


def test_moved_away_from_the_camera_the_side_is_told_or_said_to_be_unknown() -> None:
    """No pixels, no viewpoint: the strip is the same for a camera on the other side."""
    cloud = strip(wave(), 0.003, noise=0.0015, seed=1)
    result = dlogen.fit(cloud.points + np.array([0.3, 0.2, 0.1]) + 0.0)
    assert not result.quality.is_good
    assert codes(result)["side-unknown"] == "doubtful"


def test_a_viewpoint_in_the_file_is_used() -> None:
    cloud = strip(wave(), 0.003, noise=0.0015, seed=1)
    offset = np.array([0.3, 0.2, 0.1])
    result = dlogen.fit(dlogen.Cloud(cloud.points + offset, viewpoint=offset))
    assert "side-unknown" not in codes(result)
    assert result.skeleton.length == pytest.approx(cloud.length, rel=0.02)
    assert np.median(result.skeleton_points[:, 2]) == pytest.approx(0.6, abs=0.0012)


def test_a_wrong_given_radius_is_contradicted_by_the_width() -> None:
    cloud = strip(wave(), 0.003, noise=0.0015, seed=1)
    assert "radius-mismatch" not in codes(dlogen.fit(cloud.points, {"r": 0.003}))
    assert codes(dlogen.fit(cloud.points, {"r": 0.0015}))["radius-mismatch"] == "doubtful"


def test_wider_stretches_are_noted() -> None:
    cloud = strip(wave(), 0.003, noise=0.001, seed=1)
    knot = strip(wave()[:200], 0.006, noise=0.001, seed=2)
    both = Strip(np.concatenate([cloud.points, knot.points]), cloud.axis, 0.003)
    result = dlogen.fit(both.points)
    assert codes(result)["radius-varies"] == "note"
    assert result.chain.radius == pytest.approx(0.003, rel=0.15)
