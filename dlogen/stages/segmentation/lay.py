"""Chains of many segment lengths laid on a line, their deviations, and which lengths between them are out of reach.

Most lengths that a search tries are far too long, and their first bend shows it. So chains are laid a few joints at a
time where that is wanted, and those that are out of the question go no farther.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.geometry.vectors import column_dots
from dlogen.stages.segmentation.curve_table import CurveTable, Deviations, Traces, Walk, deviations, trace
from dlogen.types import Array, BoolArray, IntArray

#: Segments that are worked on at a time: some 10 MB.
_AT_ONCE = 16_384
#: Places in each piece that are looked at, shared out among the pieces, and before a chain is believed.
_FEW_PLACES, _PLACES = 128, 48
#: Fewest places in a piece.
_LEAST_PLACES = 7
#: A last segment that is shorter than this share of the line is none: the line has come back to where the joint is.
_NO_SEGMENT = 1e-6
#: Joints that are laid between two looks at the deviations.
_STEPS = 12


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of several segment lengths.

    Attributes:
        lengths: (B,) metres.
        counts: (B,) segments.
        deviation: (B,) metres, measured at few places; infinite where the last segment has no length.
        share: (B,) length of the last segment as a share of the others.
        refuted: (B - 1,) whether every length between two neighbours is known to deviate by more than was asked.
        u: (B, K + 1) places of the joints.
    """

    lengths: Array
    counts: IntArray
    deviation: Array
    share: Array
    refuted: BoolArray
    u: Array

    def best_within(
        self,
        table: CurveTable,
        e_max: float,
        count: int = 1 << 62,
        length: float = 0.0,
        among: BoolArray | None = None,
        order: Array | None = None,
    ) -> int | None:
        """The chain with the fewest and then the longest segments that is within e_max, looked at closely.

        Args:
            table: the line.
            e_max: metres.
            count, length: it must be better than that.
            among: (B,) which chains to look at.
            order: (B,) the one with the smallest value of this is the best.
        """
        possible = self.deviation <= e_max
        if among is not None:
            possible &= among
        possible &= (self.counts < count) | ((self.counts == count) & (self.lengths > length))
        rows = np.flatnonzero(possible)
        keys = (-self.lengths, self.counts) if order is None else (order,)
        for i in rows[np.lexsort([key[rows] for key in keys])]:
            if self.measured(table, i) <= e_max:
                return int(i)
        return None

    def measured(self, table: CurveTable, i: int) -> float:
        """The deviation of a chain, measured at many places, metres."""
        u = self.u[i, : self.counts[i] + 1]
        return float(deviations(table, u, table(u), _PLACES).distance.max())


def lay_chains(table: CurveTable, lengths: Array, e_max: float) -> Chains:
    """Chains of these segment lengths with their deviations, and which intervals between neighbours are out of reach.

    Args:
        table: the line.
        lengths: (B,) metres, in order.
        e_max: the deviation to compare with, metres.
    """
    return look_at(table, trace(table, lengths), e_max)


