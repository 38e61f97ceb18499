"""Curvature of the skeleton line (paper Eq. 16)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dlogen.types import Array, Skeleton


def curvature(line: Skeleton, s: npt.ArrayLike) -> Array:
    """kappa = |f' x f''| / |f'|^3 (Eq. 16).

    Args:
        line: the skeleton line.
        s: a coordinate in [0, 1], or (K,) of them.

    Returns:
        One number or (K,) of them, 1/m.

    Raises:
        ValueError: a coordinate outside of [0, 1].

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> bool(dlogen.curvature(result.skeleton, [0.0, 0.5, 1.0]).max() < 1 / 0.02)
    True
    """
    return curvature_of(line(s, 1), line(s, 2), 1e-12 * max(line.length, 1e-300))


def curvature_of(first: Array, second: Array, least_speed: float = 0.0) -> Array:
    """The same from the first and the second derivative of any curve with respect to any parameter.

    Args:
        first, second: (..., 3) each.
        least_speed: taken for |f'| where that is less, as at a cusp, which has no curvature.

    Returns:
        (...,) curvatures, 1/m.
    """
    speed = np.maximum(np.linalg.norm(first, axis=-1), least_speed)
    bend: Array = np.linalg.norm(np.cross(first, second), axis=-1) / speed**3
    return bend


def max_curvature(line: Skeleton, samples: int = 2001) -> tuple[float, float]:
    """The largest curvature and where it is.

    Samples, then narrows the interval around the largest one. The margins of the basis (`Basis.margin`) are left out.

    Returns:
        (kappa in 1/m, s).
    """
    margin = line.basis.margin
    s = np.linspace(margin, 1.0 - margin, samples)
    values = curvature(line, s)
    best = int(np.argmax(values))
    low, high = s[max(best - 1, 0)], s[min(best + 1, samples - 1)]
    fine = np.linspace(low, high, 41)
    refined = curvature(line, fine)
    peak = int(np.argmax(refined))
    return float(refined[peak]), float(fine[peak])


def tangent(line: Skeleton, s: npt.ArrayLike) -> Array:
    """Unit tangent f' / |f'| of the skeleton line (paper III.A).

    Args:
        line: the skeleton line.
        s: a coordinate in [0, 1], or (K,) of them.

    Returns:
        (3,) or (K, 3).

    Raises:
        ValueError: a coordinate outside of [0, 1].

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("straight", points=2000, seed=1).points)
    >>> dlogen.tangent(result.skeleton, 0.5).round(2).tolist()[:2]
    [-0.29, 0.96]
    """
    along = line(s, 1)
    unit: Array = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return unit
