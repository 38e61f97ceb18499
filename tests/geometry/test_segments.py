"""Foot points on segments against dense sampling and the conditions for the nearest point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dlogen.geometry.segments import distances, feet, places

Array = np.ndarray

numbers = st.floats(-10.0, 10.0, allow_nan=False, width=32)
triples = st.integers(1, 6).flatmap(lambda m: hnp.arrays(float, (3, m, 3), elements=numbers))


@given(triples)
def test_distance_is_the_least_of_dense_samples(points: Array) -> None:
    point, start, end = points
    samples = start[:, None] + np.linspace(0.0, 1.0, 2001)[:, None] * (end - start)[:, None]
    sampled = np.linalg.norm(samples - point[:, None], axis=2).min(axis=1)
    found = distances(point, start, end)
    assert (found <= sampled + 1e-12).all()
    # Between two samples a distance falls by half their distance at most.
    assert (found >= sampled - np.linalg.norm(end - start, axis=1) / 4000 - 1e-12).all()


@given(triples)
def test_the_offset_is_from_the_foot_and_across_the_segment(points: Array) -> None:
    point, start, end = points
    axis = end - start
    place, offset = feet(point, start, axis)
    assert ((place >= 0.0) & (place <= 1.0)).all()
    assert start + place[:, None] * axis + offset == pytest.approx(point, abs=1e-12)
    slope = (offset * axis).sum(axis=1)
    # No nearer place on either side: across inside, pointing away from the segment at its ends.
    assert (slope[place < 1.0] <= 1e-9).all()
    assert (slope[place > 0.0] >= -1e-9).all()
    assert np.array_equal(places(point - start, axis), place)
    assert distances(point, start, end) == pytest.approx(np.linalg.norm(offset, axis=1), abs=1e-15)


@given(triples)
def test_the_distance_knows_no_direction(points: Array) -> None:
    point, start, end = points
    assert distances(point, start, end) == pytest.approx(distances(point, end, start), abs=1e-12)


def test_beside_before_and_behind() -> None:
    start, axis = np.zeros(3), np.array([2.0, 0.0, 0.0])
    points = np.array([[0.5, 3.0, 0.0], [-4.0, 3.0, 0.0], [2.0, 0.0, 1.0], [5.0, 0.0, -4.0]])
    place, offset = feet(points, start, axis)
    assert place.tolist() == [0.25, 0.0, 1.0, 1.0]
    assert offset.tolist() == [[0.0, 3.0, 0.0], [-4.0, 3.0, 0.0], [0.0, 0.0, 1.0], [3.0, 0.0, -4.0]]
    assert distances(points, start, start + axis).tolist() == [3.0, 5.0, 1.0, 5.0]


def test_a_segment_without_length_is_its_start() -> None:
    start = np.array([1.0, 2.0, 3.0])
    place, offset = feet(np.array([1.0, 2.0, 5.0]), start, np.zeros(3))
    assert place == 0.0
    assert offset.tolist() == [0.0, 0.0, 2.0]


def test_points_and_segments_broadcast_and_may_be_columns() -> None:
    rng = np.random.default_rng(0)
    points, start, axis = rng.normal(size=(5, 1, 3)), rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
    place, offset = feet(points, start, axis)
    assert place.shape == (5, 4)
    for i in range(5):
        for j in range(4):
            single = feet(points[i, 0], start[j], axis[j])
            assert place[i, j] == pytest.approx(single[0], abs=1e-15)
            assert offset[i, j] == pytest.approx(single[1], abs=1e-15)
    columns = np.ascontiguousarray(np.moveaxis(np.broadcast_to(points, (5, 4, 3)), -1, 0))
    turned = feet(np.moveaxis(columns, 0, -1), np.ascontiguousarray(start.T).T, np.ascontiguousarray(axis.T).T)
    assert turned[0] == pytest.approx(place, abs=1e-15)
    assert turned[1] == pytest.approx(offset, abs=1e-15)


def test_the_arguments_are_left_as_they_are() -> None:
    points, start, axis = (np.ones((2, 3)) * k for k in (3.0, 1.0, 2.0))
    feet(points, start, axis)
    assert (points == 3.0).all()
    assert (start == 1.0).all()
    assert (axis == 2.0).all()
