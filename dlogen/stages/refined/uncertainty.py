"""How well a fitted line is known, along it: from the covariance of its coefficients."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.spline import spline_values
from dlogen.geometry.vectors import dots, unit
from dlogen.stages.refined.linearisation import Solution
from dlogen.stages.refined.tube_curve import TubeCurve
from dlogen.types import Array, Uncertainty

#: Places along a line where it is looked at.
PLACES = 51


def line_uncertainty(curve: TubeCurve, solution: Solution, scale: float, x: Array, radius_std: float) -> Uncertainty:
    """Standard deviations of position and curvature at places of a curve.

    Args:
        curve: the fitted one.
        solution: of its last step, with the weights that correlated noise leaves.
        scale: standard deviation of an observation of weight one, metres.
        x: (K,) parameters of the places, from the first end to the last.
        radius_std: of the radius, metres.
    """
    k = np.clip(x.astype(np.intp), 0, curve.intervals - 1)
    t = x - k
    tangent, second = unit(curve(x, 1)), curve(x, 2)
    bent = second - dots(second, tangent)[:, None] * tangent
    # Where it is straight, any direction across will do.
    normal = unit(np.where(np.linalg.norm(bent, axis=1)[:, None] > 1e-9, bent, _across(tangent)))
    binormal = np.cross(tangent, normal)
    values = spline_values(t)
    # Second derivatives of the four basis functions, in lengths.
    bends = np.stack([1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t]) / curve.step**2
    variances = [
        solution.variances(_rows(k, weights, direction, curve.coefficients.size))
        for weights, direction in ((values, normal), (values, binormal), (bends, normal))
    ]
    position, sideways, bend = (scale * np.sqrt(np.maximum(variance, 0.0)) for variance in variances)
    s = np.linspace(0.0, 1.0, len(x))
    return Uncertainty(s, np.maximum(position, sideways), bend, radius_std)


def _across(tangent: Array) -> Array:
    return np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent), axis=1)])


def _rows(k: np.ndarray, weights: Array, direction: Array, size: int) -> Array:
    """(K, 3 N) what the coefficients have to be multiplied with: (4, K) weights of four of them, (K, 3) directions."""
    rows = np.zeros((len(k), size))
    place = np.arange(len(k))
    for q in range(4):
        for c in range(3):
            rows[place, 3 * (k + q) + c] = weights[q] * direction[:, c]
    return rows
