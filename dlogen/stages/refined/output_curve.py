"""The fitted curve as it is given out: with as few basis functions as follow it, and how sure its bends are."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.curvature import curvature_of
from dlogen.geometry.vectors import unit
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import TubeCurve, arc_table, reparametrised

#: Deviation of the output's basis functions from the fitted curve, in radii, and of its curvature, relative.
_DEVIATION, _BEND_DEVIATION = 1e-4, 0.01


#: Places in every interval where the curvature is looked at.
_CURVATURES = 6


#: Deviation of the output's parameter from arc length, relative to the length.
_UNEVEN = 5e-5


def sufficient_spacing(curve: TubeCurve, radius: float) -> float:
    """Distance of knots with which a spline follows a curve, metres."""
    # With knots H apart a cubic spline is off by about D H^4 / 384, and its second derivative by D H^2 / 12, where D
    # is the fourth derivative; that shows in the fourth differences of the coefficients.
    fourth = float(np.linalg.norm(np.diff(curve.coefficients, 4, axis=0), axis=1).max()) / curve.step**4
    fourth = max(fourth, 1e-12 / radius**3)
    bend = float(curve.curvature(np.array([0.5])).max())
    by_deviation: float = (384.0 * _DEVIATION * radius / fourth) ** 0.25
    by_bend: float = (12.0 * _BEND_DEVIATION * bend / fourth) ** 0.5
    return min(by_deviation, by_bend)


def output_curve(curve: TubeCurve, start: float, end: float, radius: float) -> TubeCurve:
    """The curve between two arc lengths, with as few intervals as follow it."""
    spacing = sufficient_spacing(curve, radius)
    most = 2 * curve.intervals
    intervals = int(np.clip(np.ceil((end - start) / max(spacing, 0.5 * curve.step)), 4, most))
    while True:
        moved = reparametrised(curve, intervals, start, end)
        grid, arc, _ = arc_table(moved)
        uneven = float(np.abs(arc / arc[-1] - grid / grid[-1]).max())
        if uneven < _UNEVEN or intervals >= most:
            return moved
        intervals = min(2 * intervals, most)


def sharpest_bend(curve: TubeCurve) -> tuple[float, float]:
    """The largest curvature, 1/m, and where it is, in [0, 1]."""
    places = (np.arange(_CURVATURES) + 0.5) / _CURVATURES
    best = int(np.argmax(curve.curvature(places)))
    fine = np.clip((best + np.linspace(-0.5, 1.5, 41)) / _CURVATURES, 0.0, curve.intervals)
    bend = curvature_of(curve(fine, 1), curve(fine, 2))
    peak = int(np.argmax(bend))
    return float(bend[peak]), float(fine[peak]) / curve.intervals


def curvature_std(tube: Tube, x: float) -> float:
    """Standard deviation of the curvature at a place of the curve, from the posterior covariance."""
    curve = tube.curve
    if tube.solution is None:
        return 0.0
    k = min(int(x), curve.intervals - 1)
    t = x - k
    tangent, second = curve(np.array([x]), 1)[0], curve(np.array([x]), 2)[0]
    normal = second - tangent * (tangent @ second) / (tangent @ tangent)
    normal = unit(normal)
    row = np.zeros((1, curve.coefficients.size))
    row[0, 3 * k : 3 * k + 12] = np.outer([1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t], normal).ravel() / curve.step**2
    return tube.sigma * float(np.sqrt(tube.solution.covariance(row)[0, 0]))
