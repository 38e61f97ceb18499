"""Chains with known joints."""

from __future__ import annotations

import numpy as np

from dlogen.stages.chain import build_chain
from dlogen.types import Chain, Joints


def chain_of(points: np.ndarray, radius: float = 0.01) -> Chain:
    """The chain through these joints, (n + 1, 3)."""
    points = np.asarray(points, dtype=float)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    joints = Joints(np.linspace(0, 1, len(points)), points, float(lengths[0]), float(lengths[-1]))
    return build_chain(joints, radius)


def arc(count: int, length: float, bend: float, radius: float = 0.01) -> Chain:
    """Equal segments in a plane, each turned by `bend` against the one before."""
    angle = bend * np.arange(count)
    steps = length * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    return chain_of(np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), radius)


def random_chain(seed: int, count: int, bend: float = 0.5) -> Chain:
    """Equal segments but the last, in random directions that differ by up to about `bend` each time."""
    rng = np.random.default_rng(seed)
    directions = np.cumsum(np.vstack([rng.normal(size=3), bend * rng.normal(size=(count - 1, 3))]), axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = np.full(count, 0.05)
    lengths[-1] *= rng.uniform(0.1, 1.0)
    start = rng.normal(size=3)
    return chain_of(np.vstack([start, start + np.cumsum(lengths[:, None] * directions, axis=0)]))


def straightened(chain: Chain) -> np.ndarray:
    """The joints when the chain is straight along its first segment."""
    along = np.concatenate([[0.0], np.cumsum(chain.lengths)])
    return chain.joints[0] + along[:, None] * chain.transforms[0, :3, 0]
