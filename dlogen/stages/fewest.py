"""The fewest equal segments, joints on the skeleton line, whose measured deviation the error allows.

Eq. 17 of the paper supposes the largest curvature everywhere. Here the deviation of the chain itself decides. It is not
monotone in the segment length: where longer segments end decides what they cut off. So all lengths are searched, by
branch and bound: an interval of lengths is given up only when some piece of the line is shown to be too far from its
segment for every length in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.model import Array, BoolArray, IntArray
from dlogen.stages.curve_table import CurveTable, Deviations, deviations, dot, trace

#: Intervals of lengths that are still open at this share of the length count as settled by the chains at their ends.
RESOLUTION = 1e-7
#: First lengths for each segment that the chain can have, and bounds of their number.
_PER_SEGMENT, _LEAST, _MOST = 8, 64, 512
#: Chains that a search lays at most; only a line full of hairpins comes near it.
_MOST_CHAINS = 50_000
#: Segments that are worked on at a time: some 10 MB.
_AT_ONCE = 16_384
#: Places in each piece that are looked at before a chain is believed.
_PLACES = 48
#: A last segment that is shorter than this share of the line is none: the line has come back to where the joint is.
_NO_SEGMENT = 1e-6


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of several segment lengths.

    Attributes:
        lengths: (B,) metres.
        counts: (B,) segments.
        deviation: (B,) measured, metres; infinite where the last segment has no length.
        share: (B,) length of the last segment as a share of the others.
        refuted: (B - 1,) whether every length between two neighbours is known to deviate by more than was asked.
    """

    lengths: Array
    counts: IntArray
    deviation: Array
    share: Array
    refuted: BoolArray


@dataclass(frozen=True)
class Fewest:
    """What the search found.

    Attributes:
        length: the longest segment length that gives the fewest segments, metres.
        count: segments.
        resolution: an interval of lengths narrower than this share of them may have escaped.
        chains: how many were laid.
    """

    length: float
    count: int
    resolution: float
    chains: int


