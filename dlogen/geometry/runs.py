"""Runs: stretches of a row of truth values that are true without a break."""

from __future__ import annotations

import numpy as np

from dlogen.types import BoolArray, IntArray


def runs(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """Where the runs of a row begin, and where they have ended (one beyond the last): (M,) -> (R,), (R,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return edges[::2], edges[1::2]
