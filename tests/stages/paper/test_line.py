"""The stages of the profile paper one after another: what they choose, leave behind, and say when they fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.errors import ConfigError, FitError
from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.stages.clock import Clock
from dlogen.stages.paper.line import paper_line
from dlogen.stages.prepare import prepare
from dlogen.types import Cloud, FittedLine

PAPER = Config(profile="paper")


@pytest.fixture(scope="module")
def cloud(tube: SyntheticCloud) -> Cloud:
    return prepare(Cloud(tube.points), "m").cloud


@pytest.fixture(scope="module")
def timed(cloud: Cloud) -> tuple[FittedLine, Clock]:
    clock = Clock()
    return paper_line(cloud, PAPER, clock), clock


def test_the_line_is_the_axis(timed: tuple[FittedLine, Clock], cloud: Cloud, tube: SyntheticCloud) -> None:
    line, _ = timed
    moved = tube.points[0] - cloud.points[0]
    s = np.linspace(0.1, 0.9, 50)
    assert tube.truth.nearest(line.skeleton(s) + moved)[1].max() < 0.005
    assert line.radius == pytest.approx(0.015, rel=0.05)


def test_what_was_chosen_stands_under_its_dotted_key(timed: tuple[FittedLine, Clock]) -> None:
    chosen = timed[0].chosen
    assert set(chosen) == {"r", "r_n", "N", "beta", "skeleton.tau", "sorting.start", "normals.neighbours"}
    config = PAPER.resolved(chosen)
    assert config.r == timed[0].radius
    assert (config.N, config.skeleton.tau) == (21, 5.25) == (timed[0].skeleton.basis.size, timed[0].skeleton.basis.tau)
    assert config.r_n >= 2 * config.r
    assert 0 <= config.sorting.start < 5000


def test_what_was_given_stays(cloud: Cloud) -> None:
    given = {"r": 0.016, "r_n": 0.09, "N": 25, "beta": 0.002}
    config = PAPER.replace({**given, "skeleton.tau": 6.0, "sorting.start": 17, "normals.neighbours": 24})
    line = paper_line(cloud, config, Clock())
    assert line.chosen == {**given, "skeleton.tau": 6.0, "sorting.start": 17, "normals.neighbours": 24}
    assert line.radius == 0.016
    # The walk began there, at an end of what it reached or in between.
    assert line.skeleton.weights.shape == (25, 3)


def test_a_radius_of_normals_takes_no_number_of_neighbours(cloud: Cloud) -> None:
    line = paper_line(cloud, PAPER.replace({"normals.radius": 0.012}), Clock())
    assert "normals.neighbours" not in line.chosen


def test_stages_and_what_they_leave_are_in_order(timed: tuple[FittedLine, Clock], cloud: Cloud) -> None:
    line, clock = timed
    assert list(clock.seconds) == ["scale", "normals", "projection", "sorting", "skeleton", "residual"]
    normals, projected, reached, unreached = line.intermediates
    assert [item.name for item in line.intermediates] == ["normals", "projected", "sorted", "unreached"]
    np.testing.assert_array_equal(normals.points, cloud.points)
    columns = np.stack([normals.columns[key] for key in ("nx", "ny", "nz")], axis=1)
    assert np.linalg.norm(columns, axis=1) == pytest.approx(np.ones(5000))
    # Eq. 4: against the outward normal by the radius.
    np.testing.assert_allclose(projected.points, cloud.points - line.radius * columns, atol=1e-12)
    assert len(reached.points) + len(unreached.points) == 5000
    assert {*map(tuple, reached.points), *map(tuple, unreached.points)} == {*map(tuple, projected.points)}
    s = reached.columns["s"]
    assert reached.colour == "s" and (np.diff(s) >= 0).all() and (s[0], s[-1]) == (0.0, 1.0)


def test_distances_are_those_to_a_dense_line(timed: tuple[FittedLine, Clock], cloud: Cloud) -> None:
    line, _ = timed
    dense = line.skeleton(np.linspace(0.0, 1.0, 20_000))
    some = np.arange(0, 5000, 50)
    expected = np.linalg.norm(cloud.points[some, None] - dense, axis=2).min(axis=1)
    # The chords between 1,000 samples, 1.4 mm long, are micrometres off where the line bends.
    np.testing.assert_allclose(line.distance[some], expected, atol=4e-6)
    assert line.distance.shape == line.on_tube.shape == (5000,)
    error = np.abs(line.distance - line.radius)
    assert (error[~line.on_tube] >= 0.5 * line.radius).all()
    assert line.on_tube.mean() > 0.95


def test_points_on_the_axis_are_anywhere_in_the_tube(tube: SyntheticCloud) -> None:
    axis = tube.truth(np.linspace(0, 1, 800)) + np.random.default_rng(1).normal(scale=0.0005, size=(800, 3))
    cloud = prepare(Cloud(axis), "m").cloud
    line = paper_line(cloud, PAPER.replace({"projection.enabled": False, "r": 0.015, "r_n": 0.12}), Clock())
    np.testing.assert_array_equal(line.intermediates[1].points, cloud.points)
    assert line.distance.min() == 0.015
    assert line.on_tube.all()


@pytest.mark.parametrize(
    ("changes", "error", "stage", "message"),
    [
        ({"r": 5.0}, ConfigError, "scale", "the diameter 2 r = 10 m is more than the whole cloud"),
        ({"r_n": 0.02}, ConfigError, "scale", "r_n = 0.02 m is below the diameter 2 r = "),
        ({"sorting.start": 5000}, ConfigError, "sorting", "sorting.start = 5000, but the cloud has 5000 points"),
    ],
)
def test_errors_name_their_stage(
    changes: dict[str, float], error: type[Exception], stage: str, message: str, cloud: Cloud
) -> None:
    clock = Clock()
    with pytest.raises(error) as caught:
        paper_line(cloud, PAPER.replace(changes), clock)
    assert caught.value.stage == stage
    assert caught.value.message.startswith(message)
    assert caught.value.hint
    # Those before it have run, none after it.
    assert list(clock.seconds)[-1] == stage


def test_what_is_no_line_is_refused() -> None:
    """A ball: its points all lead to its centre, and what is left is shorter than thick."""
    directions = np.random.default_rng(2).normal(size=(800, 3))
    ball = Cloud(0.1 * directions / np.linalg.norm(directions, axis=1, keepdims=True))
    with pytest.raises(FitError) as caught:
        paper_line(ball, PAPER.replace({"r": 0.0995}), Clock())
    assert caught.value.stage == "skeleton"
    assert "no line" in caught.value.message and "at a radius of " in caught.value.message


def test_a_wrong_radius_is_said(cloud: Cloud) -> None:
    line = paper_line(cloud, PAPER.replace({"r": 0.021, "r_n": 0.12}), Clock())
    assert "radius-mismatch" in {finding.code for finding in line.findings}


def test_points_that_the_walk_did_not_reach_are_said(cloud: Cloud) -> None:
    """Cut in two by more than the search radius: one side stays behind."""
    x = cloud.points[:, int(np.argmax(np.ptp(cloud.points, axis=0)))]
    apart = replace(cloud, points=cloud.points + np.where(x > np.median(x), 1.0, 0.0)[:, None])
    line = paper_line(apart, PAPER, Clock())
    unreached = len(line.intermediates[3].points)
    assert unreached > 500
    found = [finding for finding in line.findings if finding.code == "points-not-reached"]
    assert [finding.message.split(" %")[0] for finding in found] == [f"{unreached / 50:.0f}"]