def fewest_segments(table: CurveTable, e_max: float, allowed: float, curvature: float) -> Fewest | None:
    """The fewest segments that stay within e_max of the line, and the longest length that gives them.

    Supposes that the joints move forward as the length grows. They do wherever a chord and the line at its ends point
    the same way, which is everywhere unless the line turns by more than a right angle within a segment.

    Args:
        table: the line.
        e_max: largest deviation allowed, metres.
        allowed: the length from which to search upwards, that of Eq. 17, metres.
        curvature: the line's largest, 1/m.

    Returns:
        None if no length above `allowed` will do.
    """
    reach = _reach(table)
    # All lengths beyond the reach give one and the same segment.
    single = lay_chains(table, np.array([reach * (1.0 + 1e-9)]), e_max, curvature)
    if single.deviation[0] <= e_max:
        return Fewest(float(single.lengths[0]), 1, 0.0, 1)
    if allowed >= reach:
        return None

    best: tuple[int, float] | None = None
    # Inverse lengths: the chains that differ by one segment are evenly spaced.
    low, high = np.array([1.0 / reach]), np.array([1.0 / allowed])
    parts = int(np.clip(_PER_SEGMENT * table.line.length / allowed, _LEAST, _MOST))
    laid, resolution = 1, 0.0
    while len(low):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, parts + 1)
        chains = lay_chains(table, 1.0 / grid.ravel(), e_max, curvature)
        laid += grid.size
        for i in np.flatnonzero(chains.deviation <= e_max):
            found = (int(chains.counts[i]), -float(chains.lengths[i]))
            best = found if best is None else min(best, found)
        counts, lengths = chains.counts.reshape(grid.shape), chains.lengths.reshape(grid.shape)
        refuted = np.append(chains.refuted, True).reshape(grid.shape)[:, :-1]
        fewer = np.minimum(counts[:, :-1], counts[:, 1:])
        keep = ~refuted
        if best is not None:
            longer = lengths[:, :-1] > -best[1] * (1.0 + RESOLUTION)
            keep &= (fewer < best[0]) | ((fewer == best[0]) & longer)
        low, high = grid[:, :-1][keep], grid[:, 1:][keep]
        width = (high - low) / low
        if laid > _MOST_CHAINS:
            resolution = float(width.max(initial=0.0))
            break
        fine = width <= RESOLUTION
        if fine.any():
            resolution = RESOLUTION
        low, high = low[~fine], high[~fine]
        parts = int(np.clip(256 // max(len(low), 1), 4, 32))
    return None if best is None else Fewest(-best[1], best[0], resolution, laid)


def even_length(table: CurveTable, found: Fewest, e_max: float, curvature: float, share: float) -> float:
    """A length with as many segments, within e_max, whose last segment is not a stub.

    A stub is light and stiff: the first thing in a simulation to become unstable.

    Args:
        table: the line.
        found: the fewest segments.
        e_max: metres.
        curvature: the line's largest, 1/m.
        share: of the others' length that the last segment should have at least.

    Returns:
        The longest such length, to about 1 %; if the last segment is shorter with all of them, the one where it is
        longest.
    """
    if found.count == 1:
        return found.length
    chains = _around(table, found.length, 1.1, e_max, curvature)
    within = (chains.deviation <= e_max) & (chains.counts == found.count)
    lengths, shares = np.append(chains.lengths[within], found.length), np.append(chains.share[within], 0.0)
    if len(lengths) == 1 or chains.share[-1] >= share:
        return found.length
    enough = shares >= share
    return float(lengths[enough].max() if enough.any() else lengths[np.argmax(shares)])


def closest_with(table: CurveTable, count: int, curvature: float) -> tuple[float, float] | None:
    """The chain of so many segments that deviates least: (length, deviation), metres; None if there is none."""
    if count == 1:
        chains = lay_chains(table, np.array([_reach(table) * (1.0 + 1e-9)]), np.inf, curvature)
        return float(chains.lengths[0]), float(chains.deviation[0])
    first = table.line.length / (count - 1.1)
    chains = lay_chains(table, 1.0 / np.linspace(1.0 / first, 1.1 * count / table.line.length, 96), np.inf, curvature)
    for _ in range(2):
        fits = np.flatnonzero(chains.counts == count)
        if len(fits) == 0:
            return None
        best = int(fits[np.argmin(chains.deviation[fits])])
        low, high = chains.lengths[max(best - 1, 0)], chains.lengths[min(best + 1, len(chains.lengths) - 1)]
        length, deviation = float(chains.lengths[best]), float(chains.deviation[best])
        chains = lay_chains(table, np.append(np.linspace(low, high, 16), length), np.inf, curvature)
    return length, deviation


def _around(table: CurveTable, length: float, beyond: float, e_max: float, curvature: float) -> Chains:
    """Chains with segments of this length, the last of them, and of lengths down to where there are more."""
    low = 1.0 / length
    grid = np.linspace(low + beyond / table.line.length, low, 64)
    return lay_chains(table, 1.0 / grid, e_max, curvature)


def equal_lengths(table: CurveTable, count: int) -> Array:
    """Lengths at which the line is cut into exactly so many segments, the last as long as the others.

    There is one, unless the joints jump as the length grows: (K,) metres, to about 1e-12, mostly K = 1.
    """
    if count == 1:
        return np.linalg.norm(table.points[:, -1:] - table.points[:, :1], axis=0)
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


def lay_chains(table: CurveTable, lengths: Array, e_max: float, curvature: float) -> Chains:
    """Chains of these segment lengths with their deviations, and which intervals between neighbours are out of reach.

    Args:
        table: the line.
        lengths: (B,) metres, in order.
        e_max: the deviation to compare with, metres.
        curvature: the line's largest, 1/m.
    """
    chains = trace(table, lengths)
    size = len(lengths)
    deviation, share = np.empty(size), np.empty(size)
    refuted = np.zeros(max(size - 1, 0), dtype=np.bool_)
    rows = max(2, _AT_ONCE // chains.u.shape[1])
    # Blocks share a row, so that no pair of neighbours is left out.
    for begin in range(0, max(size - 1, 1), rows - 1):
        part = slice(begin, begin + rows)
        u, n = chains.u[part], chains.counts[part]
        joints, tangents = table.with_tangent(u)
        far = deviations(table, u, joints)
        deviation[part] = far.distance.max(axis=1)
        row = np.arange(len(u))
        last = np.linalg.norm(joints[:, row, n] - joints[:, row, n - 1], axis=0)
        share[part] = last / np.where(n > 1, lengths[part], np.maximum(last, 1e-300))
        within = deviation[part] <= e_max
        if within.any():
            deviation[part][within] = deviations(table, u[within], joints[:, within], _PLACES).distance.max(axis=1)
        deviation[part][last < _NO_SEGMENT * table.line.length] = np.inf
        if len(u) > 1:
            refuted[begin : begin + len(u) - 1] = _refuted(
                table.step * u, joints, tangents, far, table.step * far.u, e_max, curvature
            )
    return Chains(lengths, chains.counts, deviation, share, refuted)


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
    lengths = np.maximum(np.sqrt(dot(chords, chords)), 1e-9)
    chords /= lengths
    # Chords in between have lengths in between, but for the last ones, which can be as long as the others before.
    slack = np.abs(np.diff(lengths, axis=0)) + np.abs(np.diff(lengths[:, 0]))[:, None]
    # kappa stretch^2 / 2 is how far the line leaves its tangent, kappa stretch^2 / 8 its chord.
    leave = 0.5 * curvature * (move_a**2 + move_b**2)
    moves = joints[:, 1:] - joints[:, :-1]
    result = np.zeros(len(arcs) - 1, dtype=np.bool_)
    for own, way in ((slice(None, -1), 1.0), (slice(1, None), -1.0)):
        direction, height, length, chord = far.direction[:, own], far.height[own], lengths[own], chords[:, own]
        rises = way * dot(moves[:, :, :-1], direction), way * dot(moves[:, :, 1:], direction)
        apart = np.maximum(
            np.maximum(rises[0], 0.0) + curvature / 8.0 * move_a**2,
            np.maximum(rises[1], 0.0) + curvature / 8.0 * move_b**2,
        )

        tangent_a, tangent_b = tangents[:, own, :-1], tangents[:, own, 1:]
        up_a, up_b = dot(tangent_a, direction), dot(tangent_b, direction)
        along_a, along_b = dot(tangent_a, chord), dot(tangent_b, chord)
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


def _reach(table: CurveTable) -> float:
    """The largest distance of the line to its start."""
    return float(np.linalg.norm(table.points - table.points[:, :1], axis=0).max())
