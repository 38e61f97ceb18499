"""Chains with joints beside the line."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import random_centre_line
from dlogen.geometry.polyline import hausdorff
from dlogen.stages.chain import deviation
from dlogen.stages.segmentation.curve_table import CurveTable
from dlogen.stages.segmentation.fewest_segments import fewest_segments
from dlogen.stages.segmentation.minimax import minimax_joints


@pytest.fixture(scope="module", params=range(6))
def found(request, fitted):
    """A line, e_max, segments with the joints on it, and what the search finds."""
    line = fitted(random_centre_line(request.param, dimensions=2 + request.param % 2))
    table = CurveTable(line)
    most = fewest_segments(table, 0.008, 0.02).count
    return line, 0.008, most, minimax_joints(table, 0.008, most)


def test_it_is_a_chain_within_e_max(found) -> None:
    line, e_max, most, minimax = found
    joints = minimax.joints
    assert joints is not None
    assert 0.6 * most < len(joints.s) - 1 < 0.9 * most
    chords = np.linalg.norm(np.diff(joints.positions, axis=0), axis=1)
    assert np.ptp(chords[:-1]) < 1e-9
    assert chords[-1] <= chords[0] + 1e-9
    assert joints.segment_length == pytest.approx(chords[0], abs=1e-12)
    assert joints.last_segment_length == pytest.approx(chords[-1], abs=1e-12)
    assert (joints.positions[[0, -1]] == line([0.0, 1.0])).all()
    assert deviation(line, joints)[0] <= e_max


def test_s_is_the_nearest_place_in_order(found) -> None:
    line, e_max, _, minimax = found
    joints = minimax.joints
    assert (np.diff(joints.s) > 0).all()
    for s, joint in zip(joints.s[1:-1], joints.positions[1:-1], strict=True):
        around = line(s + np.linspace(-0.02, 0.02, 401))
        distance = np.linalg.norm(around - joint, axis=1)
        assert distance.min() >= np.linalg.norm(line(s) - joint) * (1 - 1e-6) - 1e-12
        assert distance[200] <= e_max


def test_the_line_runs_on_both_sides(circle) -> None:
    # An arc about the origin: joints outside of it, segments' middles inside, by the same.
    line = circle(0.5, 4.0)
    table = CurveTable(line)
    joints = minimax_joints(table, 0.003, fewest_segments(table, 0.003, 0.05).count).joints
    middles = 0.5 * (joints.positions[1:] + joints.positions[:-1])
    outside = np.linalg.norm(joints.positions, axis=1)[1:-1] - 0.5
    inside = 0.5 - np.linalg.norm(middles, axis=1)[1:-1]
    assert (outside > 0).all()
    assert (inside > 0).all()
    assert outside.mean() == pytest.approx(inside.mean(), rel=0.3)
    # The plane of the arc is not left.
    assert np.abs(joints.positions[:, 2]).max() < 1e-9


def test_deviation_is_no_less_than_the_hausdorff_distance(found) -> None:
    line, _, _, minimax = found
    chain = minimax.joints.positions
    apart = hausdorff(line(np.linspace(0, 1, 3000)), chain, samples=3000)
    assert apart <= deviation(line, minimax.joints)[0] * (1 + 1e-3)


def test_what_was_tried_is_told(found) -> None:
    _, e_max, _, minimax = found
    count = len(minimax.joints.s) - 1
    assert minimax.tried[count] <= e_max
    assert minimax.tried[count - 1] > e_max


def test_moved_and_turned_it_is_the_same_chain(fitted) -> None:
    truth = random_centre_line(3)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    chains = []
    for move in (lambda p: p, lambda p: p @ turn.T + [3.0, -2.0, 1.0]):
        line = fitted(truth)
        moved = type(line)(line.basis, move(line.weights), line.offset, line.length)
        chains.append(minimax_joints(CurveTable(moved), 0.008, 20).joints.positions)
    # Basis functions that sum up to one carry a motion of the weights over to the line.
    assert chains[1] == pytest.approx(chains[0] @ turn.T + [3.0, -2.0, 1.0], abs=1e-5)


def test_a_line_that_needs_all_its_segments(straight) -> None:
    minimax = minimax_joints(CurveTable(straight([0, 0, 0], [1, 2, 3])), 0.001, 1)
    assert minimax.joints is None
    assert minimax.tried == {}
