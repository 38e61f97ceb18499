"""Frames along a curve that turn no more than they must (parallel transport)."""

from __future__ import annotations

import math

import numpy as np

from dlogen.geometry.vectors import dots
from dlogen.types import Array


def minimal_rotation_frames(tangents: Array) -> Array:
    """Frames whose x axes are the tangents and which turn from one to the next without twist.

    The first frame's z axis is as near to the world's z axis as it can be (to the world's x axis for a vertical one).

    Args:
        tangents: (n, 3) unit vectors.

    Returns:
        (n, 3, 3) rotation matrices, columns x, y, z.
    """
    x0, x = tangents[:-1], tangents[1:]
    up = np.array([0.0, 0.0, 1.0]) if abs(tangents[0, 2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    y = np.cross(up, tangents[0])
    y /= np.linalg.norm(y)
    # The rotation of x0 into x about their common normal (Rodrigues) takes y to y - (x . y) (x0 + x) / (1 + x0 . x).
    cosine = dots(x0, x)[:, None]
    turned = cosine > -1.0 + 1e-12
    halfway = np.where(turned, (x0 + x) / np.where(turned, 1.0 + cosine, 1.0), 0.0)
    # One after another, with plain numbers: for three of them an array takes ten times as long.
    across = [y.tolist()]
    still = (x0 == x).all(axis=1).tolist()
    for (ax, ay, az), (bx, by, bz), unturned in zip(x.tolist(), halfway.tolist(), still, strict=True):
        if unturned:
            # The same frame, to the last bit.
            across.append(across[-1])
            continue
        px, py, pz = across[-1]
        shift = ax * px + ay * py + az * pz
        px, py, pz = px - shift * bx, py - shift * by, pz - shift * bz
        # Rounding must not add up along long chains.
        along = ax * px + ay * py + az * pz
        px, py, pz = px - along * ax, py - along * ay, pz - along * az
        size = math.sqrt(px * px + py * py + pz * pz)
        across.append([px / size, py / size, pz / size])
    sideways = np.array(across)
    return np.stack([tangents, sideways, np.cross(tangents, sideways)], axis=2)
