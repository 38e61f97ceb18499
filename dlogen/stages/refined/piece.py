"""A stretch of the centre line in order, and how it goes on beyond its ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.geometry.polyline import arc_lengths, segment_lengths
from dlogen.geometry.vectors import unit
from dlogen.types import Array


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the centre line in order.

    Attributes:
        points: (K, 3) about one radius apart, metres.
        weight: (K,) number of surface points that each stands for.
    """

    points: Array
    weight: Array

    @property
    def length(self) -> float:
        """Metres."""
        return float(segment_lengths(self.points).sum())

    @property
    def end_densities(self) -> tuple[float, float]:
        """Surface points per metre near the first and near the last end."""
        along = arc_lengths(self.points)
        few = min(6, len(along) - 1)
        return (
            float(self.weight[: few + 1].sum() / max(along[few], 1e-300)),
            float(self.weight[-few - 1 :].sum() / max(along[-1] - along[-few - 1], 1e-300)),
        )

    @property
    def density(self) -> float:
        """Surface points per metre."""
        return float(self.weight.sum()) / max(self.length, 1e-300)


def end_direction(points: Array, radius: float) -> Array:
    """Unit direction out of the first end of a polyline: (K, 3) -> (3,)."""
    return parabola(points, 0.0, radius)[1]


def parabola(points: Array, at: float, radius: float) -> tuple[Array, Array]:
    """Point and outward direction at a distance from the first end, from a parabola through the first six radii."""
    along = arc_lengths(points)
    fitted = points[: max(int(np.searchsorted(along, 6.0 * radius)), 3)]
    along = along[: len(fitted)]
    degree = 2 if len(fitted) >= 5 else 1
    powers = along[:, None] ** np.arange(degree + 1)
    coefficients = np.linalg.lstsq(powers, fitted, rcond=None)[0]
    at = min(at, 0.5 * float(along[-1]))
    slope = coefficients[1] + (2.0 * at * coefficients[2] if degree == 2 else 0.0)
    return at ** np.arange(degree + 1) @ coefficients, unit(-slope)
