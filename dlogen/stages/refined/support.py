"""Where along a curve the points of the object are: the curve is cut or extended to there."""

from __future__ import annotations

import numpy as np

from dlogen.errors import FitError
from dlogen.stages.refined.tube_curve import TubeCurve, arc_at, arc_table, reparametrised
from dlogen.types import Array, BoolArray, IntArray

#: The fewest intervals of a curve, and the points that each of them needs.
FEWEST_INTERVALS, POINTS_PER_INTERVAL = 6, 12

#: Points at an end that tell how densely they lie there.
_FEW = 10


def on_support(
    curve: TubeCurve,
    x: Array,
    inlier: BoolArray,
    radius: float,
    margin: float,
    spacing: float,
    most: int,
    over: float = 0.0,
) -> tuple[TubeCurve, Array]:
    """The curve cut or extended to where the points are and `margin` radii beyond, with knots `spacing` apart.

    Args:
        curve: near the points.
        x: (M,) their feet on it.
        inlier: (M,) which of them tell where the object is.
        radius: of the tube, metres.
        margin: in radii.
        spacing: of the knots, metres.
        most: the most intervals.
        over: a gap of so many radii before an end is none: the object goes on behind a strand that crosses it.

    Returns:
        The curve, and the feet on it.

    Raises:
        FitError: hardly any inliers.
    """
    arc = arc_table(curve)[1]
    whole, length = arc_at(arc, x), float(arc[-1])
    s = whole[inlier]
    if len(s) < 2:
        raise FitError("hardly any points near the backbone", "check r and units", stage="refine")
    bins = max(10, min(int(length / radius), len(s) // 15))
    counts = np.bincount(np.minimum((s * (bins / length)).astype(np.intp), bins - 1), minlength=bins)
    low, high = (place * length / bins for place in (_first_full(counts), bins - _first_full(counts[::-1])))
    everything = np.sort(s)
    s = everything[(everything >= low) & (everything <= high)]
    # Where points are sparse, the last one may be farther from the end.
    few = min(_FEW, len(s) - 1)
    reach = 8.0 * np.array([s[few] - s[0], s[-1] - s[-1 - few]]) / few
    # A bin may be emptier than its neighbours by chance: points that go on without a gap belong to the object.
    lone, longest = np.diff(everything), np.maximum(reach, over * radius)
    before = np.flatnonzero((lone > longest[0]) & (everything[1:] <= s[0]))
    behind = np.flatnonzero((lone > longest[1]) & (everything[:-1] >= s[-1]))
    s = everything[before[-1] + 1 if len(before) else 0 : behind[0] + 1 if len(behind) else len(everything)]
    low, high = min(low, float(s[0])), max(high, float(s[-1]))
    # Points that are farther apart than the object is thick are followed from one to the next.
    before, after = np.clip(reach, margin * radius, np.maximum(3.0 * radius, 0.25 * reach)).tolist()
    low, high = max(low, float(s[0]) - radius) - before, min(high, float(s[-1]) + radius) + after
    most = max(FEWEST_INTERVALS, min(most, len(s) // POINTS_PER_INTERVAL))
    intervals = int(np.clip(round((high - low) / spacing), FEWEST_INTERVALS, most))
    moved = reparametrised(curve, intervals, low, high)
    return moved, np.clip((whole - low) / moved.step, 0.0, float(intervals))


def _first_full(counts: IntArray) -> int:
    """The first bin that is no sliver of something else: a quarter as full as the ten after it usually are."""
    for i in range(len(counts)):
        inner = counts[i + 1 : i + 11]
        if counts[i] >= 3 and counts[i] >= 0.25 * np.median(inner[inner > 0]) if (inner > 0).any() else False:
            return i
    return 0
