"""Ray casting against the tube itself; `tube_depth` is tested further with the camera that came first."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.rendering import exact_depth, tube_depth
from dlogen.evaluation.shapes import hose_centre_line, loop_centre_line
from dlogen.types import Array

RADIUS = 0.01
FOCAL = (700.0, 500.0)


def before(line: CentreLine) -> CentreLine:
    """Seen from 0.8 m above."""
    return line.moved(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.8]))


def rays() -> Array:
    x, y = np.meshgrid((np.arange(640) - 319.5) / FOCAL[0], (np.arange(400) - 199.5) / FOCAL[1])
    return np.stack([x, y, np.ones_like(x)], axis=-1)


HOSE = before(hose_centre_line(0.7, 0.06))
LOOP = before(loop_centre_line(0.7, 2.2 * RADIUS))


@pytest.mark.parametrize("line", [HOSE, LOOP], ids=["hose", "loop"])
def test_points_are_on_the_tube_to_a_micrometre(line: CentreLine) -> None:
    depth, cosine = exact_depth(line, RADIUS, rays(), FOCAL)
    hit = np.isfinite(depth) & (cosine > 0.15)
    points = (rays() * depth[..., None])[hit]
    s, distance = line.nearest(points)
    inner = (s > 0) & (s < 1)
    assert inner.sum() > 5000
    assert np.abs(distance[inner] - RADIUS).max() < 1e-6
    normals = (points - line(s)) / RADIUS
    towards = -points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("ij,ij->i", normals, towards)[inner], cosine[hit][inner], atol=1e-4)


@pytest.mark.parametrize("line", [HOSE, LOOP], ids=["hose", "loop"])
def test_the_nearest_surface_is_seen(line: CentreLine) -> None:
    # Spheres that are close together are the slow way to the same picture.
    exact, _ = exact_depth(line, RADIUS, rays(), FOCAL)
    spheres, _ = tube_depth(line, RADIUS, rays(), FOCAL)
    both = np.isfinite(exact) & np.isfinite(spheres)
    assert (np.isfinite(exact) != np.isfinite(spheres)).sum() < 0.02 * both.sum()
    error = np.abs(exact[both] - spheres[both])
    assert np.quantile(error, 0.99) < 0.01 * RADIUS
    assert error.max() < RADIUS


def test_an_end_that_faces_the_sensor_is_flat() -> None:
    lean = np.radians(15.0)
    line = before(from_points([(0, 0, 0), (0.1 * np.sin(lean), 0, 0.1 * np.cos(lean))]))
    depth, _ = exact_depth(line, RADIUS, rays(), FOCAL)
    points = (rays() * depth[..., None])[np.isfinite(depth)]
    height = (points - line([1.0])[0]) @ line.tangents([1.0])[0]
    assert height.max() < 1e-6
    assert (np.abs(height) < 1e-9).sum() > 50
