from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.errors import FitError
from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.geometry.basis import CubicBSpline, InverseQuadratic
from dlogen.geometry.mdtw import mdtw
from dlogen.stages.paper.skeleton import choose_beta, fit_skeleton, paper_basis
from dlogen.types import Skeleton


def samples(seed: int, count: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Noisy points in order on a random line about the origin, and their coordinates."""
    rng = np.random.default_rng(seed)
    line = random_centre_line(seed)
    s = np.sort(rng.random(count))
    return line(s) - line([0.5]) + rng.normal(scale=noise, size=(count, 3)), s


def test_the_papers_basis() -> None:
    assert paper_basis() == InverseQuadratic(21, 5.25)
    assert paper_basis(30) == InverseQuadratic(30, 7.5)
    assert paper_basis(30, 3.0) == InverseQuadratic(30, 3.0)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.sampled_from([1e-3, 1e-2, 1.0]))
def test_equation_11_is_the_augmented_least_squares_solution(seed: int, beta: float) -> None:
    points, s = samples(seed, 60, 0.002)
    basis = paper_basis()
    line = fit_skeleton(points, s, basis, beta)
    # min |Phi W - Y|^2 + beta |W|^2 as one system: [Phi; sqrt(beta) I] W = [Y; 0].
    augmented = np.vstack([basis(s), np.sqrt(beta) * np.eye(21)])
    weights = np.linalg.lstsq(augmented, np.vstack([points, np.zeros((21, 3))]), rcond=None)[0]
    assert line.weights == pytest.approx(weights, abs=1e-8)
    # By the definition, Eq. 11 with an inverse: beta, not the 2 beta of Eq. 10.
    phi = basis(s)
    assert line.weights == pytest.approx(np.linalg.inv(phi.T @ phi + beta * np.eye(21)) @ phi.T @ points, abs=1e-8)
    assert line.weights != pytest.approx(np.linalg.inv(phi.T @ phi + 2 * beta * np.eye(21)) @ phi.T @ points, abs=1e-8)


def test_the_coordinates_are_fitted_one_by_one() -> None:
    points, s = samples(1, 60, 0.002)
    together = fit_skeleton(points, s, paper_basis(), 1e-2)
    for axis in range(3):
        alone = fit_skeleton(points * np.eye(3)[axis], s, paper_basis(), 1e-2)
        assert alone.weights[:, axis] == pytest.approx(together.weights[:, axis])
        assert np.abs(np.delete(alone.weights, axis, axis=1)).max() == 0


def test_value_derivatives_and_length_of_the_line() -> None:
    points, s = samples(2, 200, 0.001)
    line = fit_skeleton(points, s, paper_basis(), 1e-3)
    at, h = np.linspace(0.01, 0.99, 40), 1e-6
    assert line(at) == pytest.approx(paper_basis()(at) @ line.weights)
    for derivative in (1, 2, 3):
        numeric = (line(at + h, derivative - 1) - line(at - h, derivative - 1)) / (2 * h)
        exact = line(at, derivative)
        assert np.allclose(exact, numeric, atol=1e-6 * np.abs(exact).max())
    fine = line(np.linspace(0, 1, 200_001))
    assert line.length == pytest.approx(np.linalg.norm(np.diff(fine, axis=0), axis=1).sum(), rel=1e-8)


def test_the_offset_moves_the_line_but_not_its_derivatives() -> None:
    points, s = samples(2, 200, 0.001)
    line = fit_skeleton(points, s, paper_basis(), 1e-3)
    moved = Skeleton(line.basis, line.weights, np.array([5e6, -1.0, 2.0]), line.length)
    at = np.linspace(0, 1, 7)
    assert moved(at) == pytest.approx(line(at) + np.array([5e6, -1.0, 2.0]), abs=1e-9)
    assert np.array_equal(moved(at, 1), line(at, 1))
    assert moved(0.5).shape == (3,)
    assert moved([0.5]).shape == (1, 3)


@pytest.mark.parametrize(
    ("basis", "error"), [(paper_basis(), 0.006), (CubicBSpline(40), 1e-5)], ids=["paper", "splines"]
)
def test_exact_points_give_the_curve(basis, error: float) -> None:
    line = centre_line("bent")
    s = np.linspace(0, 1, 2000)
    fitted = fit_skeleton(line(s), s, basis, 1e-9)
    assert np.linalg.norm(fitted(s) - line(s), axis=1).max() < error
    assert fitted.length == pytest.approx(line.length, abs=2 * error)


@pytest.mark.parametrize("name", ["bent", "straight", "helical"])
def test_the_papers_regularisation_falls_short_at_the_ends(name: str) -> None:
    # Exact points, exact order: what is missing is the ridge's and the decaying basis' doing (the paper's IV.B).
    line = centre_line(name)
    s = np.linspace(0, 1, 5000)
    points = line(s)
    points -= (points.min(axis=0) + points.max(axis=0)) / 2
    fitted = fit_skeleton(points, s, paper_basis(), 1e-2)
    ends = np.linalg.norm(fitted([0.0, 1.0]) - points[[0, -1]], axis=1)
    middle = np.linalg.norm(fitted(s[1000:4000]) - points[1000:4000], axis=1)
    assert 0.005 < ends.max() < 0.03
    assert -0.045 < fitted.length - line.length < -0.015
    assert middle.max() < 0.003
    # The figures of Table II are of this size.
    assert mdtw(points[::5], fitted(s[::5])).mean < 0.00242


def left_out_error(points, s, basis, beta: float) -> float:
    """Sum of squared residuals of every point left out of the fit, one by one."""
    total = 0.0
    phi = basis(s)
    for i in range(len(s)):
        kept = np.arange(len(s)) != i
        normal = phi[kept].T @ phi[kept] + beta * np.eye(basis.size)
        weights = np.linalg.solve(normal, phi[kept].T @ points[kept])
        total += float(np.sum((phi[i] @ weights - points[i]) ** 2))
    return total


@pytest.mark.parametrize(("noise", "shift"), [(0.0005, 0.0), (0.003, 0.0), (0.02, 0.0), (0.003, 2.0)])
def test_beta_auto_is_near_the_best_by_leave_one_out(noise: float, shift: float) -> None:
    points, s = samples(4, 40, noise)
    points = points + shift
    basis = paper_basis()
    errors = {beta: left_out_error(points, s, basis, beta) for beta in np.logspace(-8, 2, 21)}
    chosen = left_out_error(points, s, basis, choose_beta(basis, points, s))
    assert chosen < 1.6 * min(errors.values())
    # There is something to choose.
    assert max(errors.values()) > 10 * min(errors.values())


def test_more_noise_wants_more_regularisation() -> None:
    chosen = [choose_beta(paper_basis(), *samples(4, 60, noise)) for noise in (1e-4, 3e-3, 3e-2)]
    assert chosen[0] < chosen[1] < chosen[2]


def test_what_is_not_determined_is_refused() -> None:
    points, s = samples(0, 10, 0.0)
    with pytest.raises(FitError, match="10 points do not determine 21 basis functions") as error:
        fit_skeleton(points * np.nan, s, paper_basis(), 1e-2)
    assert "beta" in error.value.hint
    with pytest.raises(FitError):
        fit_skeleton(np.ones((10, 3)), np.full(10, 2.0), CubicBSpline(40), 0.0)
    # With a ridge, fewer points than functions are no trouble.
    assert np.isfinite(fit_skeleton(points, s, paper_basis(), 1e-2).weights).all()
