"""The line of the profile paper: the stages one after another, what each chose, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.errors import ConfigError
from dlogen.stages.clock import Clock
from dlogen.stages.paper.line import paper_line
from dlogen.types import Cloud


def line_of(points: np.ndarray, **chosen: Any) -> Any:
    return paper_line(Cloud(points), Config().resolved({"profile": "paper"} | chosen), Clock())


@pytest.fixture(scope="module")
def made(tube):
    return line_of(tube.points)


def test_it_is_near_the_axis(made, tube) -> None:
    s = np.linspace(0.1, 0.9, 200)
    assert tube.truth.nearest(made.skeleton(s))[1].max() < 0.5 * tube.radius
    assert made.radius == pytest.approx(tube.radius, rel=0.03)


def test_rows_belong_to_their_points(made, tube) -> None:
    normals, projected, walked, unreached = made.intermediates
    assert [item.name for item in made.intermediates] == ["normals", "projected", "sorted", "unreached"]
    # Eq. 4 with the normals of the same rows, outwards.
    columns = np.stack([normals.columns[f"n{axis}"] for axis in "xyz"], axis=1)
    assert projected.points == pytest.approx(normals.points - made.radius * columns)
    assert np.median(np.einsum("mi,mi->m", columns, tube.normals)) > 0.95
    assert (np.diff(walked.columns["s"]) >= 0.0).all()
    assert len(walked.points) + len(unreached.points) == 5000
    near = np.linalg.norm(tube.points[:, None] - made.skeleton(np.linspace(0, 1, 400))[None], axis=2).min(axis=1)
    assert made.distance == pytest.approx(near, abs=0.1 * made.radius)


def test_what_was_chosen_is_told_and_what_was_given_is_kept(made, tube) -> None:
    assert {"r", "r_n", "N", "beta", "skeleton.tau", "sorting.start"} <= set(made.chosen)
    assert made.chosen["r_n"] >= 2.0 * made.radius
    given = line_of(tube.points, **{"r": 0.015, "r_n": 0.1, "N": 25, "beta": 0.02, "sorting.start": 7})
    assert [given.chosen[key] for key in ("r", "r_n", "N", "beta", "sorting.start")] == [0.015, 0.1, 25, 0.02, 7]
    assert given.skeleton.basis.size == 25


def test_points_on_the_axis_need_no_projection(tube) -> None:
    axis = tube.truth(np.random.default_rng(0).random(2000))
    made = line_of(axis, **{"r": 0.015, "projection.enabled": False})
    assert made.distance.min() == 0.015
    assert np.array_equal(made.intermediates[1].points, axis)


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"r": 0.015, "r_n": 0.029}, "below the diameter"),
        ({"sorting.start": 5000}, "the cloud has 5000 points"),
        ({"r": 50.0}, "more than the whole cloud"),
    ],
)
def test_settings_that_do_not_fit_the_cloud(tube, chosen: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        line_of(tube.points, **chosen)
