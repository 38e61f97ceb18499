"""What every cloud goes through first: finite points, each place once, normals of unit length."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dlogen.errors import InputError
from dlogen.stages import clean as cleaning
from dlogen.stages.clean import clean, vectors

POINTS = np.array([[0.5, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]])


class TestCleaning:
    def test_counts_order_and_alignment(self):
        points = np.array(
            [[3, 3, 3], [1, 1, 1], [np.nan, 0, 0], [3, 3, 3], [2, 2, 2], [0, np.inf, 0], [1, 1, 1], [1, 1, 2.0]]
        )
        normals = np.arange(24.0).reshape(8, 3) + 1.0
        cloud = clean(points, normals, viewpoint=[1, 2, 3])
        assert cloud.points.tolist() == [[3, 3, 3], [1, 1, 1], [2, 2, 2], [1, 1, 2]]
        expected = normals[[0, 1, 4, 7]]
        assert cloud.normals == pytest.approx(expected / np.linalg.norm(expected, axis=1, keepdims=True))
        assert (cloud.dropped.non_finite, cloud.dropped.duplicates) == (2, 2)
        assert cloud.viewpoint.tolist() == [1, 2, 3]
        assert cloud.source is None

    @settings(deadline=None)
    @given(
        arrays(
            np.float64,
            st.tuples(st.integers(1, 60), st.just(3)),
            elements=st.sampled_from([0.0, -0.0, 1.0, 1e-300, 5e6]),
        )
    )
    def test_first_of_equal_points_in_file_order(self, points):
        _, first = np.unique(points, axis=0, return_index=True)
        assert np.array_equal(clean(points).points, points[np.sort(first)])

    def test_colliding_hashes_are_not_duplicates(self, monkeypatch):
        monkeypatch.setattr(cleaning, "_row_hashes", lambda points: np.zeros(len(points), dtype=np.uint64))
        points = np.random.default_rng(0).integers(0, 3, (200, 3)).astype(float)
        _, first = np.unique(points, axis=0, return_index=True)
        assert np.array_equal(clean(points).points, points[np.sort(first)])

    @pytest.mark.parametrize("step", [1.0, 1e-3, 0.5, 1 / 3, 2.0**-20])
    def test_hashes_of_grids_do_not_collide(self, step):
        grid = step * np.stack(np.meshgrid(*[np.arange(-16.0, 16.0)] * 3), axis=-1).reshape(-1, 3)
        for points in (grid, grid.astype(np.float32).astype(float), grid + 5e6):
            assert len(np.unique(cleaning._row_hashes(points))) == len(np.unique(points, axis=0))

    def test_neighbours_in_floating_point_are_two_points(self):
        assert len(clean([[1.0, 1.0, 1.0], [np.nextafter(1.0, 2.0), 1.0, 1.0]])) == 2

    def test_duplicates_are_found_quickly(self):
        points = np.random.default_rng(0).normal(size=(100_000, 3))
        points = np.concatenate([points, points])
        assert len(cleaning._first_occurrences(points)) == 100_000
        sorting_rows = _seconds(lambda: np.unique(points, axis=0))
        assert _seconds(lambda: cleaning._first_occurrences(points)) < sorting_rows / 2  # a tenth on a free machine

    def test_few_unusable_normals_become_zero(self):
        points = np.random.default_rng(0).normal(size=(1000, 3))
        normals = np.full((1000, 3), 2.0)
        normals[3], normals[5], normals[7, 0] = np.nan, 0.0, np.inf
        cloud = clean(points, normals)
        assert np.flatnonzero(~cloud.normals.any(axis=1)).tolist() == [3, 5, 7]
        assert np.linalg.norm(np.delete(cloud.normals, [3, 5, 7], axis=0), axis=1) == pytest.approx(1.0)

    def test_many_unusable_normals_are_left_out(self):
        assert clean(POINTS, np.zeros((4, 3))).normals is None
        assert clean(POINTS, [[0, 0, 1], [0, 0, 1], [0, 0, 1], [np.nan, 0, 1]]).normals is None

    @pytest.mark.parametrize(
        ("points", "message"),
        [
            (np.empty((0, 3)), "there are no points"),
            (np.full((5, 3), np.nan), "all 5 points are NaN or infinite"),
            (np.zeros((4, 2)), r"the points have the shape \(4, 2\), not \(M, 3\)"),
            (np.zeros(3), r"the shape \(3,\)"),
            ([["a", "b", "c"]], "the points are not numbers"),
            ([[1, 2, 3], [4, 5]], "the points are not numbers"),
            (None, "the points have the shape"),
        ],
    )
    def test_refused(self, points, message):
        with pytest.raises(InputError, match=message) as caught:
            clean(points)
        assert caught.value.hint

    def test_one_normal_for_each_point(self):
        with pytest.raises(InputError, match="3 normals for 4 points"):
            clean(POINTS, POINTS[:3])

    def test_integers_and_lists(self):
        assert clean([[1, 2, 3], [4, 5, 6]]).points.dtype == np.float64

    def test_the_array_given_is_left_alone(self):
        points = np.array([[np.nan, 0, 0], [1, 2, 3], [1, 2, 3]])
        before = points.copy()
        clean(points)
        assert np.array_equal(points, before, equal_nan=True)

    def test_a_pose_is_a_place_and_an_orientation(self):
        cloud = clean(POINTS, viewpoint=[1, 2, 3, 0.5, -0.5, 0.1, 0.7])
        assert cloud.viewpoint.tolist() == [1, 2, 3]
        assert cloud.orientation.tolist() == [0.5, -0.5, 0.1, 0.7]
        assert clean(POINTS, viewpoint=[1, 2, 3]).orientation is None
        assert clean(POINTS).viewpoint is None

    def test_vectors_name_what_they_are(self):
        assert vectors([[1, 2, 3]], "normals").tolist() == [[1.0, 2.0, 3.0]]
        with pytest.raises(InputError, match=r"the normals have the shape \(2,\), not \(M, 3\)"):
            vectors([1.0, 2.0], "normals")


def _seconds(function):
    """Of the fastest of three calls."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        function()
        taken.append(time.perf_counter() - start)
    return min(taken)
