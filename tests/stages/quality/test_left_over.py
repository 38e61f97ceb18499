"""Groups of points that a line leaves out: tips and strays."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.stages.quality.left_over import check_left_over
from dlogen.types import Skeleton

Array = np.ndarray
RADIUS = 0.01


def tube(start: float, end: float, count: int, seed: int, side: tuple[float, float, float] | None = None) -> Array:
    """Points on a straight tube along x, from one place to the other, metres."""
    points = sample_tube(from_points([[start, 0, 0], [end, 0, 0]]), RADIUS, count, seed, side=side).points
    return np.asarray(points)


@pytest.fixture(scope="module")
def line() -> Skeleton:
    """The skeleton line from 0 to 1 m along x."""
    return fit(tube(0.0, 1.0, 4000, 1)).skeleton


def found(line: Skeleton, *parts: Array) -> list[str]:
    return [item.code for item in check_left_over(np.concatenate([tube(0.0, 1.0, 4000, 1), *parts]), line, RADIUS)]


def test_a_tip_far_beyond_an_end_is_left_over(line: Skeleton) -> None:
    assert found(line) == []
    # As dense as the rest, and at a fifth of that as a strand is that runs along the view.
    assert found(line, tube(1.2, 1.3, 400, 2)) == ["left-over"]
    assert found(line, tube(1.2, 1.3, 120, 2)) == ["left-over"]
    (finding,) = check_left_over(np.concatenate([tube(0.0, 1.0, 4000, 1), tube(1.2, 1.3, 120, 2)]), line, RADIUS)
    assert finding.severity == "doubtful" and finding.position is not None
    assert finding.position[0] == pytest.approx(1.25, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_a_tip_of_three_radii_is_one_if_it_is_as_dense_as_the_rest(line: Skeleton, seed: int) -> None:
    assert found(line, tube(1.2, 1.23, 120, seed)) == ["left-over"]
    # A few points together are none.
    assert found(line, tube(1.2, 1.23, 20, seed)) == []


@pytest.mark.parametrize("seed", range(5))
def test_strays_are_none(line: Skeleton, seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert found(line, rng.uniform([-0.1, -0.2, -0.2], [1.1, 0.2, 0.2], size=(800, 3))) == []
    # Nor are those that lie thinly in a sheet beside the object.
    assert found(line, rng.uniform([0.2, 0.05, -0.001], [0.8, 0.25, 0.001], size=(300, 3))) == []
