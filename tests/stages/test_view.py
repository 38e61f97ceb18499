"""Where a cloud was seen from."""

from __future__ import annotations

import numpy as np
import pytest
from strips import strip, wave

import dlogen
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.view import FlatView, camera_at_origin, rays, thin_direction


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pixels_of_a_camera_at_the_origin_are_recognised_whatever_axis_it_looks_along(axes, sign) -> None:
    points = strip(wave()).points
    turned = sign * points[:, axes]
    assert camera_at_origin(turned)
    assert camera_at_origin(turned.astype(np.float32).astype(float))
    # Moved along the view, the rays no longer meet in the origin.
    moved = turned.copy()
    moved[:, axes.index(2)] += 0.02
    assert not camera_at_origin(moved)


@pytest.mark.parametrize("shape", ["bent", "straight", "helical"])
def test_other_clouds_are_not_pixels(shape: str) -> None:
    points = dlogen.synth(shape, points=5000, seed=1).points + np.array([0.0, 0.0, 3.0])
    assert not camera_at_origin(points)


def test_the_thin_direction_of_a_strip_is_the_view() -> None:
    cloud = strip(wave(), noise=0.0008)
    direction, ratio = thin_direction(cloud.points, cloud.axis[::10])
    assert abs(direction[2]) > 0.98
    assert ratio > 1.4
    line = centre_line("bent")
    whole = sample_tube(line, 0.02, 5000, 1)
    assert thin_direction(whole.points, line.points(300))[1] < 1.4


def test_rays_come_from_the_viewpoint_or_along_the_direction() -> None:
    points = np.array([[0.0, 0.0, 2.0], [3.0, 0.0, 4.0]]).T
    up = np.array([0.0, 1.0, 0.0])
    assert pytest.approx(np.array([[0, 0, 1], [0.6, 0, 0.8]])) == rays(np.zeros(3), up)(points).T
    assert pytest.approx(np.array([[0, 1, 0], [0, 1, 0]])) == rays(None, up)(points).T


@pytest.mark.parametrize("viewpoint", [None, np.array([0.3, -0.2, 0.1])])
def test_a_flat_view_goes_there_and_back(viewpoint) -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)) * 0.1 + np.array([0.0, 0.0, 1.0])
    view = FlatView.of(points, viewpoint, np.array([0.0, 0.6, 0.8]))
    assert view.back(view.flat(points)) == pytest.approx(points, abs=1e-12)


def test_points_on_one_ray_differ_in_their_depth_only() -> None:
    viewpoint = np.array([0.0, 0.0, -1.0])
    points = np.random.default_rng(1).normal(size=(20, 3)) * 0.1
    view = FlatView.of(points, viewpoint, None)
    behind = viewpoint + 1.2 * (points - viewpoint)
    one, other = view.flat(points), view.flat(behind)
    assert other[:, :2] == pytest.approx(one[:, :2], abs=1e-12)
    assert (other[:, 2] > one[:, 2]).all()
