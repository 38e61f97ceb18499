"""What the refined line finds out about itself is worked out from the right numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import dlogen.stages.refined.line as line_module
import dlogen.stages.refined.refine as refine_module
from dlogen.config.schema import Config
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.clock import Clock
from dlogen.stages.quality.checks import check_followed
from dlogen.stages.refined.line import refined_line
from dlogen.stages.refined.refine import refine
from dlogen.types import Cloud


def test_a_stretch_that_the_line_misses_is_told_by_distances_from_the_line(monkeypatch) -> None:
    """A fit that stops half way, on a tube whose points are all one radius from their axis."""
    cloud = sample_tube(random_centre_line(3, clearance=0.08), 0.015, 5000, 3)
    given: list[np.ndarray] = []

    def short(points, backbone, radius, **options):
        kept = backbone[: len(backbone) // 2]
        # Another stage goes on as if nothing was missing.
        return refine(points, kept, radius, **options)

    def check(points, backbone, distance, radius):
        given.append(distance)
        return check_followed(points, backbone, distance, radius)

    monkeypatch.setattr(line_module, "refine", short)
    # Ends are followed by a radius in each round: with as many as usual, to where the points end.
    monkeypatch.setattr(refine_module, "_ROUNDS", 6)
    monkeypatch.setattr(line_module, "check_followed", check)
    line = refined_line(Cloud(cloud.points), Config(), Clock())
    assert "points-not-reached" in {item.code for item in line.findings}
    (distance,) = given
    fitted = line.skeleton(np.linspace(0.0, 1.0, 4001))
    true = cKDTree(fitted).query(cloud.points)[0]
    # Beyond its end the fit goes on straight for a while.
    near = true < 2.0 * 0.015
    assert near.mean() > 0.4
    assert distance[near] == pytest.approx(true[near], abs=2e-3)
    assert np.median(distance[near]) == pytest.approx(0.015, rel=0.02)
