"""Whether a tube or a strip says more."""

from __future__ import annotations

import numpy as np
import pytest
from strips import strip, wave

from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.refined.ordering import order
from dlogen.stages.refined.refine import Refined, refine
from dlogen.stages.refined.regime import hides_surface, is_doubted, shows_surface, wiggles
from dlogen.stages.refined.strand_axis import StrandFit
from dlogen.stages.refined.strand_line import strand_fit


def both(points: np.ndarray, viewpoint: np.ndarray) -> tuple[Refined, StrandFit]:
    ordering = order(points, viewpoint=viewpoint)
    seen = strand_fit(points, viewpoint, ordering, None)
    assert seen is not None
    return refine(points, ordering.backbone, ordering.radius), seen[0]


def test_a_clean_tube_from_one_side_is_a_surface() -> None:
    line = centre_line("bent")
    points = sample_tube(line, 0.02, 5000, 1, noise=0.0005, side=[0.0, 0.0, -1.0]).points
    tube, strip_ = both(points, np.array([0.0, 0.0, 50.0]))
    assert not is_doubted(tube)
    assert shows_surface(tube, strip_)
    assert not hides_surface(strip_)


def test_noise_of_the_size_of_the_radius_hides_it() -> None:
    points = strip(wave(), 0.003, noise=0.0025, seed=1).points
    tube, strip_ = both(points, np.zeros(3))
    assert is_doubted(tube)
    assert not shows_surface(tube, strip_)
    assert hides_surface(strip_)


def test_wiggles_are_what_is_left_of_the_distance_without_its_mean() -> None:
    points = sample_tube(centre_line("straight"), 0.02, 3000, 1).points
    fit = refine(points, order(points).backbone, 0.02)
    line = fit.skeleton
    moved = type(line)(line.basis, line.weights, line.offset + np.array([0.0, 0.01, 0.0]), line.length)
    assert wiggles(moved, line) == pytest.approx(0.0, abs=1e-4)
    bent = type(line)(line.basis, line.weights * np.array([1.0, 1.1, 1.0]), line.offset, line.length)
    assert wiggles(bent, line) >= 0.0


def test_noise_that_neighbours_do_not_share_does_not_make_a_tube_doubtful() -> None:
    line = centre_line("bent")
    noise = np.random.default_rng(3)
    points = sample_tube(line, 0.02, 5000, 1, side=[0.0, 0.0, -1.0]).points
    alone = points + noise.normal(0.0, 0.0014, points.shape)
    fit = refine(alone, order(alone).backbone, 0.02)
    assert fit.noise > 0.06 * fit.radius and fit.shared < 1.5 and not is_doubted(fit)
    loud = points + noise.normal(0.0, 0.003, points.shape)
    assert is_doubted(refine(loud, order(loud).backbone, 0.02))
    # The same for all points within a few centimetres.
    cell = np.unique(np.round(points / 0.03).astype(int), axis=0, return_inverse=True)[1].ravel()
    together = points + noise.normal(0.0, 0.0014, (cell.max() + 1, 1))[cell] * np.array([0.0, 0.0, 1.0])
    fit = refine(together, order(together).backbone, 0.02)
    assert fit.shared > 1.5 and is_doubted(fit) == (
        fit.noise > 0.04 * fit.radius or fit.max_curvature * fit.radius > 0.6
    )
