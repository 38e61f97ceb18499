"""Curves that nodes are put on, and nodes on them."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def even(curve: Array, count: int) -> Array:
    """Points of a dense polyline, even in arc length."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    s = np.r_[0.0, np.cumsum(steps)] / steps.sum()
    return np.stack([np.interp(np.linspace(0, 1, count), s, column) for column in curve.T], axis=1)


T = np.linspace(0.0, 1.0, 20_000)
WAVE = np.c_[1.2 * T, 0.12 * np.sin(6 * T), 0 * T]
HELIX = np.c_[0.1 * np.cos(20 * T), 0.1 * np.sin(20 * T), 0.5 * T]
U = 2 * np.pi * (0.9 * T + 0.05)
EIGHT = np.c_[0.3 * np.sin(U), 0.15 * np.sin(2 * U), 0.003 * T]
HOOK = np.c_[0.3 * np.minimum(T, 0.5), 0.02 * np.sin(np.pi * T), 0.1 * np.maximum(T - 0.5, 0)]
