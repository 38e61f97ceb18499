"""The penalised least-squares problem around a curve, and the smoothing of largest likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from dlogen.errors import FitError
from dlogen.geometry.spline import THIRD_DIFFERENCE
from dlogen.geometry.vectors import unit
from dlogen.stages.refined.normal_equations import NormalEquations, band, vector
from dlogen.stages.refined.tube_curve import TubeCurve
from dlogen.types import Array

#: Bounds of log10(lambda / its natural scale), where data and penalty weigh the same in the matrix.
LOG_LAMBDA = (-8.0, 6.0)


#: log10 of the smoothing over the one of largest likelihood. The sample paths of the prior are rougher than cables, so
#: that its best smoothing is too weak for them: twice as much lowers the error of position by 4 % and that of the
#: largest curvature by 15 % on random curves, loops and tight bends alike, and still raises none.
_SMOOTHER = 0.3


def _penalty(curve: TubeCurve) -> Array:
    """(n, 12, 12) blocks of the penalty: the squared third derivative across the tangent.

    The third differences of uniform cubic B-spline coefficients are the third derivative. Only what is normal to the
    curve is penalised, which for a curve in arc length is the change of its curvature and torsion: circles and straight
    lines cost nothing.
    """
    tangent = unit(curve.everywhere(np.array([0.5]), 1).T)
    across = np.eye(3) - tangent[:, :, None] * tangent[:, None, :]
    blocks = THIRD_DIFFERENCE[:, None, None, None] * THIRD_DIFFERENCE[:, None] * across[:, None, :, None, :]
    square: Array = blocks.reshape(-1, 12, 12)
    return square


@dataclass(frozen=True, eq=False)
class Solution:
    """The step of one linearisation.

    Attributes:
        curve: the curve after the step.
        radius_step: change of rho.
        log_lambda: log10 of the smoothing, relative to its natural scale.
        smoothing: the weight of the integral of the squared third derivative over arc length, m^5.
        criterion: -2 log of the marginal likelihood, up to a constant.
        factor: Cholesky factor of the matrix (band storage).
        coupling: (3 N,) its solution for the radius column.
        schur: what is left for the radius after the coefficients.
        step: (3 N,) the change of the coefficients.
    """

    curve: TubeCurve
    radius_step: float
    log_lambda: float
    smoothing: float
    criterion: float
    factor: Array
    coupling: Array
    schur: float
    step: Array

    def covariance(self, rows: Array) -> Array:
        """Posterior covariance of linear functions of the coefficients, for unit noise: (R, 3 N) -> (R, R)."""
        solved = dpbtrs(self.factor, np.ascontiguousarray(rows.T), lower=1)[0]
        through_radius = rows @ self.coupling
        covariance: Array = rows @ solved + np.outer(through_radius, through_radius) / self.schur
        return covariance

    def variances(self, rows: Array) -> Array:
        """The diagonal of `covariance`: (R, 3 N) -> (R,)."""
        solved = dpbtrs(self.factor, np.ascontiguousarray(rows.T), lower=1)[0]
        result: Array = np.einsum("rn,nr->r", rows, solved) + (rows @ self.coupling) ** 2 / self.schur
        return result


class Linearisation:
    """The penalised least-squares problem around a curve, for any smoothing.

    Args:
        curve: where it is linearised.
        sums: the normal equations.
        free_radius: whether rho is an unknown.
    """

    def __init__(self, curve: TubeCurve, sums: NormalEquations, free_radius: bool) -> None:
        self.curve, self.sums, self.free_radius = curve, sums, free_radius
        self.data = band(sums.blocks)
        penalty = _penalty(curve)
        self.penalty = band(penalty)
        self.right = vector(sums.right)
        self.radius = vector(sums.radius)
        windows = np.lib.stride_tricks.sliding_window_view(curve.coefficients, 4, axis=0)
        local = windows.transpose(0, 2, 1).reshape(-1, 12)
        slope = np.einsum("kab,kb->ka", penalty, local)
        self.pull = vector(slope)
        self.energy = float(np.sum(slope * local))
        self.scale = self.data[0].sum() / self.penalty[0].sum()
        self._hold(0.1)

    def _hold(self, share: float) -> None:
        """Hold the coefficients along the tangent: moving along itself does not change a curve."""
        size = len(self.curve.coefficients)
        tangent = self.curve(np.clip(np.arange(size) - 1.0, 0.0, self.curve.intervals), 1)
        tangent *= np.sqrt(share * self.data[0].sum() / size) / np.linalg.norm(tangent, axis=1, keepdims=True)
        outer = tangent[:, :, None] * tangent[:, None, :]
        self.held = self.data.copy()
        for d in range(3):
            for c in range(3 - d):
                self.held[d, c::3] += outer[:, c + d, c]

    def solve(self, log_lambda: float) -> Solution:
        """The step for one smoothing, with the marginal likelihood of that smoothing.

        The penalty is the prior N(0, sigma^2 / lambda) of the third derivative; integrating the coefficients out and
        maximising over sigma leaves the restricted likelihood (REML; Wahba 1985, Wood 2011), which is less prone to
        fit noise than cross-validation.
        """
        smoothing = 10.0**log_lambda * self.scale
        factor, info = dpbtrf(self.held + smoothing * self.penalty, lower=1, overwrite_ab=1)
        if info:
            # Long stretches without points need more of the penalty to be determined at all.
            if log_lambda > LOG_LAMBDA[1]:
                raise FitError("the points do not determine a line", "check r and units", stage="refine")
            return self.solve(log_lambda + 1.0)
        right = self.right - smoothing * self.pull
        solved = dpbtrs(factor, np.stack([right, self.radius], axis=1), lower=1)[0]
        step, coupling = solved[:, 0], solved[:, 1]
        sums = self.sums
        objective = sums.squares + smoothing * self.energy - float(right @ step)
        log_determinant = 2.0 * float(np.log(factor[0]).sum())
        radius_step, schur = 0.0, np.inf
        if self.free_radius:
            schur = max(sums.weight - float(self.radius @ coupling), 1e-12 * sums.weight)
            slope = sums.residual - float(self.radius @ step)
            radius_step = slope / schur
            step = step - coupling * radius_step
            objective -= slope * radius_step
            log_determinant += float(np.log(schur))
        freedom = max(sums.count - 6.0 - self.free_radius, 1.0)
        objective = max(objective, 1e-24 * sums.weight * self.curve.step**2)
        rank = 2 * self.curve.intervals
        criterion = freedom * np.log(objective) + log_determinant - rank * np.log(smoothing)
        return Solution(
            TubeCurve(self.curve.coefficients + self._limited(step.reshape(-1, 3)), self.curve.step),
            radius_step,
            log_lambda,
            smoothing * self.curve.step**5,
            float(criterion),
            factor,
            coupling,
            schur,
            step,
        )

    def _limited(self, step: Array) -> Array:
        """Steps of at most half an interval each: where there are hardly any points, a solution may be anywhere."""
        length = np.linalg.norm(step, axis=1, keepdims=True)
        shortened: Array = step * np.minimum(1.0, 0.5 * self.curve.step / np.maximum(length, 1e-300))
        return shortened

    def moved(self, solution: Solution) -> float:
        """Root mean square of the change that a step makes to the distances of the points, metres."""
        local = np.lib.stride_tricks.sliding_window_view(solution.step.reshape(-1, 3), 4, axis=0)
        local = local.transpose(0, 2, 1).reshape(-1, 1, 12)
        change = solution.radius_step
        squares = float((local @ self.sums.blocks @ local.transpose(0, 2, 1)).sum())
        squares += 2.0 * change * float(self.radius @ solution.step) + change**2 * self.sums.weight
        return float(np.sqrt(max(squares, 0.0) / self.sums.weight))

    def best(self, smoothing: float | None = None, least: float = LOG_LAMBDA[0]) -> Solution:
        """The step with twice the smoothing of largest marginal likelihood (see `_SMOOTHER`).

        Args:
            smoothing: `Solution.smoothing` to start from; without one the whole range is searched.
            least: log10 of the least smoothing, relative to its natural scale.
        """
        low, high = least, LOG_LAMBDA[1]
        if smoothing is None:
            tried = [self.solve(value) for value in np.arange(low, high + 0.1, 2.0)]
            guess, width = min(tried, key=lambda solution: solution.criterion).log_lambda, 1.0
        else:
            relative = smoothing / (self.curve.step**5 * self.scale)
            guess, width = float(np.clip(np.log10(relative) - _SMOOTHER, low + 0.5, high - 0.5)), 0.5
        left, middle, right = (self.solve(guess + side).criterion for side in (-width, 0.0, width))
        # The vertex of the parabola through three places; downhill where there is none.
        bend, slope = left - 2.0 * middle + right, 0.5 * (right - left)
        move = -slope / bend if bend > abs(slope) else -np.sign(slope)
        return self.solve(float(np.clip(guess + width * move, low, high)) + _SMOOTHER)
