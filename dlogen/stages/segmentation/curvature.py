"""Curvature of the skeleton line and the segment length that the error allows (paper III.D, Eq. 16-17)."""

from __future__ import annotations

import math

import numpy as np

from dlogen.types import Array, Skeleton


def curvature(line: Skeleton, s: Array) -> Array:
    """kappa = |f' x f''| / |f'|^3 (Eq. 16).

    Args:
        line: the skeleton line.
        s: (K,) coordinates.

    Returns:
        (K,) curvatures, 1/m.
    """
    first, second = line(s, 1), line(s, 2)
    speed = np.linalg.norm(first, axis=1)
    bend = np.linalg.norm(np.cross(first, second), axis=1)
    result: Array = bend / np.maximum(speed, 1e-12 * max(line.length, 1e-300)) ** 3
    return result


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


def max_segment_length(e_max: float, bend_radius: float) -> float:
    """The longest chord whose distance to an arc of that radius stays within e_max (Eq. 17).

    l = 2 sqrt(r_k^2 - (e_max - r_k)^2), written as 2 sqrt(e_max (2 r_k - e_max)), which does not cancel. It holds for
    e_max <= r_k; beyond it every chord of the circle is allowed, and the longest one is its diameter.

    Args:
        e_max: largest allowed distance, metres, > 0.
        bend_radius: smallest radius of curvature r_k, metres; infinite for a straight line.

    Returns:
        The length, metres; infinite for a straight line.
    """
    if math.isinf(bend_radius):
        return math.inf
    if e_max >= bend_radius:
        return 2.0 * bend_radius
    return 2.0 * math.sqrt(e_max * (2.0 * bend_radius - e_max))
