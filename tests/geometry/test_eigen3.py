"""Closed-form eigenvalues and eigenvectors against numpy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dlogen.geometry.eigen3 import eigenvalues, products, smallest_axes


def _matrices(seed, spread=1.0):
    rng = np.random.default_rng(seed)
    vectors = np.linalg.qr(rng.normal(size=(50, 3, 3)))[0]
    values = np.sort(rng.uniform(size=(50, 3)) * spread, axis=1)
    return np.einsum("nij,nj,nkj->nik", vectors, values, vectors)


def _entries(matrices):
    return matrices[:, [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]].T


@given(st.integers(0, 10**6))
def test_eigenvalues(seed):
    matrices = _matrices(seed)
    np.testing.assert_allclose(eigenvalues(_entries(matrices)).T, np.linalg.eigvalsh(matrices), atol=1e-7)


@given(st.integers(0, 10**6))
def test_axes_are_eigenvectors(seed):
    matrices = _matrices(seed)
    for sign, at in ((1.0, 0), (-1.0, 2)):
        axes = smallest_axes(_entries(sign * matrices))
        values = np.linalg.eigvalsh(matrices)[:, at]
        np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0)
        gaps = np.abs(values - np.linalg.eigvalsh(matrices)[:, 1])
        residual = np.linalg.norm(np.einsum("nij,nj->ni", matrices, axes) - values[:, None] * axes, axis=1)
        assert (residual[gaps > 0.02] < 1e-5).all()


def test_degenerate_matrices_give_unit_vectors():
    matrices = np.stack([np.zeros((3, 3)), np.eye(3), np.diag([1.0, 0.0, 0.0]), np.diag([1.0, 1.0, 0.0])])
    np.testing.assert_allclose(np.linalg.norm(smallest_axes(_entries(matrices)), axis=1), 1.0)
    np.testing.assert_allclose(np.abs(smallest_axes(_entries(matrices))[3]), [0.0, 0.0, 1.0])


def test_axes_of_a_thin_line():
    direction = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    covariance = np.outer(direction, direction) + 1e-10 * np.eye(3)
    assert abs(smallest_axes(_entries(-covariance[None]))[0] @ direction) > 1.0 - 1e-12


@given(st.integers(0, 10**6))
def test_products_are_the_entries_of_outer_products(seed):
    vectors = np.random.default_rng(seed).normal(size=(7, 3))
    outer = vectors[:, :, None] * vectors[:, None, :]
    np.testing.assert_array_equal(np.stack(products(*vectors.T)), _entries(outer))
