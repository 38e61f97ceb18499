"""From the skeleton line to the joints of the chain: how long the segments are, and where (paper III.D, III.E).

Criteria:

- `paper`: Eq. 17 with the largest curvature of the line, or with one that is known beforehand.
- `fewest`: the fewest equal segments whose measured deviation stays within e_max (`fewest_segments`).
- `segments`, `segment_length`: as many, or as long, as somebody wishes; the deviation is what it is.

Placements: `on-curve` has the joints on the line (Eq. 18). `minimax` lets the inner joints of `fewest` leave it, so
that the line runs on both sides of the chain (`dlogen.stages.segmentation.minimax`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.curvature import max_curvature
from dlogen.geometry.polyline import segment_lengths
from dlogen.geometry.vectors import dots
from dlogen.stages.chain import deviation
from dlogen.stages.segmentation.curve_table import CurveTable, trace
from dlogen.stages.segmentation.fewest_segments import equal_lengths, fewest_segments
from dlogen.stages.segmentation.joints import TOLERANCE, place_joints
from dlogen.stages.segmentation.minimax import minimax_joints
from dlogen.stages.segmentation.segment_length import max_segment_length
from dlogen.stages.segmentation.specification import SegmentationSpec
from dlogen.types import FewerSegments, Joints, Segmentation, Skeleton

#: The deviation that the searches aim at, as a share of e_max; the rest is for their rounding.
_AIM = 1.0 - 1e-7

#: Searches, each of which aims at a little less, until what is measured on the line itself is within e_max.
_TRIES = 4

#: The search takes ten seconds at a thousand segments; no simulator takes more.
_MOST_SEARCHED = 2_000


def segment(line: Skeleton, e_max: float, spec: SegmentationSpec) -> Segmentation:
    """Joints of a chain for the line.

    Args:
        line: the skeleton line.
        e_max: largest deviation allowed, metres, > 0.
        spec: how.

    Returns:
        The joints with their deviation and, in `alternatives`, what the other criteria give: those that were worked
        out on the way, or all three.

    Raises:
        FitError: there would be more than 100,000 segments, or no length does what was asked for.
    """
    chosen = None
    if spec.segments is not None:
        chosen = _measured(line, "segments", "on-curve", _equal_segments(line, spec.segments))
    elif spec.segment_length is not None:
        chosen = _measured(line, "segment_length", "on-curve", place_joints(line, spec.segment_length))
    elif spec.bend_radius is not None:
        joints = place_joints(line, _eq_17(e_max, spec.bend_radius))
        chosen = _measured(line, "bend_radius", "on-curve", joints)
    elif spec.criterion == "paper":
        joints = place_joints(line, _eq_17(e_max, _smallest_radius(line)))
        chosen = _measured(line, "paper", "on-curve", joints)
    if chosen is not None and not spec.alternatives:
        return chosen

    allowed = _eq_17(e_max, _smallest_radius(line))
    about = line.length / allowed
    if about > _MOST_SEARCHED:
        raise FitError(
            f"e_max = {e_max:g} m means about {about:.3g} segments: too many to search for the fewest",
            "raise e_max, or set segmentation.criterion to paper",
            stage="segmentation",
        )
    found = _search(line, e_max, allowed, spec.min_last, minimax=spec.alternatives or spec.placement == "minimax")
    if chosen is None:
        chosen = next(item for item in found if (item.criterion, item.placement) == ("fewest", spec.placement))
    others = (item for item in found if (item.criterion, item.placement) != (chosen.criterion, chosen.placement))
    return replace(chosen, alternatives=tuple(others))


def _measured(
    line: Skeleton, criterion: str, placement: str, joints: Joints, fewer: FewerSegments | None = None
) -> Segmentation:
    """A segmentation with its deviation, measured on the line itself."""
    distance, s = deviation(line, joints)
    return Segmentation(criterion, placement, joints, distance, s, fewer)


def _eq_17(e_max: float, radius: float) -> float:
    # A chord as long as the diameter only touches the far side of its circle, which rounding can miss.
    return min(max_segment_length(e_max, radius), 2.0 * radius * (1.0 - 1e-6))


def _smallest_radius(line: Skeleton) -> float:
    bend = max_curvature(line)[0]
    return 1.0 / bend if bend > 0.0 else math.inf


def _search(line: Skeleton, e_max: float, allowed: float, min_last: float, *, minimax: bool) -> list[Segmentation]:
    """By Eq. 17 (`allowed`); with the fewest segments, joints on the line; and, if wanted, joints off the line."""
    table = CurveTable(line)
    found, aim = list[Segmentation](), e_max * _AIM
    for _ in range(_TRIES):
        found = _with_joints_on_curve(table, aim, allowed, min_last)
        over = found[-1].deviation - e_max
        if not over > 1e-9 * e_max:
            break
        # Of a line that is long beside e_max, the table is off by more than the share that is kept in reserve.
        aim -= 2.0 * over
    on_curve = found[-1]

    if minimax:
        off = minimax_joints(table, aim, on_curve.count)
        joints = off.joints or on_curve.joints
        n = len(joints.s) - 1
        # Of chains with one segment less it may have found none with equal segments: nothing can be said of them.
        least = off.tried.get(n - 1, math.inf)
        fewer = FewerSegments(n - 1, least, None, None) if math.isfinite(least) else None
        found.append(_measured(line, "fewest", "minimax", joints, fewer))
    return found


def _with_joints_on_curve(table: CurveTable, aim: float, allowed: float, min_last: float) -> list[Segmentation]:
    """By Eq. 17 (`allowed`), unless it has no segments for this line; with the fewest segments within `aim`."""
    line, found = table.line, list[Segmentation]()
    fewest = fewest_segments(table, aim, allowed, min_last)
    try:
        found.append(_measured(line, "paper", "on-curve", _on_curve(table, allowed)))
    except FitError:
        # Eq. 17 has no segments for a closed line that is tightly bent; there may be too many as well.
        if fewest is None:
            raise
    if fewest is None or (found and fewest.count > found[0].count):
        on_curve = replace(found[0], criterion="fewest")
    else:
        on_curve = _measured(line, "fewest", "on-curve", _on_curve(table, fewest.length))
        if fewest.fewer is not None:
            length, distance = fewest.fewer
            on_curve = replace(on_curve, fewer=FewerSegments(fewest.count - 1, distance, length, fewest.resolution))
    return [*found, on_curve]


def _on_curve(table: CurveTable, length: float) -> Joints:
    """Joints on the line at equal distances, from the table; made exact on the line itself."""
    line = table.line
    if math.isinf(length) or line.length > 10_000 * length:
        return place_joints(line, length)
    joints = _polished(line, table.parameter(trace(table, np.array([length])).u[0]), length)
    chords = segment_lengths(joints.positions)
    if joints.last_segment_length <= TOLERANCE or np.abs(chords[:-1] - length).max(initial=0.0) > TOLERANCE:
        return place_joints(line, length)
    return joints


def _polished(line: Skeleton, s: np.ndarray, length: float) -> Joints:
    """The joints nearest to these coordinates whose distances, but for the last, are l (Eq. 19).

    Newton's method on all joints at once. Each distance depends on its own two joints only, so that a step is a
    forward substitution.
    """
    s = s.copy()
    s[0], s[-1] = 0.0, 1.0
    for _ in range(10):
        points, slopes = line(s), line(s, 1)
        chords = np.diff(points, axis=0)
        sizes = np.linalg.norm(chords, axis=1)
        errors = (sizes - length)[:-1]
        if np.abs(errors).max(initial=0.0) < 1e-4 * TOLERANCE:
            break
        unit = chords / np.maximum(sizes, 1e-300)[:, None]
        before, after = (dots(unit, part).tolist() for part in (slopes[:-1], slopes[1:]))
        shift, shifts = 0.0, []
        for k, error in enumerate(errors.tolist()):
            if after[k] > 1e-6 * line.length:
                shift = (before[k] * shift - error) / after[k]
            shifts.append(shift)
        s[1:-1] = np.clip(s[1:-1] + shifts, 0.0, 1.0)
    points = line(s)
    last = float(np.linalg.norm(points[-1] - points[-2]))
    return Joints(s, points, length if len(s) > 2 else last, last)


def _equal_segments(line: Skeleton, count: int) -> Joints:
    """Exactly so many equal segments, the last one as well."""
    candidates = []
    if count == 1:
        single = _polished(line, np.array([0.0, 1.0]), math.inf)
        candidates = [(0.0, single)] if single.last_segment_length > TOLERANCE else []
    else:
        table = CurveTable(line)
        for length in equal_lengths(table, count):
            joints = _closed_up(table, float(length), count)
            if joints is not None:
                candidates.append((deviation(line, joints)[0], joints))
    if not candidates:
        raise FitError(
            f"no length cuts this line into exactly {count} equal segments: it turns too sharply for them",
            "try one segment more or less, or give segmentation.segment_length",
            stage="segmentation",
        )
    return min(candidates, key=lambda pair: pair[0])[1]


def _closed_up(table: CurveTable, length: float, count: int) -> Joints | None:
    """Joints with this number of segments, the length adjusted until the last segment has it too; None if it cannot."""
    u = trace(table, np.array([length])).u[0]
    if len(u) != count + 1:
        return None
    s = table.parameter(u)
    for _ in range(20):
        joints = _polished(table.line, s, length)
        rest = joints.last_segment_length - length
        if abs(rest) < 1e-3 * TOLERANCE:
            return joints
        # With every segment longer by d, the last one is shorter by about n d.
        length += rest / count
        s = joints.s
    return joints if abs(rest) < TOLERANCE else None
