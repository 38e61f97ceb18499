"""Groups of points that a line leaves out."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.quality.left_over import check_left_over
from dlogen.stages.refined.ordering import order
from dlogen.stages.refined.refine import refine
from dlogen.types import Array, Skeleton

RADIUS = 0.01


def tube(first: tuple[float, ...], last: tuple[float, ...], count: int) -> Array:
    return sample_tube(from_points(np.linspace(first, last, 20)), RADIUS, count, 1).points


@pytest.fixture(scope="module")
def rod() -> tuple[Array, Skeleton]:
    points = tube((0.0, 0.0, 0.0), (0.8, 0.0, 0.0), 4000)
    return points, refine(points, order(points).backbone, RADIUS).skeleton


def test_nothing_is_left_over_of_what_the_line_follows(rod) -> None:
    assert check_left_over(rod[0], rod[1], RADIUS) == []


def test_a_tip_beyond_a_gap_is_named_with_its_place(rod) -> None:
    tip = tube((0.95, 0.0, 0.0), (1.05, 0.0, 0.0), 500)
    (found,) = check_left_over(np.concatenate([rod[0], tip]), rod[1], RADIUS)
    assert (found.code, found.severity) == ("left-over", "doubtful")
    assert found.position == pytest.approx((1.0, 0.0, 0.0), abs=0.01)
    assert "11 % of the points" in found.message


def test_strays_and_specks_are_none(rod) -> None:
    rng = np.random.default_rng(0)
    strays = rng.uniform([-0.2, -0.3, -0.3], [1.0, 0.3, 0.3], (300, 3))
    speck = rng.normal(0.0, 0.003, (40, 3)) + np.array([0.4, 0.1, 0.0])
    assert check_left_over(np.concatenate([rod[0], strays, speck]), rod[1], RADIUS) == []


def test_noise_around_the_object_is_none(rod) -> None:
    noisy = rod[0] + np.random.default_rng(1).normal(0.0, 0.012, rod[0].shape)
    assert check_left_over(noisy, rod[1], RADIUS, scatter=0.012) == []


@pytest.mark.parametrize("count", [500, 140])
def test_a_tip_is_named_also_where_it_is_seen_along_its_length_and_has_few_points(rod, count: int) -> None:
    tip = tube((0.95, 0.0, 0.0), (1.05, 0.0, 0.0), count)
    (found,) = check_left_over(np.concatenate([rod[0], tip]), rod[1], RADIUS)
    assert found.position == pytest.approx((1.0, 0.0, 0.0), abs=0.01)
    # Points as far apart as strays are no strand.
    sheet = np.random.default_rng(2).uniform([0.2, 0.05, -0.001], [0.8, 0.25, 0.001], (300, 3))
    assert check_left_over(np.concatenate([rod[0], sheet]), rod[1], RADIUS) == []


def test_a_short_piece_of_a_strand_is_named_if_it_is_as_dense_as_the_rest(rod) -> None:
    tip = tube((0.95, 0.0, 0.0), (0.975, 0.0, 0.0), 500)
    tip = tip[tip[:, 2] > 0.007]
    (found,) = check_left_over(np.concatenate([rod[0], tip]), rod[1], RADIUS)
    assert found.position == pytest.approx((0.9625, 0.0, 0.009), abs=0.003)
    assert check_left_over(np.concatenate([rod[0], tip[::5]]), rod[1], RADIUS) == []


def test_lone_points_all_around_are_none(rod) -> None:
    """The largest group is one point."""
    strays = np.stack(np.meshgrid([-0.3, 0.4, 1.1], [-0.3, 0.3], [-0.3, 0.3]), axis=-1).reshape(-1, 3)
    assert check_left_over(np.concatenate([rod[0], strays]), rod[1], RADIUS) == []
