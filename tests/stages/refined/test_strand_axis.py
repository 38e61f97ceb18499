"""From a strip to the object that it is seen of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from strips import Strip, strip, wave

from dlogen.stages.refined.strand import fit_strand
from dlogen.stages.refined.strand_axis import StrandFit, object_of
from dlogen.stages.view import rays


def seen(cloud: Strip, radius: float | None = None, **options) -> StrandFit:
    columns = np.ascontiguousarray(cloud.points.T)
    view = rays(np.zeros(3), np.eye(3)[2])
    strand = fit_strand(columns, view, cloud.axis[::60], cloud.radius)
    return object_of(strand, columns, view, radius, np.zeros(3), **{"side": True, **options})


@pytest.mark.parametrize("radius", [0.002, 0.004, 0.008])
def test_the_width_tells_the_radius_and_the_axis_is_behind_the_surface(radius: float) -> None:
    cloud = strip(wave(), radius, noise=0.001, seed=4)
    fit = seen(cloud)
    assert fit.radius == pytest.approx(radius, rel=0.15)
    assert abs(fit.radius - radius) < 3.0 * fit.radius_std
    assert fit.skeleton.length == pytest.approx(cloud.length, rel=0.01)
    line = fit.skeleton(np.linspace(0.05, 0.95, 300))
    off = line - cloud.axis[cKDTree(cloud.axis).query(line)[1]]
    assert abs(off[:, 2].mean()) < 0.2 * radius + 0.0003
    assert np.linalg.norm(off, axis=1).mean() < 0.3 * radius + 0.0005


def test_where_the_side_is_not_known_the_line_stays_in_the_surface() -> None:
    cloud = strip(wave(), 0.006, noise=0.0005)
    known, unknown = (seen(cloud, side=side).skeleton(0.5)[2] for side in (True, False))
    assert known - unknown == pytest.approx(np.pi / 4.0 * 0.006, rel=0.1)
    assert (seen(cloud, side=False).uncertainty.position >= 0.006 * 0.9).all()


def test_a_given_radius_is_kept_and_says_how_far_behind_the_axis_is() -> None:
    cloud = strip(wave(), 0.004, noise=0.0005)
    thin, thick = seen(cloud, 0.003), seen(cloud, 0.005)
    assert (thin.radius, thin.radius_std) == (0.003, 0.0)
    assert thick.skeleton(0.5)[2] - thin.skeleton(0.5)[2] == pytest.approx(np.pi / 4.0 * 0.002, rel=0.1)


def test_a_strip_of_few_pixels_is_a_thread_of_unknown_radius() -> None:
    wide = seen(strip(wave(), 0.006, noise=0.0005, pixel=0.0006))
    narrow = seen(strip(wave(), 0.001, noise=0.0005, pixel=0.0008))
    assert (wide.regime, wide.radius_known) == ("strand", True)
    assert (narrow.regime, narrow.radius_known) == ("thread", False)


def test_residuals_are_zero_on_the_surface_and_positive_before_it() -> None:
    cloud = strip(wave(), 0.006, noise=0.0)
    fit = seen(cloud)
    assert np.abs(np.median(fit.residuals[fit.inliers])) < 0.0005
    nearer = Strip(cloud.points * np.where(np.arange(len(cloud.points)) == 7, 0.996, 1.0)[:, None], cloud.axis, 0.006)
    moved = seen(nearer)
    assert moved.residuals[7] - fit.residuals[7] == pytest.approx(0.004 * np.linalg.norm(cloud.points[7]), rel=0.2)


def test_the_position_is_uncertain_as_the_noise_is_large() -> None:
    quiet, loud = (
        seen(strip(wave(), 0.004, noise=noise, seed=2), 0.004).uncertainty.position for noise in (0.0002, 0.003)
    )
    assert np.median(loud) > 1.3 * np.median(quiet)
    # A known radius leaves its share of a seventh of the radius and what the noise adds.
    assert (quiet > 0.15 * 0.004).all()
