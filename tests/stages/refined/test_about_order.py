"""What is said of an order."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.about_order import about_bridges, about_cloud, about_ends, about_rest, gap_finding
from dlogen.stages.refined.joins import Join
from dlogen.stages.refined.ordered_line import Bridge, OrderedLine
from dlogen.stages.refined.piece import Piece
from dlogen.stages.scale import Scale
from dlogen.types import Array, Finding

R = 0.01
SCALE = Scale(0.002, R, True, 1e-4, 1.0, 1.0, 20.0, True, True)


def line_of(points: Array, weight: float = 20.0, joins: list[Join] | None = None) -> OrderedLine:
    return OrderedLine.of([Piece(points, np.full(len(points), weight))], [(0, False)], joins or [], R)


def straight(length: float, start: tuple[float, float, float] = (0.0, 0.0, 0.0), weight: float = 20.0) -> OrderedLine:
    x = np.linspace(0.0, length, max(round(length / R) + 1, 3))
    return line_of(np.array(start) + np.stack([x, 0 * x, 0 * x], axis=1), weight)


def moved(place: Array) -> Array:
    """Places of the sample are elsewhere in the cloud."""
    result: Array = place + np.array([0.0, 0.0, 5.0])
    return result


def codes(findings: list[Finding]) -> list[tuple[str, str]]:
    return [(item.code, item.severity) for item in findings]


@pytest.mark.parametrize(
    ("away", "said"),
    [
        (0.0, []),
        (0.1, [("stray-points", "note")]),
        (0.3, [("stray-points", "doubtful")]),
        (0.5, [("not-a-line", "bad")]),
    ],
)
def test_strays(away: float, said: list[tuple[str, str]]) -> None:
    near = np.arange(1000) >= 1000 * away
    assert codes(about_cloud(SCALE, True, 20.0, near, straight(0.5), R)) == said


def test_too_short_and_too_few() -> None:
    near = np.ones(100, dtype=bool)
    assert "not-a-line" in dict(codes(about_cloud(SCALE, True, 20.0, near, straight(0.03), R)))
    assert "too-few-points" in dict(codes(about_cloud(SCALE, True, 1.0, near, straight(0.5), R)))


def test_what_is_left_over_is_a_branch_or_another_object_at_its_place() -> None:
    line = straight(0.5)
    branch, other = straight(0.1, (0.25, 0.03, 0.0)), straight(0.1, (0.0, 0.3, 0.0))
    found = about_rest([branch, other], line, R, moved, in_view=False)
    assert codes(found) == [("branch", "bad"), ("several-objects", "bad")]
    assert found[0].position == pytest.approx((0.25, 0.0, 5.0), abs=R) and found[0].s == pytest.approx(0.5, abs=0.05)
    assert found[1].position == pytest.approx((0.05, 0.3, 5.0), abs=R)


def test_in_a_view_a_short_group_is_doubtful_only() -> None:
    speck = straight(0.04, (1.0, 0.03, 0.0))
    assert codes(about_rest([speck], straight(2.0), R, moved, in_view=True)) == [("stray-points", "doubtful")]
    assert codes(about_rest([speck], straight(2.0), R, moved, in_view=False)) == [("branch", "bad")]


def test_a_ring_has_ends_that_go_on_into_each_other() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi - 0.05, 200)
    ring = line_of(0.3 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))
    (found,) = about_ends(ring, R, moved)
    assert (found.code, found.severity, found.s) == ("closed-ring", "bad", 0.0)
    assert found.position == pytest.approx((0.3, 0.0, 5.0), abs=0.02)
    assert about_ends(straight(0.5), R, moved) == []


@pytest.mark.parametrize(("share", "severity"), [(0.01, "note"), (0.1, "doubtful"), (0.4, "bad")])
def test_gaps_by_their_share(share: float, severity: str) -> None:
    found = gap_finding(share, share, 0.5, (1.0, 2.0, 3.0))
    assert (found.severity, found.s, found.position) == (severity, 0.5, (1.0, 2.0, 3.0))


def test_a_bridge_that_might_go_another_way_is_doubtful() -> None:
    pieces = [
        Piece(straight(0.2).points, np.full(21, 20.0)),
        Piece(straight(0.2, (0.26, 0.0, 0.0)).points, np.full(21, 20.0)),
    ]
    line = OrderedLine.of(pieces, [(0, False), (1, False)], [Join((1, 2), 0.06, 0.1, 0.02)], R)
    bridges = [Bridge((0.43, 0.57), (0.23, 0.0, 0.0), 0.06, "gap", 0.17)]
    found = about_bridges(bridges, line, R, moved)
    assert codes(found) == [("crossing", "doubtful"), ("gap", "doubtful")]
    assert found[0].position == pytest.approx((0.23, 0.0, 5.0)) and found[0].s == pytest.approx(0.5)
