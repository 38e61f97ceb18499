"""The segment length that the error allows (paper III.D, Eq. 17)."""

from __future__ import annotations

import math


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
