"""Eigenvalues and eigenvectors of many symmetric 3 x 3 matrices in closed form.

Five times faster than `numpy.linalg.eigh`, and good to about 1e-8 of the largest eigenvalue: enough to find directions,
not to measure residuals.
"""

from __future__ import annotations

import numpy as np

from dlogen.model import Array


def eigenvalues(matrices: Array) -> Array:
    """Eigenvalues in ascending order: (..., 3, 3) -> (..., 3) (trigonometric solution of the characteristic cubic)."""
    mean, size, angle = _cubic(matrices)
    turns = angle[..., None] + 2.0 * np.pi / 3.0 * np.array([1.0, -1.0, 0.0])
    return mean[..., None] + 2.0 * size[..., None] * np.cos(turns)


def smallest_axes(matrices: Array) -> Array:
    """Unit eigenvectors of the smallest eigenvalues: (N, 3, 3) -> (N, 3).

    Where the smallest eigenvalue is not apart from the next, any vector may come out. Those of the largest are
    `smallest_axes(-matrices)`.
    """
    mean, size, angle = _cubic(matrices)
    smallest = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    a, b, c = (matrices[:, i, i] - smallest for i in range(3))
    d, e, f = matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2]
    # The rows of A - lambda I span the plane across the vector: take the largest of their cross products.
    products = np.stack(
        [
            np.stack([d * f - e * b, e * d - a * f, a * b - d * d], axis=1),
            np.stack([d * c - e * f, e * e - a * c, a * f - d * e], axis=1),
            np.stack([b * c - f * f, f * e - d * c, d * f - b * e], axis=1),
        ],
        axis=1,
    )
    squared = np.einsum("nij,nij->ni", products, products)
    each, best = np.arange(len(matrices)), np.argmax(squared, axis=1)
    norm = np.sqrt(squared[each, best])
    axis: Array = products[each, best] / np.maximum(norm, 1e-300)[:, None]
    axis[norm == 0.0] = (0.0, 0.0, 1.0)
    return axis


def _cubic(matrices: Array) -> tuple[Array, Array, Array]:
    """Mean of the eigenvalues, their spread, and the angle of the largest in the trigonometric solution."""
    a, b, c = matrices[..., 0, 0], matrices[..., 1, 1], matrices[..., 2, 2]
    d, e, f = matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2]
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    size = np.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    det = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    half = np.clip(det / np.maximum(2.0 * size**3, 1e-300), -1.0, 1.0)
    return mean, size, np.arccos(half) / 3.0
