"""Eigenvalues and eigenvectors of many symmetric 3 x 3 matrices in closed form.

Ten times faster than `numpy.linalg.eigh`, and good to about 1e-8 of the largest eigenvalue: enough to find directions,
not to measure residuals. Matrices come as their six entries xx, xy, yy, xz, yz, zz along the first axis.
"""

from __future__ import annotations

import numpy as np

from dlogen.types import Array


def products(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
    """The six entries of the matrices v v^T of vectors v = (x, y, z)."""
    return x * x, x * y, y * y, x * z, y * z, z * z


def eigenvalues(entries: Array) -> Array:
    """Eigenvalues in ascending order: (6, ...) -> (3, ...) (trigonometric solution of the characteristic cubic)."""
    mean, size, angle = _cubic(entries)
    third = 2.0 * np.pi / 3.0
    return mean + 2.0 * size * np.cos(np.stack([angle + third, angle - third, angle]))


def smallest_axes(entries: Array) -> Array:
    """Unit eigenvectors of the smallest eigenvalues: (6, N) -> (N, 3).

    Where the smallest eigenvalue is not apart from the next, any vector may come out. Those of the largest are
    `smallest_axes(-entries)`.
    """
    mean, size, angle = _cubic(entries)
    smallest = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    xx, xy, yy, xz, yz, zz = entries
    xx, yy, zz = xx - smallest, yy - smallest, zz - smallest
    # The columns of the adjugate of A - lambda I are multiples of the vector: take the largest.
    a, b, c = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    d, e, f = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    dd, ee, ff = d * d, e * e, f * f
    first, second, third = a * a + dd + ee, dd + b * b + ff, ee + ff + c * c
    by_second, by_third = second > first, third > np.maximum(first, second)
    axis = np.stack([a, d, e], axis=1)
    axis[by_second] = np.stack([d, b, f], axis=1)[by_second]
    axis[by_third] = np.stack([e, f, c], axis=1)[by_third]
    norm = np.sqrt(np.maximum(np.maximum(first, second), third))
    axis /= np.maximum(norm, 1e-300)[:, None]
    axis[norm == 0.0] = (0.0, 0.0, 1.0)
    return axis


def _cubic(entries: Array) -> tuple[Array, Array, Array]:
    """Mean of the eigenvalues, their spread, and the angle of the largest in the trigonometric solution."""
    xx, xy, yy, xz, yz, zz = entries
    mean = (xx + yy + zz) / 3.0
    xx, yy, zz = xx - mean, yy - mean, zz - mean
    size = np.sqrt((xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    half = np.clip(det / np.maximum(2.0 * size * size * size, 1e-300), -1.0, 1.0)
    return mean, size, np.arccos(half) / 3.0
