"""The outward side of normals: exact tubes and arcs, whose normals are known."""

from __future__ import annotations

import numpy as np
import pytest
from partly_seen import arc
from scipy.spatial import cKDTree

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.refined.orientation import alike

Array = np.ndarray


def signs(points: Array, normals: Array, outward: Array, reach: float, seed: int = 0) -> Array:
    """The signs that `alike` gives normals of random signs, relative to those they came with."""
    chance = np.random.default_rng(seed).choice([-1.0, 1.0], len(points))
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray").T
    return alike(points, normals * chance[:, None], outward, pairs) * chance


@pytest.mark.parametrize("half", [20.0, 45.0, 90.0, 180.0])
def test_neighbours_agree_though_hardly_any_is_sure(half: float) -> None:
    rng = np.random.default_rng(1)
    points = arc(0.01, half, 12_000, seed=2)
    line = arc(1e-9, 1.0, 20_000, seed=3)
    normals = points - line[cKDTree(line).query(points)[1]]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # What the centroids say is true in 55 of 100.
    outward = normals * np.where(rng.random(len(points)) < 0.55, 1.0, -1.0)[:, None]
    assert (signs(points, normals, outward, 0.005) == 1.0).all()
    assert (signs(points, normals, -outward, 0.005) == -1.0).all()


def test_the_two_walls_of_a_tube_do_not_turn_each_other_round() -> None:
    cloud = sample_tube(random_centre_line(3, clearance=0.06), 0.01, 6000, 1)
    # Neighbours within 1.2 radii: some of those that are next to each other lie on opposite sides.
    found = signs(cloud.points, cloud.normals, cloud.normals, 0.012)
    assert (found == 1.0).all()


def test_pieces_that_are_apart_each_have_their_side() -> None:
    points = np.concatenate([arc(0.01, 40.0, 2000), arc(0.01, 40.0, 2000, seed=1) + np.array([0.0, 0.0, 1.0])])
    normals = np.tile([0.0, 0.0, 1.0], (4000, 1))
    outward = np.concatenate([normals[:2000], -normals[2000:]])
    found = signs(points, normals, outward, 0.005)
    assert (found[:2000] == 1.0).all()
    assert (found[2000:] == -1.0).all()


def test_points_without_neighbours_follow_their_centroid() -> None:
    points, normals = np.eye(3), np.eye(3)
    found = alike(points, normals, normals * [1.0, -1.0, 1.0], np.zeros((2, 0), dtype=int))
    assert found.tolist() == [1.0, -1.0, 1.0]
