"""The fewest equal segments, joints on the skeleton line, whose measured deviation the error allows.

Eq. 17 of the paper supposes the largest curvature everywhere. Here the deviation of the chain itself decides. It is not
monotone in the segment length: where longer segments end decides what they cut off. So all lengths are searched, by
branch and bound: an interval of lengths is given up only when some piece of the line is shown to be too far from its
segment for every length in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.geometry.vectors import column_dots
from dlogen.stages.segmentation.curve_table import CurveTable, Deviations, Traces, deviations, trace
from dlogen.types import Array, BoolArray, IntArray

#: Intervals of lengths that are still open at this share of the length count as settled by the chains at their ends.
RESOLUTION = 1e-6
#: First lengths for each segment that the chain can have, and bounds of their number.
_PER_SEGMENT, _LEAST, _MOST = 8, 64, 512
#: Chains that a search lays at most; only a line full of hairpins comes near it.
_MOST_CHAINS = 50_000
#: Segments that are worked on at a time: some 10 MB.
_AT_ONCE = 16_384
#: Places in each piece that are looked at, shared out among the pieces, and before a chain is believed.
_FEW_PLACES, _PLACES = 128, 48
#: A last segment that is shorter than this share of the line is none: the line has come back to where the joint is.
_NO_SEGMENT = 1e-6


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


@dataclass(frozen=True)
class Fewest:
    """What the search found.

    Attributes:
        count: the fewest segments.
        length: a segment length that gives them, metres.
        fewer: of the chains with one segment less the one that deviates least: (length, deviation), metres.
        resolution: an interval of lengths narrower than this share of them may have escaped.
        chains: how many were laid.
    """

    count: int
    length: float
    fewer: tuple[float, float] | None
    resolution: float
    chains: int


def fewest_segments(table: CurveTable, e_max: float, allowed: float, min_last: float = 0.0) -> Fewest | None:
    """The fewest segments that stay within e_max of the line, and the longest length that gives them.

    Supposes that the joints move forward as the length grows. They do wherever a chord and the line at its ends point
    the same way, which is everywhere unless the line turns by more than a right angle within a segment.

    Args:
        table: the line.
        e_max: largest deviation allowed, metres.
        allowed: the length from which to search upwards, that of Eq. 17, metres.
        min_last: length of the last segment as a share of the others. Of the lengths that give the fewest segments the
            longest with at least that is taken (to about 1 %), or the one with most. A stub is light and stiff, the
            first thing in a simulation to become unstable.

    Returns:
        None if no length above `allowed` will do.
    """
    reach = float(np.linalg.norm(table.points - table.points[:, :1], axis=0).max())
    # Between its points the line can reach a little farther.
    reach += (table.bend + 1.0 / reach) * table.step**2 / 8.0 + 1e-9 * reach
    # All lengths beyond that give one and the same segment.
    whole = np.array([[0.0, float(table.cells)]])
    single = _looked_at(table, Traces(np.array([reach]), whole, np.ones(1, dtype=np.intp)), e_max)
    if single.best_within(table, e_max) is not None:
        return Fewest(1, float(single.lengths[0]), None, 0.0, 1)

    allowed = min(allowed, 0.5 * reach)
    count, best, share = None, 0.0, 0.0
    tried = [single]
    # Inverse lengths: where the chain gets one segment more is evenly spaced.
    low, high = np.array([1.0 / reach]), np.array([1.0 / allowed])
    parts = int(np.clip(_PER_SEGMENT * table.line.length / allowed, _LEAST, _MOST))
    laid, resolution = 1, 0.0
    while len(low):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, parts + 1)
        chains = lay_chains(table, 1.0 / grid.ravel(), e_max)
        tried.append(chains)
        laid += grid.size
        i = chains.best_within(table, e_max) if count is None else chains.best_within(table, e_max, count, best)
        if i is not None:
            count, best, share = int(chains.counts[i]), float(chains.lengths[i]), float(chains.share[i])
        counts, lengths = chains.counts.reshape(grid.shape), chains.lengths.reshape(grid.shape)
        keep = ~np.append(chains.refuted, True).reshape(grid.shape)[:, :-1]
        if count is not None:
            fewer = np.minimum(counts[:, :-1], counts[:, 1:])
            keep &= (fewer < count) | ((fewer == count) & (lengths[:, :-1] > best * (1.0 + RESOLUTION)))
        low, high = grid[:, :-1][keep], grid[:, 1:][keep]
        width = (high - low) / low
        if laid > _MOST_CHAINS:
            resolution = float(width.max(initial=0.0))
            break
        fine = width <= RESOLUTION
        resolution = RESOLUTION if fine.any() else resolution
        low, high = low[~fine], high[~fine]
        parts = int(np.clip(256 // max(len(low), 1), 4, 32))
    if count is None:
        return None
    length = best if share >= min_last else _with_last(table, best, count, e_max, min_last)
    return Fewest(count, length, _closest(table, tried, count - 1), resolution, laid)


def _with_last(table: CurveTable, longest: float, count: int, e_max: float, min_last: float) -> float:
    """The longest length with so many segments whose last one is long enough, or the one where it is longest."""
    low = 1.0 / longest
    grid = np.linspace(low, low + 1.1 / table.line.length, 64)
    chains = lay_chains(table, 1.0 / grid, e_max)
    of_count = chains.counts == count
    enough = chains.best_within(table, e_max, among=of_count & (chains.share >= min_last))
    if enough is not None:
        return float(chains.lengths[enough])
    evenest = chains.best_within(table, e_max, among=of_count, order=-chains.share)
    return longest if evenest is None else float(chains.lengths[evenest])


def _closest(table: CurveTable, tried: list[Chains], count: int) -> tuple[float, float] | None:
    """Of the chains with so many segments the one that deviates least: (length, deviation), metres."""
    lengths, counts, deviation = (
        np.concatenate([getattr(chains, name) for chains in tried]) for name in ("lengths", "counts", "deviation")
    )
    of_count = (counts == count) & np.isfinite(deviation)
    if not of_count.any():
        return None
    lengths, deviation = lengths[of_count], deviation[of_count]
    ascending = np.argsort(lengths)
    best = int(np.argmin(deviation[ascending]))
    around = lengths[ascending[max(best - 1, 0)]], lengths[ascending[min(best + 1, len(lengths) - 1)]]
    chains = lay_chains(table, np.append(np.linspace(*around, 16), lengths[ascending[best]]), np.inf)
    i = int(np.argmin(np.where(chains.counts == count, chains.deviation, np.inf)))
    return float(chains.lengths[i]), chains.measured(table, i)


def equal_lengths(table: CurveTable, count: int) -> Array:
    """Lengths at which the line is cut into exactly so many segments, the last as long as the others.

    There is one, unless the joints jump as the length grows: (K,) metres, to about 1e-12, mostly K = 1. `count` is 2 or
    more.
    """
    longest = table.line.length / count
    low, high = 0.5 * longest, longest * (1.0 + 1e-9)
    while trace(table, np.array([low])).counts[0] <= count:
        high, low = low, 0.5 * low
    found = []
    grid = np.linspace(low, longest * (1.0 + 1e-9), 257)
    enough = trace(table, grid).counts <= count
    for i in np.flatnonzero(~enough[:-1] & enough[1:]):
        low, high = grid[i], grid[i + 1]
        while high - low > 1e-13 * high:
            inner = np.linspace(low, high, 34)[1:-1]
            fits = np.append(trace(table, inner).counts <= count, True)
            k = int(np.argmax(fits))
            low, high = (inner[k - 1] if k else low), (inner[k] if k < len(inner) else high)
        found.append(high)
    return np.array(found)


def lay_chains(table: CurveTable, lengths: Array, e_max: float) -> Chains:
    """Chains of these segment lengths with their deviations, and which intervals between neighbours are out of reach.

    Args:
        table: the line.
        lengths: (B,) metres, in order.
        e_max: the deviation to compare with, metres.
    """
    return _looked_at(table, trace(table, lengths), e_max)


def _looked_at(table: CurveTable, chains: Traces, e_max: float) -> Chains:
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
        far = deviations(table, u, joints, int(np.clip(_FEW_PLACES // n.max(), 7, _PLACES)))
        deviation[part] = far.distance.max(axis=1)
        row = np.arange(len(u))
        last = np.linalg.norm(joints[:, row, n] - joints[:, row, n - 1], axis=0)
        share[part] = last / np.where(n > 1, lengths[part], np.maximum(last, 1e-300))
        deviation[part][last < _NO_SEGMENT * table.line.length] = np.inf
        if len(u) > 1:
            refuted[begin : begin + len(u) - 1] = _refuted(
                table.step * u, joints, tangents, far, table.step * far.u, e_max, table.bend
            )
    return Chains(lengths, chains.counts, deviation, share, refuted, chains.u)


def _refuted(
    arcs: Array, joints: Array, tangents: Array, far: Deviations, places: Array, e_max: float, curvature: float
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
    """
    steps = np.diff(arcs, axis=0)
    move_a, move_b = np.abs(steps[:, :-1]), np.abs(steps[:, 1:])
    latest, earliest = np.maximum(arcs[:-1], arcs[1:])[:, :-1], np.minimum(arcs[:-1], arcs[1:])[:, 1:]
    chords = np.diff(joints, axis=2)
    lengths = np.maximum(np.sqrt(column_dots(chords, chords)), 1e-9)
    chords /= lengths
    # Chords in between have lengths in between, but for the last ones, which can be as long as the others before.
    slack = np.abs(np.diff(lengths, axis=0)) + np.abs(np.diff(lengths[:, 0]))[:, None]
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
