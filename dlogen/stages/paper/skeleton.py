"""The skeleton line by ridge regression on radial basis functions (paper III.C, Eq. 7-11)."""

from __future__ import annotations

import numpy as np

from dlogen.config.defaults import N_PER_TAU, PAPER_SIZE
from dlogen.errors import FitError
from dlogen.geometry.arc_length import arc_length
from dlogen.geometry.basis import InverseQuadratic
from dlogen.types import Array, Basis, Skeleton

#: Candidates for `beta: auto`.
_BETAS = np.logspace(-8, 2, 61)


def paper_basis(size: int | None = None, tau: float | None = None) -> InverseQuadratic:
    """The basis of Eq. 8 with the paper's N = 21 and tau = N / 4 (IV.B prints "k = N/4") unless given."""
    size = size or PAPER_SIZE
    return InverseQuadratic(size, tau if tau is not None else size / N_PER_TAU)


def choose_beta(basis: Basis, points: Array, s: Array) -> float:
    """The regularisation beta that minimises the variance of the residuals of points left out.

    The paper chooses beta "to minimize the variance of the residuals". On the points of the fit itself that is
    beta = 0 always; the residuals of left-out points are meant, here by generalised cross-validation
    (Golub, Heath and Wahba 1979): sum |e|^2 / (M - trace of the hat matrix)^2.

    Args:
        basis: N basis functions.
        points: (M, 3) sorted points, metres, as they will be fitted: the ridge, and so the best beta, depends on
            where the origin is.
        s: (M,) their coordinates in [0, 1].
    """
    phi = basis(s)
    # In the eigenvectors of Phi^T Phi the residuals for every beta come at once.
    values, vectors = np.linalg.eigh(phi.T @ phi)
    values = np.maximum(values, 0.0)
    energy = np.sum((vectors.T @ (phi.T @ points)) ** 2, axis=1)
    shrink = values / (values + _BETAS[:, None])
    explained = ((2.0 - shrink) / (values + _BETAS[:, None])) @ energy
    residual = np.maximum(float(np.sum(points**2)) - explained, 0.0)
    freedom = np.maximum(len(points) - shrink.sum(axis=1), 1.0)
    return float(_BETAS[np.argmin(residual / freedom**2)])


def fit_skeleton(points: Array, s: Array, basis: Basis, beta: float) -> Skeleton:
    """The weights of the basis functions by ridge regression: W = (Phi^T Phi + beta I)^-1 Phi^T Y (Eq. 11).

    Eq. 10 as printed leads to 2 beta; Eq. 11 is what the paper used.

    Args:
        points: (M, 3) sorted, projected points, metres, near the origin (the ridge pulls weights towards zero).
        s: (M,) their coordinates in [0, 1].
        basis: N basis functions.
        beta: the L2 regularisation.

    Returns:
        The skeleton line over s in [0, 1].

    Raises:
        FitError: the system cannot be solved.
    """
    phi = basis(s)
    normal = phi.T @ phi + beta * np.eye(basis.size)
    try:
        weights = np.linalg.solve(normal, phi.T @ points)
    except np.linalg.LinAlgError:
        weights = np.full((basis.size, 3), np.nan)
    if not np.isfinite(weights).all():
        raise FitError(
            f"{len(points)} points do not determine {basis.size} basis functions",
            "lower N or raise beta",
            stage="skeleton",
        )
    line = Skeleton(basis, weights, np.zeros(3), 0.0)
    return Skeleton(basis, weights, np.zeros(3), arc_length(line))
