"""The search for the fewest segments: against brute force, on circles, and what it may give up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import random_centre_line
from dlogen.geometry.curvature import max_curvature
from dlogen.stages.chain import deviation
from dlogen.stages.segmentation.curve_table import CurveTable
from dlogen.stages.segmentation.fewest_segments import equal_lengths, fewest_segments, lay_chains
from dlogen.stages.segmentation.joints import place_joints
from dlogen.stages.segmentation.segment_length import max_segment_length


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.05, 0.4, 1.5])
def test_fewest_against_brute_force(fitted, seed: int, share: float) -> None:
    line = fitted(random_centre_line(seed, length=0.8))
    e_max = share / max_curvature(line)[0]
    allowed = max_segment_length(e_max, 1 / max_curvature(line)[0])
    found = fewest_segments(CurveTable(line), e_max, allowed)
    # Other code: dense samples of the line, joints by the first sample outside, point by point.
    s = np.linspace(0.0, 1.0, 3001)
    points = line(s)
    best = None
    for length in np.linspace(0.9 * allowed, 1.05 * np.linalg.norm(points - points[0], axis=1).max(), 300):
        at, worst, count = 0, 0.0, 0
        while at < len(s) - 1:
            outside = np.flatnonzero(np.linalg.norm(points[at:] - points[at], axis=1) >= length)
            to = at + int(outside[0]) if len(outside) else len(s) - 1
            axis = points[to] - points[at]
            piece = points[at : to + 1] - points[at]
            t = np.clip(piece @ axis / (axis @ axis), 0.0, 1.0)
            worst = max(worst, float(np.linalg.norm(piece - t[:, None] * axis, axis=1).max()))
            at, count = to, count + 1
        if worst <= e_max and (best is None or (count, -length) < best):
            best = (count, -length)
    assert found is not None
    assert best is not None
    # Brute force can be lucky by its coarse joints (1 in 3000) only.
    joints = place_joints(line, found.length)
    assert deviation(line, joints)[0] <= e_max * (1 + 1e-6)
    assert found.count <= best[0]
    if found.count == best[0] and found.count > 1:
        assert found.length >= -best[1] * (1 - 3e-3)


@pytest.fixture(scope="module")
def tables(fitted) -> list[CurveTable]:
    return [CurveTable(fitted(random_centre_line(seed))) for seed in range(10)]


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 9),
    st.sampled_from([0.002, 0.01, 0.05, 0.1]),
    st.floats(0.9, 2.5),
    st.floats(-4.0, -1.0),
    st.booleans(),
)
def test_no_length_is_given_up_wrongly(tables, i: int, e: float, times: float, width: float, down: bool) -> None:
    table = tables[i]
    first = times * max_segment_length(e, 1 / max_curvature(table.line)[0])
    pair = np.array([first, first * (1 + 10**width)])[:: -1 if down else 1]
    between = lay_chains(table, np.linspace(*pair, 25), np.inf).deviation
    # Asked for a little more than the smallest deviation in between, the interval must stay open.
    assert not lay_chains(table, pair, between.min() * 1.0001).refuted[0]


def test_intervals_are_given_up_at_all(fitted) -> None:
    line = fitted(random_centre_line(1))
    table = CurveTable(line)
    lengths = np.linspace(0.1, 0.11, 40)
    chains = lay_chains(table, lengths, 0.9 * lay_chains(table, lengths, np.inf).deviation.min())
    assert chains.refuted.all()


def chords(angle: float, radius: float, length: float) -> int:
    """How many chords of a length an arc needs."""
    return math.ceil(angle / (2 * math.asin(length / (2 * radius))) - 1e-9)


@pytest.mark.parametrize("e_max", [0.0005, 0.002, 0.01])
def test_on_an_arc_equation_17_is_best(circle, e_max: float) -> None:
    radius, angle = 0.5, 4.0
    table = CurveTable(circle(radius, angle))
    allowed = max_segment_length(e_max, radius)
    found = fewest_segments(table, e_max, 0.8 * allowed)
    assert found is not None
    assert found.count == chords(angle, radius, allowed)
    # No longer chord has a sagitta within e_max.
    assert found.length == pytest.approx(allowed, rel=2e-6)
    assert found.fewer is not None
    assert found.fewer[1] > e_max
    assert chords(angle, radius, found.fewer[0]) == found.count - 1


def test_a_last_segment_that_is_long_enough_is_chosen(circle) -> None:
    radius, angle, e_max = 0.5, 4.0, 0.002
    table = CurveTable(circle(radius, angle))
    allowed = max_segment_length(e_max, radius)
    plain, even = (fewest_segments(table, e_max, 0.8 * allowed, share) for share in (0.0, 0.9))
    assert plain.count == even.count
    assert even.length <= plain.length
    for found, least in ((plain, 0.0), (even, 0.9)):
        step = 2 * math.asin(found.length / (2 * radius))
        rest = angle - (found.count - 1) * step
        assert 2 * radius * math.sin(rest / 2) / found.length >= least - 1e-9
    # To about one in a hundred the longest of those.
    longer = 2 * math.asin(even.length * 1.02 / (2 * radius))
    assert 2 * radius * math.sin((angle - (even.count - 1) * longer) / 2) < 0.9 * even.length * 1.02


def test_a_line_that_one_segment_serves(straight, circle) -> None:
    line = straight([0.1, 0.2, 0.3], [1.1, 0.2, 0.3])
    found = fewest_segments(CurveTable(line), 1e-3, 0.2)
    assert (found.count, found.fewer) == (1, None)
    assert found.length >= 1.0
    # A shallow arc, just within and just outside.
    arc = circle(1.0, 0.4)
    sagitta = 1.0 - math.cos(0.2)
    assert fewest_segments(CurveTable(arc), sagitta * 1.001, 0.1).count == 1
    assert fewest_segments(CurveTable(arc), sagitta * 0.999, 0.1).count == 2


def test_units_do_not_matter(fitted) -> None:
    line = fitted(random_centre_line(4))
    large = type(line)(line.basis, 1e3 * line.weights, 1e3 * line.offset, 1e3 * line.length)
    one, other = fewest_segments(CurveTable(line), 0.005, 0.05), fewest_segments(CurveTable(large), 5.0, 50.0)
    assert other.count == one.count
    assert other.length == pytest.approx(1e3 * one.length, rel=1e-5)


def test_chains_of_several_lengths_on_an_arc(circle) -> None:
    radius, angle = 0.5, 4.0
    lengths = np.array([0.1, 0.2, 0.35])
    chains = lay_chains(CurveTable(circle(radius, angle)), lengths, 1.0)
    for i, length in enumerate(lengths):
        step = 2 * math.asin(length / (2 * radius))
        assert chains.counts[i] == math.ceil(angle / step)
        assert chains.deviation[i] == pytest.approx(radius * (1 - math.cos(step / 2)), rel=1e-5)
        last = angle - (chains.counts[i] - 1) * step
        assert chains.share[i] == pytest.approx(2 * radius * math.sin(last / 2) / length, rel=1e-6)
    assert not chains.refuted.any()


def test_the_best_chain_within_a_deviation(circle) -> None:
    radius = 0.5
    table = CurveTable(circle(radius, 4.0))
    lengths = np.array([0.1, 0.2, 0.21, 0.35])
    chains = lay_chains(table, lengths, 1.0)
    sagittas = radius - np.sqrt(radius**2 - (lengths / 2) ** 2)
    assert chains.best_within(table, 1.01 * sagittas[3]) == 3
    assert chains.best_within(table, 0.99 * sagittas[3]) == 2
    assert chains.best_within(table, 0.99 * sagittas[0]) is None
    # It has to be better than something, among some, or the least by another order.
    assert chains.best_within(table, 1.01 * sagittas[3], count=int(chains.counts[3]), length=0.35) is None
    assert chains.best_within(table, 1.01 * sagittas[3], among=np.array([True, True, False, False])) == 1
    assert chains.best_within(table, 1.01 * sagittas[3], order=lengths) == 0


@pytest.mark.parametrize("count", [2, 3, 7, 50])
def test_equal_lengths_of_an_arc(circle, count: int) -> None:
    found = equal_lengths(CurveTable(circle(0.5, 4.0)), count)
    assert found == pytest.approx(np.array([2 * 0.5 * math.sin(2.0 / count)]), rel=1e-9)
