"""Gauss-Newton on the distances of points to a tube, against a helix with a known radius."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.errors import FitError
from dlogen.stages.refined import tube_fit
from dlogen.stages.refined.tube import Tube, tukey
from dlogen.stages.refined.tube_curve import TubeCurve, foot_points, nearest, spline_values
from dlogen.stages.refined.tube_fit import _solid_normals, all_points, gauss_newton

Array = np.ndarray
MM = 1e-3


def surface(curve: TubeCurve, radius: float, count: int, noise: float = 0.0, seed: int = 0) -> Array:
    """(3, M) points all around, and in any order."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(0.2, curve.intervals - 0.2, count)
    around = np.cross(curve(x, 1), rng.normal(size=(count, 3)))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    return (curve(x) + radius * around + noise * rng.normal(size=(count, 3))).T


def start(curve: TubeCurve, points: Array, radius: float, off: float = 5 * MM, **options: bool) -> Tube:
    """A tube that is off by a smooth wave, and does not know where the points' feet are."""
    t = np.linspace(0.0, 9.0, len(curve.coefficients))
    wave = off * np.stack([np.sin(t), np.cos(1.3 * t), np.sin(0.7 * t + 1.0)], axis=1)
    count = points.shape[1]
    return Tube(
        TubeCurve(curve.coefficients + wave, curve.step), radius, 1 * MM, np.zeros(count), np.zeros(count), **options
    )


def off_axis(found: TubeCurve, curve: TubeCurve) -> float:
    """The largest distance of the found axis to the true one, without its ends."""
    points = found(np.linspace(2.0, found.intervals - 2.0, 300)).T
    return float(np.linalg.norm(foot_points(curve, points, nearest(curve, points, 0.01), 6)[3], axis=0).max())


@pytest.mark.parametrize("guess", [16 * MM, 24 * MM])
def test_axis_and_radius_of_an_exact_tube(curve: TubeCurve, guess: float) -> None:
    points = surface(curve, 20 * MM, 3000)
    tube = start(curve, points, guess)
    rough = gauss_newton(points, tube, free_radius=True, steps=10, floor=0.1, search=True)
    out = gauss_newton(points, rough, free_radius=True, steps=15, floor=5e-4)
    assert off_axis(tube.curve, curve) > 4 * MM
    assert off_axis(out.curve, curve) < 0.01 * MM
    assert out.radius == pytest.approx(20 * MM, abs=0.01 * MM)
    assert np.abs(out.distance - 20 * MM).max() < 0.05 * MM


def test_a_radius_that_is_not_free_stays(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 2000)
    out = gauss_newton(points, start(curve, points, 19 * MM), free_radius=False, steps=10, floor=0.1, search=True)
    assert out.radius == 19 * MM
    # All around, the axis does not mind.
    assert off_axis(out.curve, curve) < 0.5 * MM


def test_noise_is_measured_and_its_bias_is_not_taken_for_radius(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 8000, 3 * MM)
    tube = start(curve, points, 20 * MM)
    out = gauss_newton(points, tube, free_radius=True, steps=15, floor=0.1, search=True)
    assert out.sigma == pytest.approx(3 * MM, rel=0.05)
    assert out.radius == pytest.approx(20 * MM, abs=0.15 * MM)
    # The points themselves are sigma^2 / (2 r) = 0.22 mm farther off in the mean.
    assert out.distance[out.on_curve].mean() - 20 * MM == pytest.approx(0.22 * MM, abs=0.12 * MM)
    assert abs(np.median(out.residual[out.on_curve])) < 0.15 * MM


def test_strays_do_not_pull(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 3000)
    strays = np.random.default_rng(1).uniform(points.min(axis=1), points.max(axis=1), (300, 3)).T
    cloud = np.concatenate([points, strays], axis=1)
    rough = gauss_newton(cloud, start(curve, cloud, 20 * MM), free_radius=True, steps=10, floor=0.1, search=True)
    out = gauss_newton(cloud, rough, free_radius=True, steps=15, floor=5e-4)
    assert off_axis(out.curve, curve) < 0.05 * MM


def test_rows_stay_with_their_points(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 1500)
    order = np.random.default_rng(2).permutation(1500)
    out, shuffled = (
        gauss_newton(cloud, start(curve, cloud, 20 * MM), free_radius=True, steps=6, floor=0.1, search=True)
        for cloud in (points, points[:, order])
    )
    assert np.allclose(shuffled.curve.coefficients, out.curve.coefficients, atol=1e-9)
    assert np.allclose(shuffled.x, out.x[order], atol=1e-7)
    assert np.allclose(shuffled.distance, out.distance[order], atol=1e-9)


