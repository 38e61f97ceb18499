"""Points near an end of a tube that lie on another part of it."""

from __future__ import annotations

import numpy as np

from dlogen.stages.refined.shared_ends import shared_at_ends
from dlogen.stages.refined.tube import Tube
from dlogen.stages.refined.tube_curve import foot_points, from_polyline, nearest
from dlogen.types import Array, BoolArray

RADIUS = 0.01


def shared(line: Array, points: Array) -> BoolArray:
    """Of points (M, 3) and a tube around vertices (K, 3)."""
    curve = from_polyline(line, RADIUS, 0.0, 1e-3)
    columns = np.ascontiguousarray(points.T)
    x, _, _, offset = foot_points(curve, columns, nearest(curve, columns, 0.5 * RADIUS), 3)
    return shared_at_ends(columns, Tube(curve, RADIUS, 5e-4, x, np.linalg.norm(offset, axis=0)))


def test_only_the_end_that_touches_another_strand_shares_points_with_it() -> None:
    straight = np.stack([np.linspace(0.0, 0.4, 81), np.zeros(81), np.zeros(81)], axis=1)
    t = np.linspace(0.0, np.pi, 60)[1:]
    turn = np.stack([0.4 + 0.06 * np.sin(t), 0.06 * (1.0 - np.cos(t)), np.zeros(59)], axis=1)
    back = np.stack([np.linspace(0.4, 0.2, 41)[1:], np.linspace(0.12, 0.02, 41)[1:], np.zeros(40)], axis=1)
    line = np.concatenate([straight, turn, back])
    tip = line[-1]
    between = tip - np.array([0.0, 0.85 * RADIUS, 0.0])  # touches the straight strand
    far_side = tip + np.array([0.0, RADIUS, 0.0])
    other_end = np.array([0.002, RADIUS, 0.0])
    assert shared(line, np.stack([between, far_side, other_end])).tolist() == [True, False, False]


def test_a_line_that_does_not_come_back_shares_nothing() -> None:
    line = np.stack([np.linspace(0.0, 0.4, 81), np.zeros(81), np.zeros(81)], axis=1)
    around = line[::4] + np.array([0.0, RADIUS, 0.0])
    assert not shared(line, around).any()
