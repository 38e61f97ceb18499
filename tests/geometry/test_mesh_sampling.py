"""Points spread evenly over triangles."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.geometry.mesh_sampling import fan, longest_edges, sample_triangles, triangle_areas

VERTICES = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 12.0], [3.0, 4.0, 0.0]])
TRIANGLES = np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2]])


def test_areas_and_edges() -> None:
    assert triangle_areas(VERTICES, TRIANGLES) == pytest.approx([6.0, 18.0, 0.0])
    assert longest_edges(VERTICES, TRIANGLES) == pytest.approx([5.0, np.sqrt(153.0), 5.0])


def test_polygons_become_triangles_with_the_same_corners() -> None:
    corners = np.array([0, 1, 4, 2, 7, 8, 9, 5, 6, 0, 3, 2, 1, 4])
    found = fan(corners, np.array([4, 0, 3, 2, 5]))
    expected = [[0, 1, 4], [0, 4, 2], [7, 8, 9], [0, 3, 2], [0, 2, 1], [0, 1, 4]]
    assert found.tolist() == expected
    assert fan(np.empty(0, dtype=int), np.empty(0, dtype=int)).shape == (0, 3)


def test_as_many_points_as_the_area_asks_for() -> None:
    points = sample_triangles(VERTICES, TRIANGLES, 4000)
    flat = points[:, 2] == 0.0
    assert flat.sum() == 1000
    # All of them lie in their triangles.
    x, y, z = points.T
    assert ((x >= 0) & (y >= 0) & (z >= 0)).all()
    assert (x[flat] / 3 + y[flat] / 4).max() <= 1.0 + 1e-12
    assert (y[~flat] == 0.0).all() and (x[~flat] / 3 + z[~flat] / 12).max() <= 1.0 + 1e-12


def test_they_are_spread_more_evenly_than_by_chance() -> None:
    square = np.array([[0, 1, 4], [0, 4, 2]])
    points = sample_triangles(VERTICES, square, 9600)
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=(12, 16), range=((0, 3), (0, 4)))[0]
    assert counts.mean() == 50.0
    # Points thrown at random have the root of 50, which is 7.1.
    assert counts.std() < 3.0


def test_points_of_a_long_thin_triangle_are_all_along_it() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 0.1, 0.0], [0.0, 0.1, 0.0]])
    points = sample_triangles(vertices, np.array([[0, 1, 2], [0, 2, 3]]), 1000)
    assert np.diff(np.sort(points[:, 0])).max() < 1.0


def test_nothing_can_be_spread_over_no_area() -> None:
    for triangles in (np.empty((0, 3), dtype=int), TRIANGLES[2:]):
        with pytest.raises(ValueError, match="no area"):
            sample_triangles(VERTICES, triangles, 10)
