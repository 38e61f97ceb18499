"""Samples that depend on the points alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.geometry.sampling import middle, position_hash, spatial_sample, thinned

Array = np.ndarray

seeds = st.integers(0, 10_000)


def cloud(seed: int, count: int = 2000) -> Array:
    return np.random.default_rng(seed).normal(size=(count, 3))


@given(seeds, st.sampled_from([50, 500, 2000, 5000]))
def test_the_same_points_in_any_order_give_the_same_sample_in_the_same_order(seed: int, count: int) -> None:
    points = cloud(seed)
    order = np.random.default_rng(seed + 1).permutation(len(points))
    first, second = points[spatial_sample(points, count)], points[order][spatial_sample(points[order], count)]
    assert np.array_equal(first, second)
    assert np.array_equal(first, first[np.lexsort(first.T[::-1])])


@given(seeds)
def test_a_point_is_taken_or_not_whatever_the_others_are(seed: int) -> None:
    points = cloud(seed)
    taken = np.isin(np.arange(2000), thinned(points, 500))
    others = np.concatenate([points[:1000], cloud(seed + 1, 1000)])
    assert np.array_equal(np.isin(np.arange(1000), thinned(others, 500)), taken[:1000])


def test_about_as_many_as_wanted() -> None:
    counts = [len(thinned(cloud(seed, 20_000), 1000)) for seed in range(20)]
    # Binomial: a standard deviation of 31 for one, of 7 for the mean.
    assert np.mean(counts) == pytest.approx(1000, abs=4 * 7)
    assert np.std(counts) < 60


def test_all_where_there_are_not_more() -> None:
    points = cloud(0, 30)
    assert thinned(points, 30).tolist() == list(range(30))
    assert sorted(spatial_sample(points, 99).tolist()) == list(range(30))


def test_duplicates_are_taken_once_zeros_of_either_sign_among_them() -> None:
    points = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [-0.0, 0.0, -0.0]])
    assert points[spatial_sample(points, 10)].tolist() == [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 4.0]]
    assert position_hash(points)[1] == position_hash(points)[4]


def test_a_sample_goes_on_over_blocks() -> None:
    points = cloud(3, 150_000)
    assert np.array_equal(thinned(points, 1500), np.flatnonzero(position_hash(points) < 0.01))


def test_hashes_are_even_and_do_not_go_with_the_place() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(40.0)] * 3), axis=-1).reshape(-1, 3)
    hashes = position_hash(grid)
    assert ((hashes >= 0.0) & (hashes < 1.0)).all()
    counts = np.histogram(hashes, 64, (0.0, 1.0))[0]
    # Chi-squared with 63 degrees of freedom: 63 with a standard deviation of 11.
    assert ((counts - 1000.0) ** 2 / 1000.0).sum() < 63 + 4 * 11
    assert np.abs(np.corrcoef(np.column_stack([grid, hashes]).T)[3, :3]).max() < 4 / np.sqrt(len(grid))
    # Neither swapped coordinates nor neighbours share a hash.
    assert len(np.unique(hashes)) == len(grid)


@given(seeds)
def test_middle_of_the_box(seed: int) -> None:
    points = cloud(seed, 20)
    assert middle(points) == pytest.approx((points.min(axis=0) + points.max(axis=0)) / 2, abs=1e-15)
