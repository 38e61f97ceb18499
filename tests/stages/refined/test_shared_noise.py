"""How many points are worth one independent one."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.shared_noise import inflation, patch_inflation

LENGTH, RADIUS = 1.0, 0.005


def along(count: int, shared: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Places along a line, and residuals of which `shared` neighbours are the same."""
    rng = np.random.default_rng(seed)
    s = np.sort(rng.uniform(0.0, LENGTH, count))
    return s, np.repeat(rng.normal(size=count // shared + 1), shared)[:count] * 0.001


def test_independent_residuals_are_worth_what_they_are() -> None:
    """The largest of several ratios, each known to a tenth or worse: never less than one, rarely more than 1.5."""
    found = [inflation(*along(20_000, 1, seed), RADIUS) for seed in range(10)]
    assert 1.0 <= np.median(found) < 1.35 and max(found) < 1.8


@pytest.mark.parametrize("shared", [5, 20, 50])
def test_residuals_that_neighbours_share_are_worth_as_many_fewer(shared: int) -> None:
    s, residual = along(20_000, shared)
    assert inflation(s, residual, RADIUS) == pytest.approx(shared, rel=0.3)
    shuffled = np.random.default_rng(1).permutation(residual)
    assert inflation(s, shuffled, RADIUS) < 1.5


def test_one_wild_point_is_no_shared_noise() -> None:
    s, residual = along(20_000, 1)
    residual[500] = 10.0
    assert inflation(s, residual, RADIUS) < 1.5


def test_too_few_points_tell_nothing() -> None:
    s, residual = along(20, 5)
    assert inflation(s, residual, RADIUS) == 1.0


@pytest.mark.parametrize("shared", [1, 8])
def test_patches(shared: int) -> None:
    rng = np.random.default_rng(2)
    patch = np.repeat(np.arange(2000), 8)
    residual = np.repeat(rng.normal(size=16_000 // shared), shared)
    inside = np.ones(16_000, dtype=bool)
    assert patch_inflation(patch, residual, inside) == pytest.approx(shared, rel=0.1)
    # What is outside does not count.
    inside[::2] = False
    residual[::2] = 100.0
    assert patch_inflation(patch, residual, inside) == pytest.approx(max(shared / 2, 1), rel=0.1)
