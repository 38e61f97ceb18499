"""Background subtraction on a simulated scene, where it is known which pixels show the object."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlogen.errors import FitError, InputError
from dlogen.evaluation.camera import KINECT_V1, Capture, capture, hose_capture
from dlogen.evaluation.shapes import hose_centre_line
from dlogen.stages.extract import down_sample, extract, main_parts
from dlogen.types import Cloud, RawCloud

#: A quarter of the pixels, for what does not depend on their number.
SMALL = replace(KINECT_V1, width=320, height=240, focal=292.5)


def small_capture(seed: int) -> Capture:
    return capture(hose_centre_line(), 0.02, np.random.default_rng(seed), SMALL)


@pytest.fixture(scope="module")
def full_hose() -> Capture:
    return hose_capture(1)


@pytest.fixture(scope="module")
def hose() -> Capture:
    return small_capture(1)


def shuffled(cloud: RawCloud, seed: int) -> tuple[RawCloud, np.ndarray]:
    """The same points as an unorganised cloud without NaN, and which rows they were."""
    rows = np.flatnonzero(np.isfinite(cloud.points).all(axis=1))
    rows = np.random.default_rng(seed).permutation(rows)
    return RawCloud(cloud.points[rows], width=len(rows)), rows


def precision_and_recall(found: Cloud, scene: np.ndarray, is_object: np.ndarray) -> tuple[float, float]:
    """Of the points found, how many are the object's; of the object's points that were seen, how many were found."""
    truth = {point.tobytes() for point in scene[is_object & np.isfinite(scene).all(axis=1)]}
    result = {point.tobytes() for point in found.points}
    assert len(result) == len(found), "a point was given twice"
    return len(result & truth) / len(result), len(result & truth) / len(truth)


def test_organised(full_hose: Capture) -> None:
    found = extract(full_hose.scene, full_hose.background, count=None)
    precision, recall = precision_and_recall(found, full_hose.scene.points, full_hose.is_object)
    assert precision > 0.98 and recall > 0.95
    assert found.viewpoint is not None and found.viewpoint.tolist() == [0, 0, 0]
    assert found.dropped.non_finite == np.isnan(full_hose.scene.points[:, 0]).sum()


def test_unorganised(full_hose: Capture) -> None:
    (scene, rows), (background, _) = shuffled(full_hose.scene, 0), shuffled(full_hose.background, 1)
    found = extract(scene, background, count=None)
    precision, recall = precision_and_recall(found, scene.points, full_hose.is_object[rows])
    assert precision > 0.98 and recall > 0.95


def test_an_organised_scene_with_an_unorganised_background(hose: Capture) -> None:
    found = extract(hose.scene, shuffled(hose.background, 1)[0], count=None)
    assert min(precision_and_recall(found, hose.scene.points, hose.is_object)) > 0.95


@pytest.mark.parametrize("scale", [1.0, 100.0, 1000.0])
def test_units_do_not_matter_unless_a_threshold_is_given(hose: Capture, scale: float) -> None:
    scene, background = (replace(cloud, points=scale * cloud.points) for cloud in (hose.scene, hose.background))
    same = extract(hose.scene, hose.background, count=None)
    np.testing.assert_allclose(extract(scene, background, count=None).points, scale * same.points)
    given = extract(hose.scene, hose.background, threshold=0.0101, count=None)
    np.testing.assert_allclose(
        extract(scene, background, threshold=0.0101 * scale, count=None).points, scale * given.points
    )


def test_another_frame_with_the_sensors_pose(hose: Capture) -> None:
    # Seen in a world whose z is upwards, with the camera 1.2 m above the ground.
    turn, place = np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 1.2])
    pose = np.array([*place, 0.0, 1.0, 0.0, 0.0])

    def in_world(cloud: RawCloud) -> RawCloud:
        return replace(cloud, points=cloud.points @ turn.T + place, viewpoint=pose)

    found = extract(in_world(hose.scene), in_world(hose.background), count=None)
    expected = extract(hose.scene, hose.background, count=None)
    assert len(found) == pytest.approx(len(expected), rel=1e-3)
    assert found.viewpoint is not None and found.viewpoint.tolist() == place.tolist()


def test_threshold(hose: Capture) -> None:
    counts = [
        len(extract(hose.scene, hose.background, threshold=threshold, count=None)) for threshold in (0.01, 0.02, 0.035)
    ]
    assert counts[0] > counts[1] > counts[2] > 0
    high = extract(hose.scene, hose.background, threshold=0.035, count=None)
    # The background's noise is 1 mm: what is 35 mm nearer lies within 5 mm of the hose's top, give or take the noise.
    distance = np.linalg.norm(high.points, axis=1) / high.points[:, 2]
    assert ((0.8 - high.points[:, 2]) * distance).min() > 0.03
    for cloud in (shuffled(hose.scene, 0)[0], hose.scene):
        with pytest.raises(FitError, match="nothing differs"):
            extract(cloud, shuffled(hose.background, 0)[0], threshold=0.2)


def test_pixels_that_only_the_scene_sees_are_the_objects(hose: Capture) -> None:
    # A shiny table that gives no depth at all around the object.
    points = hose.background.points.copy()
    points[hose.is_object] = np.nan
    found = extract(hose.scene, replace(hose.background, points=points), count=None)
    assert min(precision_and_recall(found, hose.scene.points, hose.is_object)) > 0.99


def test_drivers_that_write_zero_for_nothing_seen(hose: Capture) -> None:
    scene, background = (replace(cloud, points=np.nan_to_num(cloud.points)) for cloud in (hose.scene, hose.background))
    found = extract(scene, background, count=None)
    np.testing.assert_array_equal(found.points, extract(hose.scene, hose.background, count=None).points)


def test_what_was_taken_away_does_not_raise_the_threshold(hose: Capture) -> None:
    # A box of 60 mm on a fortieth of the table was there only when the background was taken.
    image = hose.background.points.reshape(240, 320, 3).copy()
    image[100:150, 140:180] *= (0.74 / image[100:150, 140:180, 2])[..., None]
    found = extract(hose.scene, replace(hose.background, points=image.reshape(-1, 3)), count=None)
    precision, recall = precision_and_recall(found, hose.scene.points, hose.is_object)
    assert precision > 0.98 and recall > 0.95


def test_specks_are_removed(hose: Capture) -> None:
    rng = np.random.default_rng(5)
    points = hose.scene.points.copy()
    table = np.flatnonzero(~hose.is_object)
    loose = rng.choice(table, 100, replace=False)
    blob = (np.arange(10, 16)[:, None] * 320 + np.arange(280, 286)).ravel()
    specks = np.concatenate([loose, blob])
    points[specks] *= 0.9
    found = extract(replace(hose.scene, points=points), hose.background, count=None)
    kept = {point.tobytes() for point in found.points}
    far = [row for row in specks if not hose.is_object[max(row - 10, 0) : row + 10].any()]
    assert sum(points[row].tobytes() in kept for row in far) == 0
    assert precision_and_recall(found, points, hose.is_object)[1] > 0.95


def test_parts_of_an_object_that_is_hidden_in_between_are_kept(hose: Capture) -> None:
    # Something dark lies across the hose: a gap of 30 pixels.
    image = hose.scene.points.reshape(240, 320, 3).copy()
    image[:, 145:175] = np.nan
    hidden = image.reshape(-1, 3)
    found = extract(replace(hose.scene, points=hidden), hose.background, count=None)
    assert precision_and_recall(found, hidden, hose.is_object)[1] > 0.95


def test_main_parts_of_many_points_agrees_with_that_of_few(monkeypatch: pytest.MonkeyPatch, hose: Capture) -> None:
    rng = np.random.default_rng(1)
    tube = hose.scene.points[hose.is_object & np.isfinite(hose.scene.points[:, 0])]
    points = np.concatenate([tube, rng.uniform(-1, 1, (50, 3)) + np.array([0, 0, 5.0])])
    assert main_parts(points)[: len(tube)].mean() > 0.99 and not main_parts(points)[len(tube) :].any()
    monkeypatch.setattr("dlogen.stages.extract._MOST", 3000)
    assert main_parts(points)[: len(tube)].mean() > 0.98
    # A loose point may be all too near to one that was not chosen, but most are found.
    assert main_parts(points)[len(tube) :].mean() < 0.1


def test_nothing_there(hose: Capture) -> None:
    with pytest.raises(FitError, match="nothing differs"):
        extract(hose.background, hose.background)
    other = small_capture(2).background
    with pytest.raises(FitError, match="nothing differs"):
        extract(other, hose.background)


@pytest.mark.parametrize("shift", [-0.05, 0.05])
def test_a_moved_camera_is_an_error(hose: Capture, shift: float) -> None:
    points = hose.scene.points * (1 + shift)
    with pytest.raises(FitError) as caught:
        extract(replace(hose.scene, points=points), hose.background)
    assert caught.value.hint
    if shift < 0:
        assert "moved" in caught.value.message
        with pytest.raises(FitError, match="moved"):
            extract(shuffled(replace(hose.scene, points=points), 0)[0], shuffled(hose.background, 1)[0])


def test_clouds_that_do_not_belong_together(hose: Capture) -> None:
    half = replace(hose.background, points=hose.background.points[: 320 * 120], height=120)
    with pytest.raises(InputError, match=r"320 x 240 .* 320 x 120"):
        extract(hose.scene, half)
    elsewhere = replace(hose.background, viewpoint=np.array([0.1, 0, 0, 1, 0, 0, 0]))
    with pytest.raises(InputError, match="different places"):
        extract(hose.scene, elsewhere)


@pytest.mark.parametrize("empty", [np.zeros((0, 3)), np.full((5, 3), np.nan)])
def test_clouds_without_points(hose: Capture, empty: np.ndarray) -> None:
    with pytest.raises(InputError, match="background has no finite point"):
        extract(hose.scene, RawCloud(empty))
    with pytest.raises(InputError, match="scene has no finite point"):
        extract(RawCloud(empty), hose.background)


def test_tiny_clouds() -> None:
    column = np.arange(12)[:, None] * [0.0, 0.0, 1.0]
    found = extract(
        RawCloud(np.vstack([[9.0, 0, 0]] * 4 + [*column])), RawCloud(np.array([[9.0, 0, 0]])), threshold=0.5
    )
    np.testing.assert_array_equal(found.points, column)
    with pytest.raises(FitError, match="nothing differs"):
        extract(RawCloud(np.array([[0, 0, 1.0], [0, 0, 2.0]])), RawCloud(np.array([[0, 0, 1.0]])), threshold=0.5)


def test_drawing_is_reproducible_unbiased_and_without_repetition(hose: Capture) -> None:
    whole = extract(hose.scene, hose.background, count=None)
    kwargs: dict[str, Any] = {"count": 5000, "seed": 3}
    first, again = (extract(hose.scene, hose.background, **kwargs) for _ in range(2))
    np.testing.assert_array_equal(first.points, again.points)
    assert len(first) == len({point.tobytes() for point in first.points}) == 5000
    assert not np.array_equal(first.points, down_sample(whole, 5000, seed=4).points)
    np.testing.assert_array_equal(first.points, down_sample(whole, 5000, seed=3).points)
    # Means over many drawings come near the mean of all; one drawing keeps to the sampling error.
    error = first.points.mean(axis=0) - whole.points.mean(axis=0)
    assert (np.abs(error) < 4 * whole.points.std(axis=0) / np.sqrt(5000)).all()
    means = [down_sample(whole, 50, seed).points.mean(axis=0) for seed in range(400)]
    error = np.mean(means, axis=0) - whole.points.mean(axis=0)
    assert (np.abs(error) < 4 * whole.points.std(axis=0) / np.sqrt(50 * 400)).all()
    assert down_sample(whole, len(whole)) is whole


def test_normals_go_with_their_points(hose: Capture) -> None:
    rows = np.arange(len(hose.scene.points), dtype=float)
    scene = replace(hose.scene, normals=np.stack([rows, rows, rows], axis=1))
    found = extract(scene, hose.background, count=100)
    assert found.normals is not None
    np.testing.assert_array_equal(scene.points[found.normals[:, 0].astype(int)], found.points)
