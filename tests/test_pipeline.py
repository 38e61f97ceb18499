"""The whole fit: what it says about clouds that are not what they should be."""

from __future__ import annotations

import numpy as np
import pytest

import dlogen
from dlogen.errors import FitError
from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube


def codes(result) -> dict[str, str]:
    return {finding.code: finding.severity for finding in result.quality.findings if finding.severity != "note"}


@pytest.fixture(scope="module")
def cloud():
    return sample_tube(random_centre_line(3, clearance=0.08), 0.015, 5000, 0)


def test_a_table_is_refused_with_what_to_do() -> None:
    table = np.random.default_rng(0).uniform([0.0, 0.0, 0.0], [1.2, 0.6, 0.002], (20000, 3))
    with pytest.raises(FitError, match="no chain can be made of this cloud") as refused:
        dlogen.fit(table)
    assert "dlogen extract" in refused.value.hint


@pytest.mark.parametrize("marker", [1e6, 3.4028235e38])
def test_markers_of_missing_data_are_left_out(cloud, marker: float) -> None:
    result = dlogen.fit(np.concatenate([cloud.points, np.diag([marker] * 3)]))
    np.testing.assert_array_equal(result.chain.joints, dlogen.fit(cloud.points).chain.joints)
    assert "3 points" in next(item.message for item in result.quality.findings if item.code == "stray-points")
    assert (result.provenance["points"], result.provenance["points_used"]) == (5003, 5000)


@pytest.mark.parametrize(("units", "scale"), [("m", 1.0), ("mm", 1e-3)])
def test_a_cloud_in_its_sensors_frame_comes_to_the_world_in_metres(cloud, units: str, scale: float) -> None:
    """The sensor stands at 2, -1, 0.5 m and looks down: z of the sensor is -z of the world."""
    place, turn = np.array([2.0, -1.0, 0.5]), np.diag([1.0, -1.0, -1.0])
    seen = dlogen.Cloud(cloud.points / scale, viewpoint=place / scale, orientation=np.array([0.0, 1.0, 0.0, 0.0]))
    result = dlogen.fit(seen, {"units": units, "frame": {"use_viewpoint": True}})
    assert result.frame.transform[:3, 3] == pytest.approx(place)
    # Back in the sensor's frame the joints lie in the tube that was seen.
    inside = (result.chain.joints - place) @ turn
    assert cloud.truth.nearest(inside)[1].max() < 0.5 * cloud.radius


def test_points_on_the_centre_line(cloud) -> None:
    points = cloud.truth.points(1000)
    assert codes(dlogen.fit(points)) == {"radius-unknown": "doubtful"}
    for options in ({}, {"profile": "paper", "projection": {"enabled": False}}):
        result = dlogen.fit(points, {"r": 0.015, **options})
        assert codes(result) == {}
        assert result.residual.rms < 0.002
        assert result.skeleton.length == pytest.approx(cloud.truth.length, rel=0.01)


@pytest.mark.parametrize("profile", ["refined", "paper"])
@pytest.mark.parametrize("factor", [0.6, 0.8, 1.25, 1.5])
def test_a_wrong_radius_is_never_called_good(cloud, profile: str, factor: float) -> None:
    try:
        assert "radius-mismatch" in codes(dlogen.fit(cloud.points, {"profile": profile, "r": 0.015 * factor}))
    except FitError as error:
        assert "check r" in error.hint


@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_the_right_radius_is(cloud, profile: str) -> None:
    assert codes(dlogen.fit(cloud.points, {"profile": profile, "r": 0.015})) == {}


@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_an_object_that_is_thicker_at_one_end(cloud, profile: str) -> None:
    s, _ = cloud.truth.nearest(cloud.points)
    axis = cloud.truth(s)
    tapered = axis + (cloud.points - axis) * (1.4 - 0.8 * s)[:, None]
    assert "radius-varies" in codes(dlogen.fit(tapered, {"profile": profile}))


@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_two_objects_side_by_side_are_not_called_good(cloud, profile: str) -> None:
    both = np.concatenate([cloud.points, cloud.points + np.array([0.0, 0.0, 0.045])])
    assert dlogen.fit(both, {"profile": profile}).quality.verdict != "good"


@pytest.mark.parametrize("given", [{}, {"r": 0.01}])
def test_strands_side_by_side(given) -> None:
    # A hairpin with a diameter of free space between its legs.
    turn = np.linspace(-np.pi / 2, np.pi / 2, 60)
    leg = np.linspace(0.0, 0.29, 59)
    flat = np.concatenate(
        [
            np.c_[leg, np.full(59, -0.02)],
            np.c_[0.3 + 0.02 * np.cos(turn), 0.02 * np.sin(turn)],
            np.c_[leg[::-1], np.full(59, 0.02)],
        ]
    )
    cloud = sample_tube(from_points(np.c_[flat, np.zeros(len(flat))]), 0.01, 5000, 1)
    result = dlogen.fit(cloud.points, given)
    assert result.quality.verdict == "good"
    _, distance = cloud.truth.nearest(result.skeleton_points)
    assert distance.max() < 0.001
    assert result.skeleton.length == pytest.approx(cloud.truth.length, rel=0.003)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("distance", [2.1, 2.5, 3.0, 4.0])
def test_two_objects_whose_ends_lie_side_by_side_are_not_joined_by_a_bend(distance: float, seed: int) -> None:
    x = np.linspace(0.0, 1.0, 100)
    axis = np.c_[x, 0.08 * np.sin(4 * x), 0.03 * np.cos(3 * x)]
    both = [axis, axis + np.array([0.0, distance * 0.01, 0.0])]
    points = [
        sample_tube(from_points(part), 0.01, 5000, 10 * seed + k, noise=3e-4).points for k, part in enumerate(both)
    ]
    assert dlogen.fit(np.concatenate(points)).quality.verdict != "good"
