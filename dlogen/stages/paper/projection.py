"""Projection of the surface points to the centre line (paper III.B, Eq. 4)."""

from __future__ import annotations

from dlogen.types import Array


def project(points: Array, normals: Array, radius: float) -> Array:
    """Move each point inwards by the radius: p_p = p - r n (Eq. 4).

    Args:
        points: (M, 3) surface points, metres.
        normals: (M, 3) outward unit normals.
        radius: r, metres.

    Returns:
        (M, 3) points near the centre line, metres.
    """
    return points - radius * normals
