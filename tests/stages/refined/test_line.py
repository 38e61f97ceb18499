"""The line of the profile refined: rows that belong together, what it chose, and what it stops at."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import dlogen.stages.refined.line as line_module
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, FitError
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.clock import Clock
from dlogen.stages.quality.checks import check_followed
from dlogen.stages.refined.line import refined_line
from dlogen.stages.refined.refine import refine
from dlogen.types import Cloud


@pytest.fixture(scope="module")
def made(tube):
    clock = Clock()
    return refined_line(Cloud(tube.points), Config(), clock), clock


def test_it_is_the_axis_and_the_radius(made, tube) -> None:
    line, _ = made
    assert line.radius == pytest.approx(tube.radius, rel=0.01)
    assert tube.truth.nearest(line.skeleton(np.linspace(0.01, 0.99, 200)))[1].max() < 5e-6
    assert line.skeleton.length == pytest.approx(tube.truth.length, rel=2e-3)
    assert line.chosen == {"r": line.radius, "N": line.skeleton.basis.size}


def test_rows_belong_to_their_points(made, tube) -> None:
    line, _ = made
    expected = tube.truth.nearest(tube.points)[1]
    assert line.distance == pytest.approx(expected, abs=3e-4)
    assert line.on_tube.shape == (5000,)
    ordering, on, off = line.intermediates
    assert [item.name for item in line.intermediates] == ["ordering", "tube", "off_tube"]
    # Along the line, each point with its own coordinate and residual.
    s = on.columns["s"]
    assert (np.diff(s) >= 0.0).all()
    apart = np.linalg.norm(on.points - line.skeleton(s), axis=1)
    assert apart == pytest.approx(line.radius + on.columns["residual"], abs=1e-5)
    assert len(on.points) + len(off.points) == 5000
    assert tube.truth.nearest(ordering.points)[1].max() < tube.radius


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


def test_every_stage_is_timed(made) -> None:
    assert list(made[1].seconds) == ["scale", "ordering", "refine"]


def test_a_given_radius_is_kept(tube) -> None:
    line = refined_line(Cloud(tube.points), Config().resolved({"r": 0.0148}), Clock())
    assert line.radius == 0.0148
    assert line.chosen["r"] == 0.0148


def test_what_cannot_be(tube) -> None:
    with pytest.raises(ConfigError, match="more than the whole cloud") as caught:
        refined_line(Cloud(tube.points), Config().resolved({"r": 100.0}), Clock())
    assert caught.value.stage == "scale"
    plane = np.random.default_rng(0).random((3000, 3)) * [1.0, 1.0, 1e-3]
    try:
        findings = refined_line(Cloud(plane), Config(), Clock()).findings
    except FitError as error:
        assert error.stage in ("ordering", "refine", "scale")
    else:
        assert "not-a-line" in {item.code for item in findings}
