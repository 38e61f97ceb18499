"""The line through a strip."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from strips import Strip, strip, wave

from dlogen.stages.refined.strand import Strand, fit_strand
from dlogen.stages.view import rays


def fitted(cloud: Strip, half_width: float) -> Strand:
    columns = np.ascontiguousarray(cloud.points.T)
    return fit_strand(columns, rays(np.zeros(3), np.eye(3)[2]), cloud.axis[::60], half_width)


def off_axis(strand: Strand, cloud: Strip) -> tuple[np.ndarray, np.ndarray]:
    """(K,) along the view and across it, from the true axis to places of the line away from its ends, metres."""
    line = strand.curve(np.linspace(0.05, 0.95, 400) * strand.curve.intervals)
    # The place of the axis on the same ray, or beside it: in the image.
    image = cKDTree(cloud.axis[:, :2] / cloud.axis[:, 2:])
    beside, nearest = image.query(line[:, :2] / line[:, 2:])
    return line[:, 2] - cloud.axis[nearest, 2], beside * line[:, 2]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("radius", [0.002, 0.004])
def test_the_middle_of_the_strip_is_exact_across_the_view_and_smooth_along_it(radius: float, seed: int) -> None:
    cloud = strip(wave(), radius, noise=0.0012, shared=0.012, seed=seed)
    depth, across = off_axis(fitted(cloud, radius), cloud)
    # Across the view only the pixels blur; along it the line is in the surface, pi / 4 of the radius before the axis.
    assert across.mean() < 0.0002
    assert depth.mean() == pytest.approx(-np.pi / 4.0 * radius, abs=0.0005)
    assert depth.std() < 0.0009  # the noise that neighbours share is 1.2 mm


def test_what_neighbours_share_is_told_from_what_they_do_not() -> None:
    shared = fitted(strip(wave(), 0.003, noise=0.0012, shared=0.012), 0.003)
    alone = fitted(strip(wave(), 0.003, noise=0.0, shared=0.012), 0.003)
    assert shared.inflation[0] > 20.0
    assert shared.sigma[0] == pytest.approx(0.0012, rel=0.4)
    assert shared.inflation[0] * shared.sigma[0] ** 2 > 5.0 * alone.inflation[0] * alone.sigma[0] ** 2


def test_ends_are_followed_although_the_backbone_falls_short() -> None:
    cloud = strip(wave(), 0.003)
    columns = np.ascontiguousarray(cloud.points.T)
    short = cloud.axis[300:-300:60]
    strand = fit_strand(columns, rays(np.zeros(3), np.eye(3)[2]), short, 0.003)
    assert strand.curve.length == pytest.approx(cloud.length, abs=0.01)


def test_more_points_are_no_worse() -> None:
    whole = strip(wave(), 0.003, pixel=0.0003, seed=5)
    errors = []
    for count in (500, 3000, len(whole.points)):
        some = Strip(whole.points[:count], whole.axis, whole.radius)
        depth, across = off_axis(fitted(some, 0.003), some)
        errors.append(float(np.hypot(depth + np.pi / 4.0 * 0.003, across).mean()))
    assert errors[2] < errors[0] + 0.0001 and errors[1] < errors[0] + 0.0001
