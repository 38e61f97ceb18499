"""What is refused before any stage, what marks missing data, and how a cloud comes to metres near the origin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.errors import ConfigError, FitError
from dlogen.stages import prepare as preparing
from dlogen.stages.prepare import (
    MIN_POINTS,
    check_given_radius,
    check_left_out,
    check_points,
    far_away,
    prepare,
    without_far_points,
)
from dlogen.types import Cloud


def refusal(points, **options) -> str:
    with pytest.raises(FitError) as error:
        check_points(np.asarray(points, dtype=float), **options)
    assert error.value.stage == "input"
    assert error.value.hint
    return error.value.message


class TestPoints:
    def test_tubes_pass_in_any_units_and_place(self, tube, half_tube) -> None:
        for points in (tube.points, half_tube.points, 1000 * tube.points, tube.points + np.array([5e6, -4e6, 100.0])):
            check_points(points)

    def test_a_thin_straight_wire_along_an_axis_passes(self, exact_line) -> None:
        rng = np.random.default_rng(0)
        angle = rng.uniform(0, 2 * np.pi, 500)
        wire = np.stack([rng.random(500), 1e-4 * np.cos(angle), 1e-4 * np.sin(angle)], axis=1)
        check_points(wire)
        check_points(wire + np.array([5e6, 0, 0]))

    @pytest.mark.parametrize("count", [0, 1, MIN_POINTS - 1])
    def test_too_few(self, count: int) -> None:
        assert f"{count} points are too few" in refusal(np.random.default_rng(0).random((count, 3)))
        check_points(np.random.default_rng(0).random((MIN_POINTS, 3)))

    @pytest.mark.parametrize("place", [[0, 0, 0], [1, 2, 3], [5e6, 5e6, 0]])
    def test_all_in_one_place(self, place) -> None:
        assert "in one place" in refusal(np.tile(place, (100, 1)))
        # What rounding leaves of one place is one place.
        jitter = np.random.default_rng(0).choice([0, 1e-16], (100, 3))
        assert "in one place" in refusal(np.tile(place, (100, 1)) * (1 + jitter) if any(place) else jitter * 0)

    @pytest.mark.parametrize("axis", range(3))
    def test_flat(self, axis: int) -> None:
        points = np.random.default_rng(0).random((100, 3))
        points[:, axis] = 0.7
        assert f"flat: {'xyz'[axis]} is the same" in refusal(points)
        check_points(points, surface=False)

    def test_pixels(self) -> None:
        pixels = np.random.default_rng(0).integers(0, 640, (500, 3))
        pixels[:, 2] = 0
        assert "pixel data" in refusal(pixels)
        # Whole millimetres in space are no pixels.
        pixels[:, 2] = np.arange(500) % 40
        check_points(pixels.astype(float))

    @pytest.mark.parametrize("scale", [1e-12, 1e12, 1e200])
    def test_sizes_of_no_object(self, tube, scale: float) -> None:
        assert "no object" in refusal(tube.points * scale)


class TestFarAway:
    @pytest.mark.parametrize("marker", [1e6, 1e10, 3.4028235e38, 1e300])
    def test_markers_of_missing_data(self, tube, marker: float) -> None:
        marked = np.array([[marker] * 3, [-marker, 0.0, 0.0], [0.0, marker, 0.0]])
        far = far_away(np.concatenate([tube.points, marked]))
        assert far.tolist() == [False] * len(tube.points) + [True] * 3

    def test_strays_and_survey_coordinates_are_not(self, tube) -> None:
        strays = np.random.default_rng(0).uniform(-20.0, 20.0, (500, 3))
        for points in (np.concatenate([tube.points, strays]), tube.points + np.array([5e6, -4e6, 100.0])):
            assert not far_away(points).any()
        assert not far_away(tube.points[:3]).any()
        assert not far_away(np.tile(tube.points[:1], (50, 1))).any()


def numbered(count: int, scale: float = 1.0) -> Cloud:
    """Points, normals that tell which point they belong to, and a viewpoint."""
    rng = np.random.default_rng(0)
    points = scale * (rng.uniform(-0.5, 0.5, (count, 3)) + np.array([5.0, -2.0, 1.0]))
    return Cloud(points, points / np.linalg.norm(points, axis=1, keepdims=True), scale * np.array([5.0, -2.0, 3.0]))


class TestPrepare:
    @pytest.mark.parametrize(("units", "scale"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001)])
    def test_metres_near_the_origin(self, units: str, scale: float) -> None:
        cloud = numbered(500, 1 / scale)
        made = prepare(cloud, units)
        low, high = scale * cloud.points.min(axis=0), scale * cloud.points.max(axis=0)
        assert (made.units, made.scale) == (units, scale)
        assert made.low == pytest.approx(low)
        assert made.high == pytest.approx(high)
        assert made.extent == pytest.approx(high - low)
        assert made.centre == pytest.approx((low + high) / 2)
        # Back to where they were, row by row; the viewpoint moves with them, the normals do not.
        assert made.cloud.points + made.centre == pytest.approx(scale * cloud.points)
        assert made.cloud.viewpoint + made.centre == pytest.approx(scale * cloud.viewpoint)
        assert np.array_equal(made.cloud.normals, cloud.normals)
        assert np.abs(made.cloud.points).max() <= 0.51

    @pytest.mark.parametrize(("extent", "units"), [(1.0, "m"), (20.0, "m"), (21.0, "cm"), (99.0, "cm"), (1500.0, "mm")])
    def test_units_are_guessed_from_the_extent(self, extent: float, units: str) -> None:
        points = np.linspace([0, 0, 0], [extent, extent / 2, 0.1], 50)
        assert prepare(Cloud(points)).units == units
        assert prepare(Cloud(points + 5e6)).units == units

    def test_survey_coordinates_lose_nothing(self) -> None:
        points = np.random.default_rng(1).random((100, 3))
        far = np.array([4.5e6, 5.2e6, 300.0])
        assert prepare(Cloud(points + far), "m").cloud.points == pytest.approx(
            prepare(Cloud(points), "m").cloud.points, abs=2e-9
        )

    def test_of_many_points_a_part_is_used_whatever_their_order(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(preparing, "MOST_POINTS", 1000)
        cloud = numbered(4000)
        made = prepare(cloud, "m")
        assert len(made.cloud) == pytest.approx(1000, abs=120)
        # Rows stay with their normals, and the place is that of the whole cloud.
        back = made.cloud.points + made.centre
        assert back / np.linalg.norm(back, axis=1, keepdims=True) == pytest.approx(made.cloud.normals)
        assert made.extent == pytest.approx(np.ptp(cloud.points, axis=0))
        order = np.random.default_rng(2).permutation(4000)
        again = prepare(Cloud(cloud.points[order], cloud.normals[order]), "m")
        assert {row.tobytes() for row in again.cloud.normals} == {row.tobytes() for row in made.cloud.normals}


def test_points_far_away_go_with_their_normals() -> None:
    cloud = numbered(300)
    points = cloud.points.copy()
    points[[7, 100]] = 1e10
    near, count = without_far_points(Cloud(points, cloud.normals, cloud.viewpoint))
    assert count == 2
    kept = np.delete(np.arange(300), [7, 100])
    assert np.array_equal(near.points, cloud.points[kept])
    assert np.array_equal(near.normals, cloud.normals[kept])
    assert np.array_equal(near.viewpoint, cloud.viewpoint)
    assert without_far_points(cloud) == (cloud, 0)


@pytest.mark.parametrize(("count", "text"), [(1, "left out 1 point very"), (12, "left out 12 points very")])
def test_what_was_left_out_is_said(count: int, text: str) -> None:
    (finding,) = check_left_out(count)
    assert (finding.code, finding.severity) == ("stray-points", "note")
    assert text in finding.message
    assert check_left_out(0) == []


@given(st.floats(0.01, 100.0))
def test_a_diameter_larger_than_the_cloud_is_refused(extent: float) -> None:
    points = np.array([[1.0, 1.0, 1.0], [1.0, 1.0 + extent, 1.0 + extent / 2]])
    check_given_radius(points, None)
    check_given_radius(points, 0.499 * extent)
    with pytest.raises(ConfigError, match="more than the whole cloud") as caught:
        check_given_radius(points, 0.501 * extent)
    assert "units" in caught.value.hint
