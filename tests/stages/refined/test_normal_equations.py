"""The normal equations against sums over points, written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.stages.refined.normal_equations import NormalEquations, band, normal_equations, vector
from dlogen.stages.refined.tube_curve import spline_values

Array = np.ndarray
SUMS = ("blocks", "right", "radius", "weight", "residual", "squares")


def some_points(seed: int, count: int, intervals: int) -> tuple[Array, ...]:
    """Intervals, places, unit directions, residuals, weights; the last interval but one has no point."""
    rng = np.random.default_rng(seed)
    k = rng.choice(np.delete(np.arange(intervals), -2), count)
    direction = rng.normal(size=(3, count))
    direction /= np.linalg.norm(direction, axis=0)
    return k, rng.random(count), direction, rng.normal(size=count), rng.uniform(0.1, 2.0, count)


def same(one: NormalEquations, other: NormalEquations) -> None:
    for name in SUMS:
        assert np.allclose(getattr(one, name), getattr(other, name), rtol=1e-10, atol=1e-10), name


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 60), intervals=st.integers(3, 12))
def test_they_are_the_sums_over_the_points(seed: int, count: int, intervals: int) -> None:
    k, t, direction, residual, weight = some_points(seed, count, intervals)
    sums = normal_equations(k, t, direction, residual, weight, intervals)
    blocks, right, radius = np.zeros((intervals, 12, 12)), np.zeros((intervals, 12)), np.zeros((intervals, 12))
    for m in range(count):
        # a_(j, c) = B_j(t) e_c
        a = np.outer(spline_values(t[m : m + 1])[:, 0], direction[:, m]).ravel()
        blocks[k[m]] += weight[m] * np.outer(a, a)
        right[k[m]] += weight[m] * residual[m] * a
        radius[k[m]] += weight[m] * a
    expected = NormalEquations(
        blocks,
        right,
        radius,
        weight.sum(),
        float(weight @ residual),
        float(weight @ residual**2),
        weight.sum(),
    )
    same(sums, expected)
    assert not sums.blocks[-2].any()


def test_the_order_of_the_points_does_not_matter() -> None:
    k, t, direction, residual, weight = some_points(1, 500, 20)
    order = np.random.default_rng(2).permutation(500)
    shuffled = normal_equations(k[order], t[order], direction[:, order], residual[order], weight[order], 20)
    same(shuffled, normal_equations(k, t, direction, residual, weight, 20))


def test_the_sum_of_two_is_that_of_all_points() -> None:
    k, t, direction, residual, weight = some_points(3, 300, 10)
    parts = [
        normal_equations(k[part], t[part], direction[:, part], residual[part], weight[part], 10)
        for part in (slice(None, 100), slice(100, None))
    ]
    same(parts[0] + parts[1], normal_equations(k, t, direction, residual, weight, 10))


def test_points_without_weight_are_none() -> None:
    k, t, direction, residual, weight = some_points(5, 200, 10)
    weight[::2] = 0.0
    same(
        normal_equations(k, t, direction, residual, weight, 10),
        normal_equations(k[1::2], t[1::2], direction[:, 1::2], residual[1::2], weight[1::2], 10),
    )


@pytest.mark.parametrize("intervals", [1, 2, 7])
def test_band_and_vector_are_the_overlapping_sums(intervals: int) -> None:
    rng = np.random.default_rng(intervals)
    size = 3 * (intervals + 3)
    blocks = rng.normal(size=(intervals, 12, 12))
    blocks = blocks + blocks.transpose(0, 2, 1)
    parts = rng.normal(size=(intervals, 12))
    matrix, column = np.zeros((size, size)), np.zeros(size)
    for k in range(intervals):
        at = slice(3 * k, 3 * k + 12)
        matrix[at, at] += blocks[k]
        column[at] += parts[k]
    # LAPACK's lower band storage: row d holds the d-th diagonal below the main one.
    expected = np.zeros((12, size))
    for d in range(12):
        expected[d, : size - d] = np.diag(matrix, -d)
    assert np.allclose(band(blocks), expected, atol=1e-12)
    assert np.allclose(vector(parts), column, atol=1e-12)


def test_points_that_share_their_noise_are_worth_fewer() -> None:
    """All sums scale with the weight, and the number of observations by itself."""
    sums = normal_equations(*some_points(3, 40, 6), intervals=6)
    scaled = sums.scaled(0.25, 0.5)
    for name in SUMS:
        factor = 0.5 if name == "count" else 0.25
        assert np.allclose(getattr(scaled, name), factor * getattr(sums, name), rtol=1e-12), name
