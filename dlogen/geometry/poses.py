"""Poses as homogeneous transforms (paper Eq. 1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dlogen.types import Array


def pose(rotation: npt.ArrayLike, position: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """The transform x -> rotation x + position.

    Args:
        rotation: (..., 3, 3) rotation matrices.
        position: (..., 3) metres.

    Returns:
        (..., 4, 4)
    """
    rotation = np.asarray(rotation, dtype=float)
    transform = np.zeros((*rotation.shape[:-2], 4, 4))
    transform[..., :3, :3], transform[..., :3, 3], transform[..., 3, 3] = rotation, position, 1.0
    return transform
