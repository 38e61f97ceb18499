"""What a sensor makes of an exact depth image, each effect by itself and against its figure in the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dlogen.evaluation.sensors.models import REALSENSE_D435, SENSORS, Sensor
from dlogen.evaluation.sensors.noise import ExactView, grown_mask, hole_pattern, measured, smooth_noise
from dlogen.types import Array, BoolArray

#: A camera without noise whose edges are sharp.
IDEAL = Sensor("ideal", 400, 300, (500.0, 500.0), 1.0, 0.1, 10.0)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def wall(depth: float, shape: tuple[int, int] = (400, 600)) -> ExactView:
    return ExactView(np.full(shape, np.inf), np.full(shape, depth), np.zeros(shape))


def step(near: float, far: float, first: int, last: int, shape: tuple[int, int] = (60, 80)) -> ExactView:
    """A flat object in the columns first to last - 1 of a wall."""
    view = wall(far, shape)
    view.tube[:, first:last], view.cosine[:, first:last] = near, 1.0
    return view


def correlation(field: Array, across: int, down: int) -> float:
    a = field[down:, across:]
    b = field[: field.shape[0] - down, : field.shape[1] - across]
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=list(SENSORS))
def test_noise_of_a_plane_at_two_distances_is_that_of_the_table(sensor: Sensor) -> None:
    for distance in (sensor.usual, 0.9 * min(sensor.farthest, 4.0 * sensor.usual)):
        # A scanner that is moved has the focal length that goes with its distance.
        seen = replace(sensor, focal=(1.0, 1.0)) if sensor.pitch else sensor
        view = wall(distance)
        # A little slanted, so that all places between two steps occur.
        view.table[...] *= np.linspace(0.98, 1.02, view.table.shape[1])
        error = measured(view, seen, rng(1)) - view.table
        assert np.isfinite(error).all()
        steps = sensor.depth_unit
        if sensor.disparity_step:
            steps = np.hypot(steps, sensor.disparity_step * distance**2 / (sensor.focal[0] * sensor.baseline))
        expected = np.hypot(sensor.noise(np.array([distance]))[0], steps / np.sqrt(12.0))
        assert error.std() == pytest.approx(expected, rel=0.08)
        assert abs(error.mean()) < 0.2 * expected


@pytest.mark.parametrize("length", [2.0, 8.0])
def test_correlation_falls_as_it_says_along_rows_and_columns(length: float) -> None:
    field, share = smooth_noise(rng(2).standard_normal((500, 700)), length)
    assert field.std() == pytest.approx(1.0, abs=0.05) and (share == 1.0).all()
    for lag in (1, int(length), int(2 * length)):
        expected = np.exp(-((lag / length) ** 2))
        assert correlation(field, lag, 0) == pytest.approx(expected, abs=0.05)
        assert correlation(field, 0, lag) == pytest.approx(expected, abs=0.05)


def test_depths_of_a_stereo_camera_are_correlated_and_those_of_a_laser_are_not() -> None:
    stereo = measured(wall(2.0), REALSENSE_D435, rng(3))
    length = REALSENSE_D435.correlation
    assert correlation(stereo, round(length), 0) == pytest.approx(np.exp(-((round(length) / length) ** 2)), abs=0.08)
    assert abs(correlation(stereo, 0, round(3 * length))) < 0.08
    laser = measured(wall(2.0), SENSORS["terrestrial"], rng(3))
    assert abs(correlation(laser, 1, 0)) < 0.01 and abs(correlation(laser, 0, 1)) < 0.01


def test_noise_on_a_narrow_object_is_larger_and_shared_over_its_width() -> None:
    sensor = replace(REALSENSE_D435, disparity_step=0.0, depth_unit=0.0, window=1, plain=1.5)
    strips = []
    for seed in range(6):
        depth = measured(step(0.5, 0.6, 100, 106, (1500, 200)), sensor, rng(seed))
        strips.append(depth[:, 100:106] - 0.5)
    strip = np.concatenate(strips)
    # What a Gaussian of standard deviation correlation / (2 sqrt 2), the square of the kernel, has on six columns.
    columns = np.arange(-60, 61)
    kernel = np.exp(-4.0 * (columns / sensor.correlation) ** 2)
    kernel /= kernel.sum()
    shares = [kernel[(columns + at >= 0) & (columns + at < 6)].sum() for at in range(6)]
    expected = 1.5 * sensor.noise(np.array([0.5]))[0] * np.mean([1.0 / share for share in shares]) ** 0.5
    assert strip.std() == pytest.approx(expected, rel=0.08)
    assert np.corrcoef(strip[:, 0], strip[:, 5])[0, 1] > 0.85
    assert np.corrcoef(strip[5:, 0], strip[:-5, 0])[0, 1] == pytest.approx(
        np.exp(-((5 / sensor.correlation) ** 2)), abs=0.06
    )


def test_depth_comes_in_steps_of_the_file() -> None:
    depth = measured(wall(0.46), REALSENSE_D435, rng())
    np.testing.assert_allclose(depth, np.round(1e3 * depth) / 1e3, atol=1e-12)
    assert np.diff(np.unique(np.round(depth, 6))).min() == pytest.approx(1e-3)


def test_depth_comes_in_steps_of_the_disparity() -> None:
    depth = measured(wall(4.0), replace(REALSENSE_D435, depth_unit=0.0), rng())
    disparity = 640.0 * 0.05 / depth * 32.0
    np.testing.assert_allclose(disparity, np.round(disparity), atol=1e-9)
    # At 4 m they are 16 / 32 / 32 m apart.
    levels = np.unique(np.round(depth, 9))
    assert np.median(np.diff(levels)) == pytest.approx(16.0 / 32.0 / 32.0, rel=0.3)


def test_matching_sees_the_object_wider_than_it_is() -> None:
    sensor = replace(IDEAL, window=7, threshold=0.2)
    depth = measured(step(0.9, 1.0, 40, 60), sensor, rng())
    # Outside of the edge the share of the window is 3, 2 and 1 sevenths: two pixels are above a fifth.
    assert np.flatnonzero(depth[30] < 0.95).tolist() == list(range(38, 62))
    np.testing.assert_allclose(np.unique(np.round(depth, 9)), [0.9, 1.0])


def test_an_object_that_fills_too_little_of_the_window_is_lost() -> None:
    sensor = replace(IDEAL, window=7, threshold=0.35)
    assert (measured(step(0.9, 1.0, 40, 42), sensor, rng()) == 1.0).all()
    assert measured(step(0.9, 1.0, 40, 43), sensor, rng()).min() == pytest.approx(0.9)


def test_pixels_at_an_edge_are_between_object_and_table_by_their_share() -> None:
    sensor = replace(IDEAL, window=3, mixing=1.0)
    depth = measured(step(0.9, 1.0, 40, 60), sensor, rng())[30]
    np.testing.assert_allclose(depth[38:43], [1.0, 1.0 - 0.1 / 3, 0.9 + 0.1 / 3, 0.9, 0.9], atol=1e-12)


def test_patches_of_a_thin_object_take_the_depth_of_the_table() -> None:
    sensor = replace(IDEAL, window=7, threshold=0.4, threshold_std=0.1, mixing=0.01)
    depth = measured(step(0.9, 1.0, 40, 43, (4000, 80)), sensor, rng())[:, 41]
    lost = depth > 0.99
    assert 0.2 < lost.mean() < 0.6
    # In patches of about the window's size.
    assert 4 < len(lost) / np.count_nonzero(np.diff(lost.astype(int))) < 40


def test_the_second_camera_does_not_see_the_table_beside_the_object() -> None:
    sensor = replace(IDEAL, baseline=0.1)
    # Disparities of 62.5 and 50 pixels.
    depth = measured(step(0.8, 1.0, 40, 60), sensor, rng())[30]
    assert np.flatnonzero(~np.isfinite(depth)).tolist() == list(range(28, 40))


def test_what_is_steep_or_out_of_range_is_not_seen() -> None:
    view = step(0.9, 1.0, 40, 60)
    view.cosine[:, 40:45] = 0.05
    depth = measured(view, IDEAL, rng())
    assert np.flatnonzero(~np.isfinite(depth[0])).tolist() == [40, 41, 42, 43, 44]
    assert np.isnan(measured(wall(11.0), IDEAL, rng())).all() and np.isnan(measured(wall(0.05), IDEAL, rng())).all()
    assert np.isnan(measured(wall(np.inf), IDEAL, rng())).all()


def test_frames_average_what_is_not_fixed() -> None:
    sensor = replace(IDEAL, depth_std=(0.01, 0.0, 0.0), fixed=0.25)
    one, many = (measured(wall(1.0), sensor, rng(4), frames).std() for frames in (1, 16))
    assert one == pytest.approx(0.01, rel=0.02)
    assert many == pytest.approx(0.01 * np.sqrt(0.25 + 0.75 / 16), rel=0.02)


def test_holes_are_patches_that_prefer_what_is_steep() -> None:
    view = step(0.9, 1.0, 40, 60, (600, 100))
    view.cosine[:, 40:60] = np.abs(np.linspace(-1.0, 1.0, 20))
    lost = hole_pattern(view, 0.2, 10.0, rng())
    shown = view.is_object
    assert not lost[~shown].any()
    assert lost[shown].mean() == pytest.approx(0.2, abs=0.001)
    assert view.cosine[lost].mean() < view.cosine[shown & ~lost].mean() - 0.1
    middle = lost[:, 42]
    assert np.count_nonzero(np.diff(middle.astype(int))) < 0.1 * len(middle)
    assert not hole_pattern(view, 0.0, 10.0, rng()).any()
    # What matching has given the object's depth beside it is lost with it.
    wide = hole_pattern(view, 0.2, 10.0, rng(), 5)
    np.testing.assert_array_equal(wide[shown], lost[shown])
    edge = np.convolve(lost[:, 59], np.ones(5), mode="same") > 0
    np.testing.assert_array_equal(wide[:, 61], edge)
    assert edge.any() and not wide[:, 62:].any() and not wide[:, :38].any()


def bar() -> BoolArray:
    shown = np.zeros((100, 400), dtype=bool)
    shown[40:60, 50:350] = True
    return shown


@pytest.mark.parametrize(("grow", "height", "width"), [(0, 20, 300), (3, 26, 306), (-4, 12, 292)])
def test_masks_grow_and_shrink_by_pixels(grow: int, height: int, width: int) -> None:
    mask = grown_mask(bar(), grow, 0.0, rng())
    assert mask[:, 200].sum() == height and mask[50].sum() == width
    assert mask[50, 200]


def test_the_edge_of_a_mask_wanders() -> None:
    tops = np.concatenate([grown_mask(bar(), 0.0, 1.5, rng(seed))[:50, 80:320].sum(axis=0) for seed in range(20)])
    assert tops.std() == pytest.approx(np.hypot(1.5, 1 / np.sqrt(12)), rel=0.15)
    assert tops.mean() == pytest.approx(10.0, abs=0.3)
    # Slowly: neighbours are alike.
    assert np.abs(np.diff(tops)).mean() < 0.3


def test_an_object_at_the_border_keeps_its_border() -> None:
    shown = np.zeros((20, 20), dtype=bool)
    shown[:5] = True
    assert grown_mask(shown, 2, 0.0, rng())[:, 10].sum() == 7
