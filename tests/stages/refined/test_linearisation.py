"""The penalised least-squares problem against differences and dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.errors import FitError
from dlogen.stages.refined.linearisation import LOG_LAMBDA, Linearisation
from dlogen.stages.refined.normal_equations import NormalEquations, normal_equations
from dlogen.stages.refined.tube_curve import TubeCurve, foot_points, nearest, through

Array = np.ndarray


def system(curve, points, rho, weight=None):
    x, k, t, offset = foot_points(curve, points, nearest(curve, points, 0.02), 6)
    distance = np.linalg.norm(offset, axis=0)
    weight = np.ones(len(x)) if weight is None else weight
    return normal_equations(k, t, offset / distance, distance - rho, weight, curve.intervals), distance


def test_normal_equations_are_the_derivatives_of_the_distances(curve):
    rng = np.random.default_rng(2)
    points = curve(rng.uniform(3.0, 37.0, 200)).T + rng.normal(scale=0.03, size=(3, 200))
    weight = rng.uniform(0.2, 1.0, 200)
    sums, distance = system(curve, points, 0.02, weight)
    problem = Linearisation(curve, sums, True)
    assert sums.weight == pytest.approx(weight.sum())
    assert sums.squares == pytest.approx(np.sum(weight * (distance - 0.02) ** 2))
    step = 1e-6
    for j, c in ((0, 0), (7, 1), (20, 2), (42, 0), (33, 1)):
        changed = curve.coefficients.copy()
        changed[j, c] += step
        other, moved = system(TubeCurve(changed, curve.step), points, 0.02, weight)
        # The gradient of half the squares is minus the right-hand side.
        assert (other.squares - sums.squares) / (2.0 * step) == pytest.approx(
            -problem.right[3 * j + c], rel=1e-3, abs=1e-5
        )
        assert np.sum(weight * (moved - distance)) / step == pytest.approx(
            -problem.radius[3 * j + c], rel=1e-3, abs=1e-3
        )
        assert problem.data[0, 3 * j + c] == pytest.approx(
            np.sum(weight * ((moved - distance) / step) ** 2), rel=1e-3, abs=1e-5
        )


def test_penalty_leaves_circles_and_lines_alone():
    angle = np.linspace(0.0, 2.0, 6 * 30 + 1)
    points = np.random.default_rng(0).normal(size=(3, 50))
    circle = through(np.stack([np.cos(angle), np.sin(angle), 0 * angle]), 30, 2.0 / 30)
    spiral = through(np.stack([np.cos(angle) * (1 + angle), np.sin(angle) * (1 + angle), 0 * angle]), 30, 4.0 / 30)
    line = through(np.stack([angle, 2 * angle, 0 * angle]), 30, 2.0 * np.sqrt(5.0) / 30)
    energy = {
        name: Linearisation(curve, system(curve, points, 0.1)[0], False).energy
        for name, curve in (("circle", circle), ("spiral", spiral), ("line", line))
    }
    assert energy["line"] < 1e-12
    assert energy["circle"] < 1e-2 * energy["spiral"]


def dense(band: Array) -> Array:
    """The symmetric matrix of a lower band."""
    matrix = sum(np.diag(row[: len(row) - d], -d) for d, row in enumerate(band))
    return matrix + np.tril(matrix, -1).T


@pytest.fixture(scope="module")
def sums(curve: TubeCurve) -> NormalEquations:
    """Points of a tube of 20 mm around the helix, with 2 mm of noise."""
    rng = np.random.default_rng(3)
    x = rng.uniform(0.5, 39.5, 800)
    tangent = curve(x, 1)
    around = np.cross(tangent, rng.normal(size=(800, 3)))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    points = curve(x) + (0.02 + 0.002 * rng.normal(size=(800, 1))) * around
    return system(curve, points.T, 0.018)[0]


@pytest.mark.parametrize("log_lambda", [-4.0, -1.0, 2.0])
@pytest.mark.parametrize("free", [False, True])
def test_a_step_solves_the_penalised_problem(
    curve: TubeCurve, sums: NormalEquations, free: bool, log_lambda: float
) -> None:
    problem = Linearisation(curve, sums, free)
    solution = problem.solve(log_lambda)
    weight = 10.0**log_lambda * problem.scale
    matrix = dense(problem.held) + weight * dense(problem.penalty)
    right = problem.right - weight * problem.pull
    if free:
        matrix = np.block([[matrix, problem.radius[:, None]], [problem.radius[None], np.array([[sums.weight]])]])
        right = np.append(right, sums.residual)
    expected = np.linalg.solve(matrix, right)
    coefficients = len(problem.right)
    assert np.allclose(solution.step, expected[:coefficients], rtol=1e-5, atol=1e-9)
    assert solution.radius_step == pytest.approx(expected[-1] if free else 0.0, rel=1e-6)
    moves = solution.step.reshape(-1, 3)
    # At most half an interval each.
    moves = moves * np.minimum(1.0, 0.5 * curve.step / np.linalg.norm(moves, axis=1, keepdims=True))
    assert np.allclose(solution.curve.coefficients, curve.coefficients + moves, atol=1e-12)
    assert solution.smoothing == pytest.approx(weight * curve.step**5)
    rows = np.random.default_rng(0).normal(size=(4, coefficients))
    inverse = np.linalg.inv(matrix)[:coefficients, :coefficients]
    assert np.allclose(solution.covariance(rows), rows @ inverse @ rows.T, rtol=1e-5)


def test_the_penalty_is_the_squared_third_derivative_across(curve: TubeCurve) -> None:
    rng = np.random.default_rng(1)
    bent = TubeCurve(curve.coefficients + 0.01 * rng.normal(size=curve.coefficients.shape), curve.step)
    problem = Linearisation(bent, system(bent, rng.normal(size=(3, 50)), 0.1)[0], False)
    third = np.diff(bent.coefficients, 3, axis=0)
    tangent = bent(np.arange(40) + 0.5, 1)
    across = np.linalg.norm(np.cross(third, tangent), axis=1) / np.linalg.norm(tangent, axis=1)
    assert problem.energy == pytest.approx(np.sum(across**2))
    # Half the energy's gradient is the pull; the energy is a quadratic form with the penalty as its matrix.
    flat = bent.coefficients.ravel()
    assert np.allclose(problem.pull, dense(problem.penalty) @ flat, atol=1e-12)
    assert flat @ problem.pull == pytest.approx(problem.energy)


def test_the_radius_of_exact_points_is_found_in_one_step(curve: TubeCurve, sums: NormalEquations) -> None:
    # The points lie about 20 mm off, 18 mm were supposed.
    assert Linearisation(curve, sums, True).best().radius_step == pytest.approx(0.002, abs=3e-4)
    assert Linearisation(curve, sums, False).best().radius_step == 0.0


def test_the_best_smoothing_is_twice_the_likeliest(curve: TubeCurve, sums: NormalEquations) -> None:
    problem = Linearisation(curve, sums, True)
    grid = np.arange(LOG_LAMBDA[0], LOG_LAMBDA[1], 0.05)
    likeliest = grid[np.argmin([problem.solve(value).criterion for value in grid])]
    best = problem.best()
    assert best.log_lambda == pytest.approx(likeliest + 0.3, abs=0.25)
    # Started from there it stays there.
    assert problem.best(best.smoothing).log_lambda == pytest.approx(likeliest + 0.3, abs=0.1)


@pytest.mark.parametrize("off", [-2.0, 0.0, 2.0])
def test_the_smoothing_settles_from_step_to_step(curve: TubeCurve, sums: NormalEquations, off: float) -> None:
    """Each step of the fit starts from the smoothing of the one before: it must come to the best one, and not drift."""
    problem = Linearisation(curve, sums, True)
    best = problem.best().log_lambda
    solution = problem.solve(best + off)
    for _ in range(12):
        solution = problem.best(solution.smoothing)
    assert solution.log_lambda == pytest.approx(best, abs=0.25)
    assert problem.best(solution.smoothing).log_lambda == pytest.approx(solution.log_lambda, abs=0.01)


def test_how_far_a_step_moves_the_distances(curve: TubeCurve, sums: NormalEquations) -> None:
    problem = Linearisation(curve, sums, True)
    solution = problem.solve(-1.0)
    step, change = solution.step, solution.radius_step
    squares = step @ dense(problem.data) @ step + 2.0 * change * problem.radius @ step + change**2 * sums.weight
    assert problem.moved(solution) == pytest.approx(np.sqrt(squares / sums.weight))


def test_steps_are_at_most_half_an_interval(curve: TubeCurve) -> None:
    rng = np.random.default_rng(0)
    points = curve(rng.uniform(0.0, 40.0, 400)).T + np.array([[0.0], [0.0], [0.3]])
    problem = Linearisation(curve, system(curve, points, 0.01)[0], False)
    moved = np.linalg.norm(problem.solve(-6.0).curve.coefficients - curve.coefficients, axis=1)
    assert moved.max() == pytest.approx(0.5 * curve.step)
    assert np.linalg.norm(problem.solve(-6.0).step.reshape(-1, 3), axis=1).max() > curve.step


def test_points_that_determine_nothing(curve: TubeCurve) -> None:
    nothing = normal_equations(np.zeros(1, dtype=int), np.zeros(1), np.eye(3)[:, :1], np.zeros(1), np.zeros(1), 40)
    with pytest.raises(FitError, match="do not determine a line"):
        Linearisation(curve, nothing, False).solve(0.0)
