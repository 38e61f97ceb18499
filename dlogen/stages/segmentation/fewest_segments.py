"""The fewest equal segments, joints on the skeleton line, whose measured deviation the error allows.

Eq. 17 of the paper supposes the largest curvature everywhere. Here the deviation of the chain itself decides. It is not
monotone in the segment length: where longer segments end decides what they cut off. So all lengths are searched, by
branch and bound: an interval of lengths is given up only when some piece of the line is shown to be too far from its
segment for every length in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.stages.segmentation.curve_table import CurveTable, Traces, trace
from dlogen.stages.segmentation.lay import Chains, lay_chains, lay_while_possible, look_at
from dlogen.types import Array

#: Intervals of lengths that are still open at this share of the length count as settled by the chains at their ends.
RESOLUTION = 1e-6
#: First lengths for each segment that the chain can have, and bounds of their number.
_PER_SEGMENT, _LEAST, _MOST = 8, 64, 512
#: Chains with one segment less of which the nearest one is taken, about.
_CLOSEST = 24
#: Chains that a search lays at most; only a line full of hairpins comes near it.
_MOST_CHAINS = 50_000


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
    single = look_at(table, Traces(np.array([reach]), whole, np.ones(1, dtype=np.intp)), e_max)
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
        # The intervals have nothing to do with one another.
        apart = np.arange(1, grid.size) % (parts + 1) == 0
        chains = lay_while_possible(table, 1.0 / grid.ravel(), e_max, apart)
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
    return Fewest(count, length, _closest(table, tried, count - 1, best), resolution, laid)


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


def _closest(table: CurveTable, tried: list[Chains], count: int, best: float) -> tuple[float, float] | None:
    """Of the chains with so many segments the one that deviates least: (length, deviation), metres.

    Args:
        table: the line.
        tried: chains, some of which have not been laid to their ends.
        count: segments.
        best: length of the chain with one segment more that is within the deviation, metres.
    """
    lengths = np.unique(np.concatenate([chains.lengths for chains in tried]))
    # All but the last segment of such a chain fit into the line.
    lengths = lengths[(lengths >= best) & (count > 1 or lengths == lengths[-1])]
    lengths = lengths[lengths * (count - 1) < table.line.length * (1.0 + 1e-9)]
    if len(lengths) > _CLOSEST:
        some = np.append(np.arange(0, len(lengths) - 1, -(-len(lengths) // _CLOSEST)), len(lengths) - 1)
        counts = trace(table, lengths[some]).counts
        # Where the number is passed over between two of them, it is there if at all.
        fits = (counts[:-1] >= count) & (counts[1:] <= count)
        first, last = np.flatnonzero(fits)[[0, -1]] if fits.any() else (0, len(some) - 2)
        lengths = lengths[some[first] : some[last + 1] + 1]
        # The shortest ones deviate least as a rule.
        lengths = np.append(lengths[:_CLOSEST], lengths[_CLOSEST :: 1 + len(lengths) // _CLOSEST])
    if not len(lengths):
        return None
    chains = lay_chains(table, lengths, np.inf)
    of_count = (chains.counts == count) & np.isfinite(chains.deviation)
    if not of_count.any():
        return None
    lengths, deviation = lengths[of_count], chains.deviation[of_count]
    least = int(np.argmin(deviation))
    around = lengths[max(least - 1, 0)], lengths[min(least + 1, len(lengths) - 1)]
    chains = lay_chains(table, np.append(np.linspace(*around, 16), lengths[least]), np.inf)
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
