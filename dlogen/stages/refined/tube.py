"""The tube that is fitted, and robust statistics of the distances to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.stages.refined.linearisation import Solution
from dlogen.stages.refined.tube_curve import (
    TubeCurve,
)
from dlogen.types import Array, BoolArray

#: Tukey's biweight constant: 98 % efficiency for Gaussian noise; strays are rarely so near the surface.
_TUKEY = 6.0


@dataclass(frozen=True, eq=False)
class Tube:
    """A tube around a curve, with the points around it.

    Attributes:
        curve: the axis.
        radius: of the tube, metres; the points' mean distance to the axis is larger, see `expected_distance`.
        sigma: standard deviation of the distances of the points to the tube's surface, metres.
        x: (M,) foot parameters of the points.
        distance: (M,) distances of the points to the axis, metres.
        smoothing: see `Solution`; None as long as it is not known.
        solution: the last step of the fit, for covariances.
        solid: the axis was fitted to the points themselves, since noise of the size of the radius hides the surface.
        shared: how many points are worth one independent one, since neighbours share their noise.
    """

    curve: TubeCurve
    radius: float
    sigma: float
    x: Array
    distance: Array
    smoothing: float | None = None
    solution: Solution | None = None
    solid: bool = False
    shared: float = 1.0

    @property
    def residual(self) -> Array:
        """(M,) distance of each point to the axis less its expectation, metres."""
        return self.distance - expected_distance(self.radius, self.sigma)

    @property
    def on_curve(self) -> BoolArray:
        """(M,) whether the foot point is not just the end of the curve."""
        return (self.x > 0.0) & (self.x < self.curve.intervals)


def expected_distance(radius: float, sigma: float) -> float:
    """Mean distance of noisy points of a tube to its axis: r + sigma^2 / (2 r), to second order.

    Noise across the radius moves a point outward, on average by sigma^2 / (2 r). It is the bias of every geometric
    circle fit, the same on whole circles and on arcs (Al-Sharadqah and Chernov 2009).

    Args:
        radius: metres.
        sigma: standard deviation of the distances, metres.
    """
    return radius + 0.5 * _noise_variance(radius, sigma) / radius


def _noise_variance(radius: float, sigma: float) -> float:
    """Variance v of each coordinate, from the one of the distances: sigma^2 = v - v^2 / (2 r^2) (Rice)."""
    ratio = min(2.0 * sigma**2 / radius**2, 1.0)
    return radius**2 * (1.0 - float(np.sqrt(1.0 - ratio)))


def robust_scale(residual: Array) -> float:
    """Standard deviation of the Gaussian core: 1.4826 times the median absolute residual."""
    return 1.4826 * median(np.abs(residual))


def median(values: Array) -> float:
    """The median, of an even number the upper one of the middle two: a third of the time of numpy's."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def tukey(residual: Array, scale: float) -> Array:
    """Tukey's biweight: (M,) weights in [0, 1], 0 beyond 6 scales."""
    z = np.minimum(np.abs(residual) / (_TUKEY * scale), 1.0)
    weight = 1.0 - z * z
    return weight * weight
