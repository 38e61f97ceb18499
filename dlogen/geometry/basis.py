"""Basis functions phi_j(s) of the skeleton line (paper III.C, Eq. 7-8), with the derivatives that Eq. 16 needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.types import Array
from dlogen.types.line import Basis


@dataclass(frozen=True)
class InverseQuadratic:
    """phi_j(s) = 1 / (1 + tau^2 (s - mu_j)^2), centres mu_j evenly spaced in [0, 1] (Eq. 8).

    Args:
        size: N, the number of functions.
        tau: the width parameter; the paper's evaluation uses tau = N / 4 (printed there as k).
    """

    size: int
    tau: float

    @property
    def margin(self) -> float:
        """The distance of two centres.

        There the functions on one side are missing; with the ridge of Eq. 11 even exact points of the paper's curves
        come out with curvatures at the ends that are a multiple of the largest true one. The paper's Fig. 9 shows none
        of that: its maximum is at s = 0.33.
        """
        return 1.0 / (self.size - 1) if self.size > 1 else 0.0

    @property
    def centres(self) -> Array:
        """(N,) the centres mu_j."""
        return np.linspace(0.0, 1.0, self.size) if self.size > 1 else np.array([0.5])

    def __call__(self, s: Array, derivative: int = 0) -> Array:
        """Values or derivatives up to the third: (K,) -> (K, N)."""
        t = self.tau * (np.asarray(s, dtype=float)[:, None] - self.centres)
        q = 1.0 / (1.0 + t * t)
        if derivative == 0:
            return q
        if derivative == 1:
            return -2.0 * self.tau * t * q**2
        if derivative == 2:
            return 2.0 * self.tau**2 * (3.0 * t * t - 1.0) * q**3
        if derivative == 3:
            return 24.0 * self.tau**3 * t * (1.0 - t * t) * q**4
        raise ValueError(f"derivative {derivative} is not available")

    def combine(self, s: Array, weights: Array, derivative: int = 0) -> Array:
        """See `Basis.combine`."""
        return self(s, derivative) @ weights

    def to_dict(self) -> dict[str, Any]:
        """See `Basis.to_dict`."""
        return {"kind": "inverse-quadratic", "size": self.size, "tau": self.tau}


@dataclass(frozen=True)
class CubicBSpline:
    """Uniform cubic B-splines on [0, 1]: N functions over N - 3 equal intervals, a partition of unity.

    Args:
        size: N >= 4, the number of functions.
    """

    size: int

    @property
    def margin(self) -> float:
        """None: the curvature is that of the data up to the ends."""
        return 0.0

    def __call__(self, s: Array, derivative: int = 0) -> Array:
        """Values or derivatives up to the third: (K,) -> (K, N)."""
        s = np.asarray(s, dtype=float)
        first, local = self.local(s, derivative)
        out = np.zeros((len(s), self.size))
        np.put_along_axis(out, first[:, None] + np.arange(4), local, axis=1)
        return out

    def local(self, s: Array, derivative: int = 0) -> tuple[npt.NDArray[np.intp], Array]:
        """The four functions that are not zero at each s: index of the first (K,), values (K, 4)."""
        intervals = self.size - 3
        x = np.asarray(s, dtype=float) * intervals
        first = np.clip(np.floor(x), 0, intervals - 1).astype(np.intp)
        t = x - first
        u = 1.0 - t
        if derivative == 0:
            parts = (u**3, 3 * t**3 - 6 * t**2 + 4, 3 * u**3 - 6 * u**2 + 4, t**3)
        elif derivative == 1:
            parts = (-3 * u**2, 9 * t**2 - 12 * t, 12 * u - 9 * u**2, 3 * t**2)
        elif derivative == 2:
            parts = (6 * u, 18 * t - 12, 18 * u - 12, 6 * t)
        elif derivative == 3:
            parts = (
                np.full_like(t, -6.0),
                np.full_like(t, 18.0),
                np.full_like(t, -18.0),
                np.full_like(t, 6.0),
            )
        else:
            raise ValueError(f"derivative {derivative} is not available")
        return first, np.stack(parts, axis=1) * (intervals**derivative / 6.0)

    def combine(self, s: Array, weights: Array, derivative: int = 0) -> Array:
        """See `Basis.combine`; touches only the four functions that are not zero."""
        first, local = self.local(s, derivative)
        return sum((local[:, j, None] * weights[first + j] for j in range(1, 4)), local[:, 0, None] * weights[first])

    def to_dict(self) -> dict[str, Any]:
        """See `Basis.to_dict`."""
        return {"kind": "cubic-b-spline", "size": self.size, "knots": "uniform on [0, 1]"}


def basis_from_dict(data: dict[str, Any]) -> Basis:
    """The basis that `to_dict` wrote.

    Raises:
        ValueError: the kind is not known.
    """
    kind = data.get("kind")
    if kind == "inverse-quadratic":
        return InverseQuadratic(int(data["size"]), float(data["tau"]))
    if kind == "cubic-b-spline":
        return CubicBSpline(int(data["size"]))
    raise ValueError(f"unknown basis {kind!r}")
