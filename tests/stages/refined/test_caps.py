"""Closed ends: the axis goes straight to their faces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.curvature import curvature
from dlogen.pipeline import fit
from dlogen.stages.refined.caps import on_faces
from dlogen.types import Array


def u_shape() -> Array:
    """Vertices of a U in the plane; its ends go on to y = -0.06."""
    h = np.linspace(0.0, np.pi / 2.0, 200)
    parts = [
        np.stack([0.0 * h, np.linspace(-0.06, 0.08, 200)]),
        np.stack([0.05 - 0.05 * np.cos(h), 0.08 + 0.05 * np.sin(h)]),
        np.stack([np.linspace(0.05, 0.13, 200), 0.13 + 0.0 * h]),
        np.stack([0.13 + 0.05 * np.sin(h), 0.08 + 0.05 * np.cos(h)]),
        np.stack([0.18 + 0.0 * h, np.linspace(0.08, -0.06, 200)]),
    ]
    return np.pad(np.concatenate(parts, axis=1).T, ((0, 0), (0, 1)))


def closed_pipe(radius: float, tilt: float, bulge: float, noise: float, count: int, seed: int) -> Array:
    """Points of the pipe with faces around y = 0, tilted by so many degrees and bulging by so many radii."""
    rng = np.random.default_rng(seed)
    line = u_shape()
    step = np.linalg.norm(np.diff(line, axis=0), axis=1)
    s = rng.uniform(0.0, step.sum(), count)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    centre = np.stack([np.interp(s, arc, column) for column in line.T], axis=1)
    ahead = np.stack([np.interp(s + 1e-4, arc, c) - np.interp(s - 1e-4, arc, c) for c in line.T], axis=1)
    side = np.cross([0.0, 0.0, 1.0], ahead / np.linalg.norm(ahead, axis=1, keepdims=True))
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    points = centre + radius * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * [0.0, 0.0, 1.0])

    def face(x: Array, z: Array) -> Array:
        tilted = np.tan(np.radians(tilt)) * (0.6 * x + 0.8 * z)
        return -tilted - bulge * radius * np.maximum(0.0, 1.0 - (x**2 + z**2) / radius**2)

    middle = np.where(points[:, 0] < 0.09, 0.0, 0.18)
    points = points[points[:, 1] > face(points[:, 0] - middle, points[:, 2])]
    # As dense as the surface.
    away = radius * np.sqrt(rng.uniform(0.0, 1.0, int(0.5 * radius * count / step.sum())))
    turn = rng.uniform(0.0, 2.0 * np.pi, len(away))
    x, z = away * np.cos(turn), away * np.sin(turn)
    faces = [np.stack([x + at, face(x, z), z], axis=1) for at in (0.0, 0.18)]
    points = np.concatenate([points, *faces])
    return points + noise * rng.normal(size=points.shape)


@pytest.mark.parametrize(("tilt", "bulge"), [(0.0, 0.0), (0.0, 0.6), (40.0, 0.0), (40.0, 0.6), (20.0, 1.0), (0.0, 1.0)])
@pytest.mark.parametrize(("radius", "noise"), [(0.02, 0.0005), (0.02, 0.0015), (0.014, 0.001)])
@pytest.mark.parametrize("count", [8000, 60_000])
def test_the_axis_goes_straight_to_the_face(tilt: float, bulge: float, radius: float, noise: float, count: int) -> None:
    result = fit(closed_pipe(radius, tilt, bulge, noise, count, seed=int(tilt + 10.0 * bulge)))
    line = result.skeleton
    assert result.quality.verdict == "good"
    assert result.chain.radius == pytest.approx(radius, rel=0.02)
    # From face to face along the axis.
    assert line.length == pytest.approx(0.24 + 0.05 * np.pi + 2.0 * bulge * radius, abs=0.3 * radius)
    s = np.linspace(0.0, 1.0, 400)
    dense = np.concatenate([np.linspace(a, b, 20) for a, b in zip(u_shape(), u_shape()[1:], strict=False)])
    assert cKDTree(dense).query(line(s))[0].max() < 0.25 * radius
    assert curvature(line, np.array([0.0, 1.0])).max() * radius < 0.1


@pytest.mark.parametrize("side", [None, (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("noise", [0.0, 0.08])
def test_open_ends_are_left_as_they_are(side: tuple[float, float, float] | None, noise: float) -> None:
    from dlogen.stages.refined.refine import refine

    line = random_centre_line(5, clearance=0.05)
    cloud = sample_tube(line, 0.012, 6000, 1, noise=noise * 0.012, side=side)
    assert refine(cloud.points, line.points(80), 0.012).closed == (False, False)


def test_points_of_faces_are_inside_and_near_closed_ends() -> None:
    s = np.array([0.01, 0.01, 0.01, 0.5, 0.99])
    residual = np.array([-0.5, 0.5, -0.5, -0.5, -0.5])
    on_tube = np.array([False, False, True, False, False])
    assert on_faces(s, residual, on_tube, (True, False), 0.01).tolist() == [True, False, False, False, False]
    assert on_faces(s, residual, on_tube, (False, True), 0.01).tolist() == [False, False, False, False, True]
    assert not on_faces(s, residual, on_tube, (False, False), 0.01).any()
