"""Joints on the skeleton line at equal chord lengths (paper III.E, Eq. 18-20, Fig. 5)."""

from __future__ import annotations

import math

import numpy as np

from dlogen.arclength import arc_length_table
from dlogen.errors import FitError
from dlogen.model import Array, Joints, Skeleton

#: Chord lengths are met to this many metres.
TOLERANCE = 1e-9

#: More segments than this is a mistake in the settings.
_MOST_SEGMENTS = 100_000


def place_joints(line: Skeleton, segment_length: float) -> Joints:
    """Joints x_i = f(s_i) (Eq. 18), each at the distance l from the last (Eq. 19), at the first such s (Eq. 20).

    The last joint is f(1); the last segment takes what is left.

    Args:
        line: the skeleton line.
        segment_length: l, metres; infinite gives one segment.

    Returns:
        n + 1 joints.

    Raises:
        FitError: l is so short that there would be more than 100,000 segments.
    """
    if line.length > _MOST_SEGMENTS * segment_length:
        raise FitError(
            f"a segment length of {segment_length:.3g} m means {line.length / segment_length:.0f} segments",
            "raise e_max",
            stage="joints",
        )
    search = _FirstCrossing(line)
    s, points = [0.0], [line(0.0)[0]]
    end = line(1.0)[0]
    while True:
        following = search(s[-1], points[-1], segment_length)
        # What is left over by less than the tolerance is no segment.
        if following is None or 1.0 - following <= TOLERANCE / line.length:
            break
        s.append(following)
        points.append(line(following)[0])
    s.append(1.0)
    points.append(end)
    positions = np.array(points)
    last = float(np.linalg.norm(positions[-1] - positions[-2]))
    return Joints(np.array(s), positions, segment_length if len(s) > 2 else last, last)


class _FirstCrossing:
    """Finds the first s beyond s_i at which f leaves the sphere around f(s_i).

    The distance to f(s_i) changes by no more than the arc length passed, so an interval of arc length h with the
    distances a and b at its ends, both below l, can hold a crossing only if (l - a) + (l - b) < h. Such intervals are
    halved, all others are passed over: no crossing can be missed, however short its excursion.
    """

    def __init__(self, line: Skeleton) -> None:
        self.line = line
        self.grid, self.length = arc_length_table(line, 2048)
        self.points = line(self.grid)

    def __call__(self, s: float, centre: Array, radius: float) -> float | None:
        start = int(np.searchsorted(self.grid, s, side="right"))
        if start >= len(self.grid) or math.isinf(radius):
            return None
        s_here = float(np.interp(s, self.grid, self.length))
        grid = np.concatenate([[s], self.grid[start:]])
        arc = np.concatenate([[s_here], self.length[start:]])
        distance = np.concatenate([[0.0], np.linalg.norm(self.points[start:] - centre, axis=1)])
        slack = radius - distance
        crossed = slack[1:] <= 0.0
        suspect = crossed | (slack[:-1] + slack[1:] < np.diff(arc) * (1.0 + 1e-6))
        for k in np.flatnonzero(suspect):
            found = self._inside(grid[k], grid[k + 1], arc[k + 1] - arc[k], slack[k], slack[k + 1], centre, radius)
            if found is not None:
                return found
        return None

    def _inside(
        self, low: float, high: float, arc: float, slack_low: float, slack_high: float, centre: Array, radius: float
    ) -> float | None:
        """The first crossing in (low, high]; `slack_low` > 0."""
        if slack_high <= 0.0 and arc < 1e-3 * radius:
            return self._root(low, high, centre, radius)
        if slack_high > 0.0 and (slack_low + slack_high >= arc * (1.0 + 1e-6) or arc < TOLERANCE):
            return None
        middle = 0.5 * (low + high)
        slack = radius - float(np.linalg.norm(self.line(middle)[0] - centre))
        half = 0.5 * arc
        if slack <= 0.0:
            return self._inside(low, middle, half, slack_low, slack, centre, radius)
        return self._inside(low, middle, half, slack_low, slack, centre, radius) or self._inside(
            middle, high, half, slack, slack_high, centre, radius
        )

    def _root(self, low: float, high: float, centre: Array, radius: float) -> float:
        """Newton steps on |f(s) - centre|^2 = l^2, kept inside the bracket by halving it."""
        s = 0.5 * (low + high)
        for _ in range(60):
            offset = self.line(s)[0] - centre
            distance = float(np.linalg.norm(offset))
            error = distance - radius
            if error > 0.0:
                high = s
            else:
                low = s
            if abs(error) < 0.01 * TOLERANCE:
                break
            slope = float(offset @ self.line(s, 1)[0]) / distance
            step = s - error / slope if slope > 0.0 else low
            s = step if low < step < high else 0.5 * (low + high)
        return s
