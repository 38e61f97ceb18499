"""Joins of pieces by bending energy, against beams and arrangements that can be counted through."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.joins import Join, bending_cost, bridge, chains, join_pieces, ways_to_join
from dlogen.stages.refined.piece import Piece

Array = np.ndarray
RADIUS = 0.01


def straight(start: list[float], end: list[float]) -> Piece:
    count = round(np.linalg.norm(np.subtract(end, start)) / RADIUS) + 1
    return Piece(np.linspace(start, end, count), np.ones(count))


def on_arc(bend: float, first: float, last: float) -> Piece:
    angle = np.linspace(first, last, round(bend * abs(last - first) / RADIUS) + 1)
    return Piece(np.stack([bend * np.cos(angle), bend * np.sin(angle), 0 * angle], axis=1), np.ones(len(angle)))


class TestCost:
    @pytest.mark.parametrize("angle", [0.05, 0.2])
    def test_of_an_arc_it_is_its_turn_squared_over_its_length(self, angle: float) -> None:
        bend = 0.5
        a, b = np.array([bend, 0, 0]), bend * np.array([np.cos(angle), np.sin(angle), 0])
        cost = bending_cost(a, np.array([0.0, 1, 0]), b, np.array([np.sin(angle), -np.cos(angle), 0]), RADIUS)
        length = bend * angle
        expected = angle**2 * RADIUS / length + 0.05 * angle**2 + 0.02 * length / RADIUS
        assert cost == pytest.approx(expected, rel=0.01)

    def test_straight_on_costs_the_distance_only(self) -> None:
        x = np.array([1.0, 0, 0])
        assert bending_cost(0 * x, x, 0.08 * x, -x, RADIUS) == pytest.approx(0.02 * 8)

    @settings(max_examples=30, deadline=None)
    @given(seed=st.integers(0, 2**32 - 1), scale=st.floats(1e-3, 1e3))
    def test_it_does_not_depend_on_names_place_turn_and_units(self, seed: int, scale: float) -> None:
        rng = np.random.default_rng(seed)
        a, b = rng.normal(size=(2, 3))
        one, other = (v / np.linalg.norm(v) for v in ((b - a) + 0.5 * rng.normal(size=3), a - b))
        cost = bending_cost(a, one, b, other, 0.3)
        assert bending_cost(b, other, a, one, 0.3) == pytest.approx(cost)
        turn, shift = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
        moved = bending_cost(scale * turn @ a + shift, turn @ one, scale * turn @ b + shift, turn @ other, 0.3 * scale)
        assert moved == pytest.approx(cost, rel=1e-6)

    def test_what_bends_too_tightly_or_blindly_is_none(self) -> None:
        x, y = np.eye(3)[:2]
        # Back again within two radii.
        assert bending_cost(0 * x, x, 2 * RADIUS * y, x, RADIUS) == np.inf
        # Round a half circle of six radii, and of thirty: too far for what nobody has seen.
        assert np.isfinite(bending_cost(0 * x, x, 7.5 * RADIUS * y, x, RADIUS))
        assert bending_cost(0 * x, x, 60 * RADIUS * y, x, RADIUS) == np.inf
        # Straight ahead, far is no harm.
        assert np.isfinite(bending_cost(0 * x, x, 60 * RADIUS * x, -x, RADIUS))


def names(joins: list[Join]) -> set[frozenset[int]]:
    return {frozenset(join.ends) for join in joins}


def test_two_strands_that_cross_go_straight_on() -> None:
    pieces = [
        straight([-0.3, 0, 0], [-0.03, 0, 0]),
        straight([0, 0.03, 0], [0, 0.3, 0]),
        straight([0.3, 0, 0], [0.03, 0, 0]),
        straight([0, -0.3, 0], [0, -0.03, 0]),
    ]
    joins = join_pieces(pieces, RADIUS)
    # 1 and 5 are the inner ends of the pieces along x; 7 and 2 of those along y.
    assert names(joins) == {frozenset({1, 5}), frozenset({7, 2})}
    for join in joins:
        assert join.gap == pytest.approx(0.06)
        # From 1.5 radii inside of either end.
        assert join.cost == pytest.approx(0.02 * 9)
        # The next best is to turn by a right angle, for both at once.
        assert join.margin > 0.1


def test_the_pieces_of_an_arc_in_any_order_and_direction() -> None:
    bend = 0.3
    parts = [on_arc(bend, 0.0, 0.7), on_arc(bend, 1.5, 0.8), on_arc(bend, 1.6, 2.4), on_arc(bend, 3.2, 2.5)]
    joins = join_pieces(parts, RADIUS)
    assert names(joins) == {frozenset({1, 3}), frozenset({2, 4}), frozenset({5, 7})}
    order = [2, 0, 3, 1]
    shuffled = join_pieces([parts[i] for i in order], RADIUS)
    old = {2 * new + end: 2 * i + end for new, i in enumerate(order) for end in (0, 1)}
    assert {frozenset(old[end] for end in join.ends) for join in shuffled} == names(joins)
    assert sorted(join.cost for join in shuffled) == pytest.approx(sorted(join.cost for join in joins))


def test_no_ring_is_closed() -> None:
    # Three quarters of a circle in three pieces: the fourth side is open, and stays so.
    parts = [on_arc(0.05, 2.1 * k + 0.15, 2.1 * k + 1.95) for k in range(3)]
    assert len(join_pieces(parts, RADIUS)) == 2


def test_what_is_far_away_stays_alone() -> None:
    pieces = [straight([0, 0, 0], [0.3, 0, 0]), straight([0.45, 0, 0], [0.6, 0, 0])]
    # The gap is 0.15 of 0.45 m in all, a third.
    assert join_pieces(pieces, RADIUS) == []
    assert join_pieces(pieces[:1], RADIUS) == []


@pytest.mark.parametrize("seed", range(12))
def test_all_together_it_is_the_cheapest_of_all_ways(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # The first ends of four straight pieces around a place where two strands cross, the other ends far away.
    one, other = rng.normal(size=(2, 3))
    heading = np.array([one, -one, other, -other]) + 0.4 * rng.normal(size=(4, 3))
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    tips = 0.04 * heading + rng.normal(scale=0.005, size=(4, 3))
    pieces = [straight(tip, tip + 0.3 * h) for tip, h in zip(tips, heading, strict=True)]
    joins = join_pieces(pieces, RADIUS)
    # Every join that can be made, from 1.5 radii inside.
    anchors = tips + 1.5 * RADIUS * heading
    cost = {
        (i, j): value
        for i, j in combinations(range(4), 2)
        if np.isfinite(value := bending_cost(anchors[i], -heading[i], anchors[j], -heading[j], RADIUS))
    }
    assert joins
    for join in joins:
        assert join.cost == pytest.approx(cost[min(join.ends) // 2, max(join.ends) // 2], rel=1e-6)
        assert join.margin >= -1e-9
    pairs = combinations(cost, len(joins))
    ways = [some for some in pairs if len({end for pair in some for end in pair}) == 2 * len(joins)]
    totals = sorted(sum(cost[pair] for pair in some) for some in ways)
    assert sum(join.cost for join in joins) == pytest.approx(totals[0])
    if len(joins) == 2 and len(totals) > 1:
        # Both ends are taken: the next best way is the exchange of both.
        assert joins[0].margin == joins[1].margin == pytest.approx(totals[1] - totals[0])


def test_chains_are_followed_from_end_to_end() -> None:
    links = [Join((1, 5), 0.1, 1.0, 1.0), Join((4, 6), 0.2, 2.0, 1.0)]
    # Piece 0 forwards, piece 2 backwards, piece 3 forwards; piece 1 alone.
    (first, between), (alone, none) = chains(4, links)
    assert first == [(0, False), (2, True), (3, False)]
    assert between == links
    assert (alone, none) == ([(1, False)], [])


def test_a_chain_may_start_backwards() -> None:
    ((order, between),) = chains(2, [Join((0, 3), 0.1, 1.0, 1.0)])
    assert order == [(0, True), (1, True)]
    assert len(between) == 1


class TestBridge:
    def test_between_straight_ends_it_is_straight_and_even(self) -> None:
        x = np.array([1.0, 0, 0])
        points = bridge(0 * x, x, 0.1 * x, -x, RADIUS)
        assert np.allclose(points, np.arange(0.01, 0.095, 0.01)[:, None] * x)

    def test_between_the_ends_of_an_arc_it_is_near_it(self) -> None:
        angle = 1.0
        a, b = np.array([1.0, 0, 0]), np.array([np.cos(angle), np.sin(angle), 0])
        points = bridge(a, np.array([0.0, 1, 0]), b, np.array([np.sin(angle), -np.cos(angle), 0]), 0.02)
        assert np.linalg.norm(points, axis=1) == pytest.approx(1.0, abs=0.01)
        phase = np.arctan2(points[:, 1], points[:, 0])
        assert (np.diff(phase) > 0).all() and phase[0] > 0 and phase[-1] < angle

    def test_backwards_it_is_the_same(self) -> None:
        rng = np.random.default_rng(3)
        a, one, b, other = rng.normal(size=(4, 3))
        assert np.allclose(bridge(a, one, b, other, 0.1), bridge(b, other, a, one, 0.1)[::-1])

    def test_nothing_lies_between_ends_that_are_a_step_apart(self) -> None:
        x = np.array([1.0, 0, 0])
        assert bridge(0 * x, x, 0.012 * x, -x, RADIUS).shape == (0, 3)


class TestAskedFor:
    pieces = (straight([0, 0, 0], [0.3, 0, 0]), straight([0.45, 0, 0], [0.6, 0, 0]))

    def test_a_gap_up_to_the_length_that_was_given_is_joined(self) -> None:
        assert join_pieces(list(self.pieces), RADIUS, Bridging(0.1)) == []
        for bridging in (Bridging(0.15), Bridging(np.inf)):
            (join,) = join_pieces(list(self.pieces), RADIUS, bridging)
            assert set(join.ends) == {1, 2} and join.gap == pytest.approx(0.15)

    def test_strays_are_not(self) -> None:
        speck = straight([0.45, 0, 0], [0.48, 0, 0])
        assert join_pieces([self.pieces[0], speck], RADIUS, Bridging(np.inf)) == []

    def test_it_may_turn_there_however_far(self) -> None:
        x, y = np.eye(3)[:2]
        assert bending_cost(0 * x, x, 30 * RADIUS * y, x, RADIUS) == np.inf
        assert np.isfinite(bending_cost(0 * x, x, 30 * RADIUS * y, x, RADIUS, asked=True))

    def test_bends_tighter_than_the_tube_are_none_even_then(self) -> None:
        x, y = np.eye(3)[:2]
        assert bending_cost(0 * x, x, 2 * RADIUS * y, x, RADIUS, asked=True) == np.inf


def test_ways_to_join_begin_with_the_cheapest_and_go_on_to_all_gaps_and_exchanges() -> None:
    far = [straight([0, 0, 0], [0.3, 0, 0]), straight([0.45, 0, 0], [0.6, 0, 0])]
    first, second, *_ = ways_to_join(far, RADIUS, Bridging())
    assert first == [] and names(second) == {frozenset({1, 2})}
    # Two strands cross at a small angle, so that they could also touch and part.
    ends = ((1.0, 0.5), (-1.0, -0.5), (1.0, -0.5), (-1.0, 0.5))
    crossing = [straight([0.03 * a, 0.03 * b, 0], [0.3 * a, 0.3 * b, 0]) for a, b in ends]
    ways = [names(way) for way in ways_to_join(crossing, RADIUS, Bridging())]
    assert ways[0] == names(join_pieces(crossing, RADIUS)) == {frozenset({0, 2}), frozenset({4, 6})}
    assert {frozenset({0, 6}), frozenset({2, 4})} in ways
    # At right angles that is too unlikely, whatever the length.
    square = [straight([0.03 * a, 0.03 * b, 0], [0.3 * a, 0.3 * b, 0]) for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
    assert not any(frozenset({0, 6}) in names(way) for way in ways_to_join(square, RADIUS, Bridging()))