def test_a_solid_strand_is_fitted_through_its_points(curve: TubeCurve) -> None:
    rng = np.random.default_rng(4)
    points = (curve(rng.uniform(0.2, 39.8, 6000)) + 5 * MM * rng.normal(size=(6000, 3))).T
    out = gauss_newton(
        points,
        start(curve, points, 5 * MM, off=2 * MM, solid=True),
        free_radius=False,
        steps=10,
        floor=0.1,
        search=True,
    )
    assert out.solid
    assert off_axis(out.curve, curve) < 1 * MM


def test_a_solid_strand_counts_both_components_across(curve: TubeCurve) -> None:
    points = surface(curve, 5 * MM, 200)
    x, k, t, offset = foot_points(curve, points, nearest(curve, points, 0.01), 6)
    distance = np.linalg.norm(offset, axis=0)
    sums = _solid_normals(curve, k, t, offset / distance, distance, np.ones(200, dtype=bool))
    weight = tukey(distance, 5 * MM / 1.1774)
    tangent = curve(x, 1) / np.linalg.norm(curve(x, 1), axis=1, keepdims=True)
    across = np.eye(3) - tangent[:, :, None] * tangent[:, None, :]
    values = spline_values(t)
    expected = np.zeros((40, 4, 3, 4, 3))
    np.add.at(expected, k, np.einsum("m,pm,qm,mcd->mpcqd", weight, values, values, across))
    assert np.allclose(sums.blocks, expected.reshape(40, 12, 12), atol=1e-9)
    # Along the sideways direction nothing is off.
    assert sums.squares == pytest.approx(weight @ distance**2)
    right = np.zeros((40, 4, 3))
    np.add.at(right, k, np.einsum("m,pm,cm->mpc", weight, values, offset))
    assert np.allclose(sums.right, right.reshape(40, 12), atol=1e-9)


def test_points_that_are_elsewhere(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 500) + np.array([[0.0], [0.0], [2.0]])
    with pytest.raises(FitError, match="only 0 of 500 points") as caught:
        gauss_newton(points, start(curve, points, 20 * MM), free_radius=True, steps=3, floor=0.1, search=True)
    assert caught.value.stage == "refine" and caught.value.hint
    with pytest.raises(FitError, match="not near the points"):
        all_points(points, start(curve, points, 20 * MM), free_radius=True, steps=1, search=True)


def test_feet_of_all_points(curve: TubeCurve) -> None:
    points = surface(curve, 20 * MM, 3000, 1 * MM)
    tube = Tube(curve, 20 * MM, 1 * MM, np.zeros(10), np.zeros(10))
    out = all_points(points, tube, free_radius=True, steps=0, search=True)
    assert out.curve is curve and out.radius == 20 * MM
    dense = curve(np.linspace(0.0, 40.0, 8001))
    for m in range(0, 3000, 100):
        apart = np.linalg.norm(points[:, m] - dense, axis=1)
        assert out.distance[m] == pytest.approx(apart.min(), abs=1e-5)
        assert out.x[m] == pytest.approx(40.0 * np.argmin(apart) / 8000, abs=0.01)
    assert out.sigma == pytest.approx(1 * MM, rel=0.06)


def test_steps_over_all_points_are_those_in_one_piece(curve: TubeCurve, monkeypatch: pytest.MonkeyPatch) -> None:
    points = surface(curve, 20 * MM, 2000, 0.5 * MM)
    tube = start(curve, points, 19.8 * MM, off=0.5 * MM)
    whole = all_points(points, tube, free_radius=True, steps=2, search=True)
    monkeypatch.setattr(tube_fit, "_CHUNK", 300)
    parts = all_points(points, tube, free_radius=True, steps=2, search=True)
    assert np.allclose(parts.curve.coefficients, whole.curve.coefficients, atol=1e-9)
    assert np.allclose(parts.distance, whole.distance, atol=1e-9)
    assert whole.radius == pytest.approx(20 * MM, abs=0.05 * MM)
    assert off_axis(whole.curve, curve) < 0.2 * MM
    # What the tube knew before is not overwritten.
    assert not tube.x.any()
