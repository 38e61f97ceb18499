"""Many vectors at once: scalar products, unit vectors, normals, places as plain numbers.

Rows are (..., 3), as points come. Columns are (3, ...), as the inner loops have them: every sum over a coordinate then
runs over contiguous numbers, which is three times as fast.
"""

from __future__ import annotations

import numpy as np

from dlogen.types import Array


def dots(a: Array, b: Array) -> Array:
    """Scalar products of rows: (..., 3), (..., 3) -> (...,); the two broadcast."""
    product: Array = np.einsum("...i,...i->...", a, b)
    return product


def column_dots(a: Array, b: Array) -> Array:
    """Scalar products of columns: (3, ...), (3, ...) -> (...,)."""
    product: Array = np.einsum("i...,i...->...", a, b)
    return product


def unit(vectors: Array, least: float = 1e-300) -> Array:
    """Unit vectors along rows: (..., 3) -> (..., 3). A vector of no length stays what it is.

    Args:
        vectors: of any length.
        least: lengths below this are taken for it, so that what is only rounding gets no direction.
    """
    result: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), least)
    return result


def normals_to(directions: Array) -> Array:
    """A unit vector across each unit vector, in the plane across the coordinate axis that is least along it: (P, 3)."""
    return unit(np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=-1)]))


def as_place(point: Array) -> tuple[float, float, float]:
    """A point (3,) as three plain numbers, as results and findings have places."""
    x, y, z = point.tolist()
    return x, y, z
