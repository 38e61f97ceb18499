"""Uniform cubic B-splines by the place within an interval, for whole arrays of places at once.

`dlogen.geometry.basis.CubicBSpline` has the same functions with their derivatives over the whole line. The two stay
apart: the tube fit evaluates them for every point in every step, and products take three quarters of the time of the
powers there. The two round differently: with either in both places all lines differ in their last digits (measured).
"""

from __future__ import annotations

import numpy as np

from dlogen.types import Array

#: Monomial coefficients of the four B-splines of an interval: row p holds the coefficients of t^p.
MONOMIALS = np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0

#: Third differences of the coefficients are the third derivative, where an interval is one unit long.
THIRD_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])


def spline_values(t: Array) -> Array:
    """The four B-splines that are not zero at t in [0, 1] of an interval: (K,) -> (4, K)."""
    u = 1.0 - t
    t2, u2 = t * t, u * u
    values = np.stack([u2 * u, (3.0 * t - 6.0) * t2 + 4.0, (3.0 * u - 6.0) * u2 + 4.0, t2 * t])
    values /= 6.0
    return values
