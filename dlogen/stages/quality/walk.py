"""Findings about the sorting walk of the paper."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.vectors import unit
from dlogen.stages.quality.findings import CLOSED_RING, GAP, POINTS_NOT_REACHED
from dlogen.types import Array, BoolArray, Finding, Skeleton


def check_walk(line: Skeleton, radius: float, s: Array, on_tube: BoolArray, unreached: int) -> list[Finding]:
    """Findings about the paper's sorting walk, which knows nothing of gaps, branches and rings.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        s: (M,) foot coordinate of every point.
        on_tube: (M,) whether it counts as a point of the tube's surface.
        unreached: number of points that the walk did not reach.
    """
    findings = []
    share = unreached / len(s)
    if share > 0.02:
        findings.append(
            POINTS_NOT_REACHED.found(
                f"{100 * share:.0f} % of the points were not reached along the object: strays, a branch, a gap "
                "or a second object",
                "bad" if share > 0.15 else "doubtful",
            )
        )
    return [*findings, *_gaps(line, radius, s[on_tube]), *_closed(line, radius)]


def _gaps(line: Skeleton, radius: float, s: Array) -> list[Finding]:
    """Stretches without points that chance does not explain."""
    if len(s) < 2:
        return []
    order = np.sort(s)
    steps = np.diff(order)
    # Of M random points the largest gap is about ln(M) / M; half as much again happens once in hundreds of clouds.
    expected = (np.log(len(s)) + 6.0) * max(float(np.median(steps)) / np.log(2.0), 1.0 / len(s))
    wide = np.flatnonzero(steps > max(expected, 2.0 * radius / line.length))
    return [
        GAP.at(
            line,
            float(0.5 * (order[i] + order[i + 1])),
            f"no points over {1e3 * steps[i] * line.length:.0f} mm of the length: the line is a guess there",
            "doubtful",
        )
        for i in wide
    ]


def _closed(line: Skeleton, radius: float) -> list[Finding]:
    """A ring has no ends: they meet, and the line goes on from one into the other."""
    ends = line(np.array([0.0, 1.0]))
    tangents = unit(line(np.array([0.0, 1.0]), 1))
    gap = float(np.linalg.norm(ends[1] - ends[0]))
    if gap < max(3.0 * radius, 0.02 * line.length) and tangents[0] @ tangents[1] > 0.5 and line.length > 10.0 * radius:
        return [CLOSED_RING.at(line, 0.0, "the ends meet: a closed ring has no first and last joint", "bad")]
    return []