def lay_while_possible(table: CurveTable, lengths: Array, e_max: float, apart: BoolArray) -> Chains:
    """`lay_chains`, but chains end where they and all lengths next to them are refuted.

    Args:
        table: the line.
        lengths: (B,) metres.
        e_max: the deviation to compare with, metres.
        apart: (B - 1,) which neighbours do not matter to each other: the lengths between them are not asked for.

    Returns:
        The chains. Of those that ended early `counts` is 0, `share` is 0, `deviation` is one that is too large, and `u`
        has the joints up to there.
    """
    size, end = len(lengths), float(table.cells)
    walk = Walk(table, lengths)
    deviation = np.zeros(size)
    refuted, early = np.zeros(size - 1, dtype=np.bool_), np.zeros(size, dtype=np.bool_)
    places = int(np.clip(_FEW_PLACES * lengths.min() // table.line.length, _LEAST_PLACES, _PLACES))
    columns = [np.zeros((size, 1))]
    # Chains that have come to the end wait there for their neighbours.
    rows, first = np.arange(size), np.zeros(size)
    while walk.going.any():
        u = walk.advance(rows, _STEPS)
        block = np.full((size, u.shape[1] - 1), end)
        block[rows] = u[:, 1:]
        columns.append(block)
        joints, tangents = table.with_tangent(u)
        far = deviations(table, u, joints, places)
        deviation[rows] = np.maximum(deviation[rows], far.distance.max(axis=1))
        if len(columns) == 2:
            first = np.linalg.norm(joints[:, :, 1] - joints[:, :, 0], axis=0)
        pair = np.flatnonzero(np.diff(rows) == 1)
        if len(pair):
            known = refuted[rows[pair]]
            found = _refuted(table.step * u, joints, tangents, far, table.step * far.u, e_max, table.bend, first[rows])
            refuted[rows[pair]] = known | found[pair]
        settled = refuted | apart
        needless = np.append(True, settled) & np.append(settled, True) & (deviation > e_max)
        early |= needless & walk.going
        walk.going &= ~needless
        # What waits at the end is needed by a neighbour that is on its way.
        near = walk.going.copy()
        near[1:] |= walk.going[:-1] & ~settled
        near[:-1] |= walk.going[1:] & ~settled
        rows = np.flatnonzero(near)
    u = np.concatenate(columns, axis=1)
    counts = np.where(early, 0, walk.counts)
    whole = np.flatnonzero(~early)
    share = np.zeros(size)
    if len(whole):
        u = u[:, : walk.counts[whole].max() + 1]
        n = counts[whole]
        before, after = table(u[whole, n - 1]), table(u[whole, n])
        last = np.linalg.norm(after - before, axis=0)
        share[whole] = last / np.where(n > 1, lengths[whole], np.maximum(last, 1e-300))
        deviation[whole[last < _NO_SEGMENT * table.line.length]] = np.inf
    return Chains(lengths, counts, deviation, share, refuted, u)


def look_at(table: CurveTable, chains: Traces, e_max: float) -> Chains:
    """`lay_chains` with the places of the joints given."""
    lengths, size = chains.lengths, len(chains.lengths)
    deviation, share = np.empty(size), np.empty(size)
    refuted = np.zeros(max(size - 1, 0), dtype=np.bool_)
    rows = max(2, _AT_ONCE // chains.u.shape[1])
    # Blocks share a row, so that no pair of neighbours is left out.
    for begin in range(0, max(size - 1, 1), rows - 1):
        part = slice(begin, begin + rows)
        u, n = chains.u[part], chains.counts[part]
        joints, tangents = table.with_tangent(u)
        # Long pieces can have several peaks.
        first = np.linalg.norm(joints[:, :, 1] - joints[:, :, 0], axis=0)
        far = deviations(table, u, joints, int(np.clip(_FEW_PLACES // n.max(), _LEAST_PLACES, _PLACES)))
        deviation[part] = far.distance.max(axis=1)
        row = np.arange(len(u))
        last = np.linalg.norm(joints[:, row, n] - joints[:, row, n - 1], axis=0)
        share[part] = last / np.where(n > 1, lengths[part], np.maximum(last, 1e-300))
        deviation[part][last < _NO_SEGMENT * table.line.length] = np.inf
        if len(u) > 1:
            refuted[begin : begin + len(u) - 1] = _refuted(
                table.step * u, joints, tangents, far, table.step * far.u, e_max, table.bend, first
            )
    return Chains(lengths, chains.counts, deviation, share, refuted, chains.u)


def _refuted(
    arcs: Array,
    joints: Array,
    tangents: Array,
    far: Deviations,
    places: Array,
    e_max: float,
    curvature: float,
    first: Array,
) -> BoolArray:
    """(B - 1,) whether all chains between neighbouring ones deviate by more than e_max.

    Between two chains every joint is on the stretch of line between its places in the two. Let w be the farthest place
    of a piece, at the height h over its chord AB, in the direction d. If every chord in between rises by less than
    h - e_max towards w, seen along d, it is refuted. Two bounds of the rise, each good where the other is not:

    Apart: neither end of the chord rises by more than the end of its stretch does, plus kappa stretch^2 / 8, by which
    the stretch can bulge; nor does any point between them.

    Together: the chords' lengths differ by little, so that A and B move along the line by nearly the same. To first
    order the rise at w is then linear in how far A has moved; the rest is of second order and bounded by kappa.

    Args:
        arcs: (B, K + 1) places of the joints as arc lengths, metres.
        joints, tangents: (3, B, K + 1) there.
        far: the farthest place of every piece, (B, K).
        places: (B, K) where those are, as arc lengths, metres.
        e_max: metres.
        curvature: the line's largest, 1/m.
        first: (B,) lengths of the chains' first chords, metres.
    """
    steps = np.diff(arcs, axis=0)
    move_a, move_b = np.abs(steps[:, :-1]), np.abs(steps[:, 1:])
    latest, earliest = np.maximum(arcs[:-1], arcs[1:])[:, :-1], np.minimum(arcs[:-1], arcs[1:])[:, 1:]
    chords = np.diff(joints, axis=2)
    lengths = np.maximum(np.sqrt(column_dots(chords, chords)), 1e-9)
    chords /= lengths
    # Chords in between have lengths in between, but for the last ones, which can be as long as the others before.
    slack = np.abs(np.diff(lengths, axis=0)) + np.abs(np.diff(first))[:, None]
    # kappa stretch^2 / 2 is how far the line leaves its tangent, kappa stretch^2 / 8 its chord.
    leave = 0.5 * curvature * (move_a**2 + move_b**2)
    moves = joints[:, 1:] - joints[:, :-1]
    result = np.zeros(len(arcs) - 1, dtype=np.bool_)
    for own, way in ((slice(None, -1), 1.0), (slice(1, None), -1.0)):
        direction, height, length, chord = far.direction[:, own], far.height[own], lengths[own], chords[:, own]
        rises = way * column_dots(moves[:, :, :-1], direction), way * column_dots(moves[:, :, 1:], direction)
        apart = np.maximum(
            np.maximum(rises[0], 0.0) + curvature / 8.0 * move_a**2,
            np.maximum(rises[1], 0.0) + curvature / 8.0 * move_b**2,
        )

        tangent_a, tangent_b = tangents[:, own, :-1], tangents[:, own, 1:]
        up_a, up_b = column_dots(tangent_a, direction), column_dots(tangent_b, direction)
        along_a, along_b = column_dots(tangent_a, chord), column_dots(tangent_b, chord)
        forwards = (along_a > 0.3) & (along_b > 0.3)
        follow = along_a / np.where(forwards, along_b, 1.0)
        share = np.clip(far.along[own], 0.0, 1.0)
        linear = ((1.0 - share) * up_a + share * up_b * follow) * way * steps[:, :-1]
        sideways = np.sqrt(np.maximum(1.0 - along_a**2, 0.0)) * move_a
        sideways += np.sqrt(np.maximum(1.0 - along_b**2, 0.0)) * move_b + leave
        miss = slack + leave + sideways**2 / length
        climb = np.abs(up_a) * move_a + np.abs(up_b) * move_b + leave
        # How far the foot of w moves along the chord, as a share of it.
        shift = (move_a + move_b + leave) / length + climb * height / length**2
        together = (
            np.maximum(linear, 0.0) + np.abs(up_b) / np.where(forwards, along_b, 1.0) * miss + leave + shift * climb
        )
        rise = np.where(forwards & (shift < 0.5), np.minimum(apart, together), apart)
        inside = (places[own] >= latest) & (places[own] <= earliest)
        result |= (inside & (height - rise > e_max)).any(axis=1)
    return result
