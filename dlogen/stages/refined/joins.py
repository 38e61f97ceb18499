"""Which ends of pieces belong together: the joins of least bending energy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.piece import Piece, parabola
from dlogen.types import Array

#: A join that bends tighter than this, in radii, is none.
_TIGHTEST_BEND = 1.0

#: A gap longer than this share of everything that was seen is not bridged, unless that was asked for; then it is one
#: between pieces of so many radii at least, for shorter ones may be strays.
_LONGEST_GAP, _NO_STRAYS = 0.15, 4.0

#: How many ways to join the same pieces are tried when the length is known, and how much more they may cost.
_WAYS, _LIKELY = 20, 0.5

#: Nor is one longer than this, in radii, whose bridge would turn by more than this, in radians.
_BLIND = 8.0

_BLIND_TURN = 1.8


#: What it is worth that a piece is used rather than left over, in the units of `bending_cost`.
_USED = 1.0
#: A piece of so many radii is worth all of it; a shorter one, its share.
_LONG = 12.0


@dataclass(frozen=True)
class Join:
    """Two ends of pieces that belong together.

    Attributes:
        ends: numbers of the ends: 2 i is the first point of piece i, 2 i + 1 its last.
        gap: distance between the two, metres.
        cost: bending energy times radius, plus a little for the distance.
        margin: how much more the next best way to join would cost.
    """

    ends: tuple[int, int]
    gap: float
    cost: float
    margin: float


_Chosen = list[tuple[int, int]]


def join_pieces(pieces: list[Piece], radius: float, bridging: Bridging | None = None) -> list[Join]:
    """Join the ends of pieces so that the total cost is small: cheapest joins first, then exchanges.

    No join closes a ring. Ends that nothing fits stay free.

    Args:
        pieces: in any order and direction.
        radius: of the tube, metres.
        bridging: which gaps belong to the object, as far as its user says so.
    """
    cost = _costs(pieces, radius, bridging or Bridging())
    return _as_joins(pieces, _cheapest(pieces, radius, cost), cost)


def ways_to_join(pieces: list[Piece], radius: float, bridging: Bridging) -> Iterator[list[Join]]:
    """Ways to join the same pieces, from the likeliest on.

    The first is that of `join_pieces`, the second bridges all gaps; those that follow differ from these by one join.
    """
    sure = _costs(pieces, radius, bridging)
    chosen = _cheapest(pieces, radius, sure)
    yield _as_joins(pieces, chosen, sure)
    cost = _costs(pieces, radius, replace(bridging, longest=np.inf))
    all_gaps = _cheapest(pieces, radius, cost)
    yield _as_joins(pieces, all_gaps, cost)
    others = [way for start in (chosen, all_gaps) for n in range(len(start)) for way in _alternatives(start, n, cost)]
    for more, way in sorted(others, key=lambda option: option[0])[:_WAYS]:
        if more < _LIKELY:
            yield _as_joins(pieces, way, cost)


def _costs(pieces: list[Piece], radius: float, bridging: Bridging) -> Array:
    """What it costs to join each end to each other one; infinite where that is no join."""
    total = sum(piece.length for piece in pieces)
    cost = np.full((2 * len(pieces), 2 * len(pieces)), np.inf)
    anchors = [_anchor(pieces[end // 2], end % 2, radius) for end in range(2 * len(pieces))]
    for a in range(len(cost)):
        for b in range(a + 1, len(cost)):
            gap, shorter = _gap(pieces, a, b), min(pieces[a // 2].length, pieces[b // 2].length)
            asked = gap <= bridging.reach and shorter >= _NO_STRAYS * radius
            if a // 2 != b // 2 and (asked or gap < _LONGEST_GAP * total):
                cost[a, b] = cost[b, a] = bending_cost(*anchors[a], *anchors[b], radius, asked=asked)
    return cost


def _cheapest(pieces: list[Piece], radius: float, cost: Array) -> _Chosen:
    """The joins of least cost, as far as single exchanges lead."""
    worth = np.array([min(piece.length / (_LONG * radius), 1.0) for piece in pieces])
    chosen: list[tuple[int, int]] = []
    for flat in np.argsort(cost, axis=None, kind="stable"):
        a, b = divmod(int(flat), len(cost))
        if not np.isfinite(cost[a, b]):
            break
        if a < b and _is_path([*chosen, (a, b)]):
            chosen.append((a, b))
    while True:
        options = [option for number in range(len(chosen)) for option in _alternatives(chosen, number, cost)]
        options += [option for number in range(len(chosen)) for option in _insertions(chosen, number, cost, worth)]
        options += [option for number in range(len(pieces)) for option in _replacements(chosen, number, cost, worth)]
        gain, better = min(options, key=lambda option: option[0], default=(0.0, chosen))
        if gain > -1e-9:
            break
        chosen = better
    return chosen


def _as_joins(pieces: list[Piece], chosen: _Chosen, cost: Array) -> list[Join]:
    joins = []
    for number, (a, b) in enumerate(chosen):
        margin = min((more for more, _ in _alternatives(chosen, number, cost)), default=np.inf)
        joins.append(Join((a, b), _gap(pieces, a, b), float(cost[a, b]), float(margin)))
    return joins


def _tip(pieces: list[Piece], end: int) -> Array:
    tip: Array = pieces[end // 2].points[-(end % 2)]
    return tip


def _gap(pieces: list[Piece], a: int, b: int) -> float:
    return float(np.linalg.norm(_tip(pieces, a) - _tip(pieces, b)))


def _anchor(piece: Piece, last: int, radius: float) -> tuple[Array, Array]:
    """A point 1.5 radii inside an end, and the outward direction there.

    The tip itself is where points were lost or mixed up with another strand.
    """
    points = piece.points[::-1] if last else piece.points
    return parabola(points, 1.5 * radius, radius)


def bending_cost(
    a: Array, heading_a: Array, b: Array, heading_b: Array, radius: float, *, asked: bool = False
) -> float:
    """Bending energy, times the radius, of the thin beam between two ends, plus a little for its turn and its length.

    A beam of length L that leaves its chord by the small angles alpha at one end and beta at the other has the energy
    4 (alpha^2 + alpha beta + beta^2) / L (integral of the squared curvature), which for an arc is its turn squared over
    its length. Infinite if it bends too tightly, or too far where nothing was seen.

    Args:
        a, b: (3,) the ends, metres.
        heading_a, heading_b: (3,) unit directions out of either piece.
        radius: of the tube, metres.
        asked: whether the user says that such gaps belong to the object, however far it turns there.
    """
    chord = b - a
    length = max(float(np.linalg.norm(chord)), radius)
    chord = chord / length
    alpha, beta = heading_a - chord, -heading_b - chord
    tightest = max(float(np.linalg.norm(4 * alpha + 2 * beta)), float(np.linalg.norm(2 * alpha + 4 * beta))) / length
    if tightest * _TIGHTEST_BEND * radius > 1.0:
        return np.inf
    turn = 2.0 * max(float(alpha @ alpha + alpha @ beta + beta @ beta), 0.0) ** 0.5
    if not asked and length > _BLIND * radius and turn > _BLIND_TURN:
        return np.inf
    return float(turn**2 * radius / length + 0.05 * turn**2 + 0.02 * length / radius)


def _is_path(joins: list[tuple[int, int]]) -> bool:
    """Whether every end is used once at most and nothing is closed to a ring."""
    used: set[int] = set()
    group: dict[int, int] = {}

    def root(piece: int) -> int:
        while piece in group:
            piece = group[piece]
        return piece

    for a, b in joins:
        if a in used or b in used or root(a // 2) == root(b // 2):
            return False
        used |= {a, b}
        group[root(a // 2)] = root(b // 2)
    return True


def _alternatives(chosen: list[tuple[int, int]], number: int, cost: Array) -> list[tuple[float, list[tuple[int, int]]]]:
    """Other ways to join the ends of one join, and how much more they cost: with free ends, or by an exchange."""
    a, b = chosen[number]
    others = chosen[:number] + chosen[number + 1 :]
    busy = {end for join in chosen for end in join}
    options = []
    for free in range(len(cost)):
        if free not in busy:
            options += [(cost[end, free] - cost[a, b], [*others, (end, free)]) for end in (a, b)]
    for position, (c, d) in enumerate(others):
        rest = others[:position] + others[position + 1 :]
        before = cost[a, b] + cost[c, d]
        options.append((cost[a, c] + cost[b, d] - before, [*rest, (a, c), (b, d)]))
        options.append((cost[a, d] + cost[b, c] - before, [*rest, (a, d), (b, c)]))
    return [(float(more), joins) for more, joins in options if np.isfinite(more) and _is_path(joins)]


def _insertions(
    chosen: list[tuple[int, int]], number: int, cost: Array, worth: Array
) -> list[tuple[float, list[tuple[int, int]]]]:
    """Ways to take a piece that is left over in between the two ends of a join, as a loop that ends where it begins."""
    a, b = chosen[number]
    others = chosen[:number] + chosen[number + 1 :]
    busy = {end for join in chosen for end in join}
    options = []
    for first in range(len(cost)):
        last = first ^ 1
        if first not in busy and last not in busy:
            more = cost[a, first] + cost[last, b] - cost[a, b] - _USED * worth[first // 2]
            options.append((more, [*others, (a, first), (last, b)]))
    return [(float(more), joins) for more, joins in options if np.isfinite(more) and _is_path(joins)]


def _replacements(
    chosen: list[tuple[int, int]], number: int, cost: Array, worth: Array
) -> list[tuple[float, list[tuple[int, int]]]]:
    """Ways to take a longer piece that is left over instead of one between two joins, where strands share a stretch."""
    joins = [join for join in chosen if join[0] // 2 == number or join[1] // 2 == number]
    if len(joins) != 2:
        return []
    others = [join for join in chosen if join not in joins]
    a, b = (join[1] if join[0] // 2 == number else join[0] for join in joins)
    before = sum(cost[join] for join in joins)
    busy = {end for join in chosen for end in join}
    options = []
    for first in range(len(cost)):
        last = first ^ 1
        if first not in busy and last not in busy:
            more = cost[a, first] + cost[last, b] - before - _USED * (worth[first // 2] - worth[number])
            options.append((more, [*others, (a, first), (last, b)]))
    return [(float(more), joins) for more, joins in options if np.isfinite(more) and _is_path(joins)]


def chains(count: int, joins: list[Join]) -> list[tuple[list[tuple[int, bool]], list[Join]]]:
    """Follow the joins from end to end.

    Args:
        count: number of pieces.
        joins: between their ends, without rings.

    Returns:
        For each chain its pieces in order, with whether they are reversed, and the joins between them.
    """
    partner = {end: (other, join) for join in joins for end, other in (join.ends, join.ends[::-1])}
    result = []
    done: set[int] = set()
    for end in range(2 * count):
        if end // 2 in done or end in partner:
            continue
        order, between = [], []
        while True:
            order.append((end // 2, end % 2 == 1))
            done.add(end // 2)
            if end ^ 1 not in partner:
                break
            end, join = partner[end ^ 1]
            between.append(join)
        result.append((order, between))
    return result


def bridge(a: Array, heading_a: Array, b: Array, heading_b: Array, step: float) -> Array:
    """Points about a step apart on the cubic between two ends, the ends left out: (J, 3)."""
    length = float(np.linalg.norm(b - a))
    count = max(round(length / step), 1)
    t = (np.arange(1, count) / count)[:, None]
    points: Array = (
        (2 * t**3 - 3 * t**2 + 1) * a
        + (t**3 - 2 * t**2 + t) * length * heading_a
        + (3 * t**2 - 2 * t**3) * b
        + (t**3 - t**2) * length * -heading_b
    )
    return points
