"""Steps of coordinates: single precision far from the origin, few decimals, grids of voxels."""

from __future__ import annotations

import numpy as np
import pytest

import dlogen
from dlogen.errors import FitError
from dlogen.evaluation.synthetic import synth
from dlogen.stages.quality.coordinates import check_steps, coordinate_steps

Array = np.ndarray


def tube(radius: float, seed: int = 0, points: int = 5000) -> Array:
    """A tube in the room, 60 times as long as thick, with noise of 3 % of the radius."""
    rng = np.random.default_rng(seed)
    t, a = rng.uniform(0, 1, points), rng.uniform(0, 2 * np.pi, points)
    x, y = 120 * radius * t, 12 * radius * np.sin(6 * t)
    slope = np.arctan2(72 * radius * np.cos(6 * t), 120 * radius)
    across = radius * np.cos(a)
    cloud = np.c_[x - across * np.sin(slope), y + across * np.cos(slope), radius * np.sin(a)]
    turn = np.linalg.qr(np.random.default_rng(seed + 100).normal(size=(3, 3)))[0]
    return cloud @ turn.T + rng.normal(0, 0.03 * radius, cloud.shape)


def voxels(points: Array, step: float) -> Array:
    """The centres of the voxels that have points."""
    return (np.unique(np.floor(points / step), axis=0) + 0.5) * step


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("offset", [0.0, 1.0, 1000.0])
def test_continuous_coordinates_have_no_steps(kind: type, offset: float) -> None:
    points = (tube(0.01) + offset).astype(kind).astype(float)
    steps = coordinate_steps(points)
    assert not steps.is_grid or steps.largest < 1e-4  # what single precision has at 1000
    assert check_steps(steps, 1.0, 0.01) == []


@pytest.mark.parametrize(("offset", "step"), [(1e5, 2.0**-7), (5e5, 2.0**-5), (1e6, 2.0**-4), (5e6, 2.0**-1)])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_single_precision_at_survey_coordinates(offset: float, step: float, scale: float) -> None:
    points = (scale * (tube(0.05, points=20_000) + np.array([offset, offset / 4, 0.0]))).astype(np.float32)
    steps = coordinate_steps(points.astype(float))
    assert steps.few_digits
    # In millimetres the numbers are 1000 times as large, and so are their steps, up to a power of two.
    assert steps.largest / scale == pytest.approx(step, rel=0.05 if scale == 1.0 else 0.6)
    assert "single precision" in steps.said(1.0 / scale)


@pytest.mark.parametrize("radius", [0.002, 0.01, 0.05])
@pytest.mark.parametrize("offset", [1e5, 5e5, 1e6, 5e6])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_few_digits_are_never_good_where_they_matter(radius: float, offset: float, axis: int) -> None:
    points = (tube(radius, seed=axis) + offset * np.eye(3)[axis]).astype(np.float32).astype(float)
    share = float(np.spacing(np.float32(offset))) / radius
    try:
        quality = dlogen.fit(points).quality
    except FitError as error:
        assert share > 0.5 and "single precision" in error.message and "double precision" in error.hint
        return
    severity = {finding.code: finding.severity for finding in quality.findings}.get("few-digits")
    if share > 0.35:
        assert severity in ("doubtful", "bad") and not quality.is_good
    if share < 0.08:
        assert severity is None


def test_double_precision_is_enough_anywhere() -> None:
    assert dlogen.fit(tube(0.01) + np.array([5e5, 5e6, 100.0])).quality.is_good


def test_decimals_that_are_too_few_there() -> None:
    """%g has six digits: 500000 m and whole metres, 50000.1."""
    points = np.round(tube(0.2) + np.array([5e4, 0.0, 0.0]), 1)
    steps = coordinate_steps(points)
    assert steps.few_digits and steps.largest == pytest.approx(0.1)
    assert "few digits" in steps.said(1.0) and "single" not in steps.said(1.0)


@pytest.mark.parametrize("step", [0.15, 0.3, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("offset", [0.0, 5.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_voxels_are_named(step: float, kind: type, offset: float, seed: int) -> None:
    points = voxels(tube(0.01, seed, 50_000) + offset, step * 0.01).astype(kind).astype(float)
    steps = coordinate_steps(points)
    assert steps.is_grid and not steps.few_digits
    assert steps.largest == pytest.approx(step * 0.01, rel=1e-3)
    (finding,) = check_steps(steps, 1.0, 0.01)
    assert finding.code == "coarse-grid"
    assert finding.severity == ("note" if step < 0.45 else "doubtful")
    assert check_steps(steps, 0.001, 0.00001)[0].severity == finding.severity


@pytest.mark.parametrize("shape", ["straight", "bent", "helical"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("step", [0.2, 0.4, 0.6, 0.8, 1.0])
def test_a_radius_that_voxels_spoil_is_never_good(shape: str, turned: bool, step: float) -> None:
    cloud = synth(shape, points=60_000, seed=1)
    points = cloud.points
    if turned:
        points = points @ np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0].T
    try:
        result = dlogen.fit(voxels(points, step * cloud.radius))
    except FitError:
        return
    if result.quality.is_good:
        assert result.chain.radius == pytest.approx(cloud.radius, rel=0.03)
    else:
        assert step > 0.3


def test_depth_in_steps_is_no_grid() -> None:
    """A depth camera rounds one axis only."""
    points = tube(0.005)
    points[:, 2] = np.round(points[:, 2], 3)
    assert not coordinate_steps(points).is_grid
    assert check_steps(coordinate_steps(points), 1.0, 0.005) == []
