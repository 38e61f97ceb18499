"""Joints on the skeleton line at equal chord lengths (paper III.E, Eq. 18-20, Fig. 5)."""

from __future__ import annotations

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.vectors import dots
from dlogen.types import Array, Joints, Skeleton

#: Chord lengths are met to this many metres.
TOLERANCE = 1e-9

#: More segments than this is a mistake in the settings.
_MOST_SEGMENTS = 100_000

#: Intervals that the line is cut into for the search: at least so many, and so many for each basis function.
_LEAST_INTERVALS, _PER_FUNCTION = 2048, 4


def place_joints(line: Skeleton, segment_length: float) -> Joints:
    """Joints x_i = f(s_i) (Eq. 18), each at the distance l from the last (Eq. 19), at the first such s (Eq. 20).

    The last joint is f(1); the last segment takes what is left.

    Args:
        line: the skeleton line.
        segment_length: l, metres; infinite gives one segment.

    Returns:
        n + 1 joints.

    Raises:
        FitError: l is so short that there would be more than 100,000 segments, or the line ends where its last
            segment starts.
    """
    if line.length > _MOST_SEGMENTS * segment_length:
        raise FitError(
            f"a segment length of {segment_length:.3g} m means more than {_MOST_SEGMENTS} segments",
            "raise e_max; if it is as it should be, the line bends far too tightly somewhere: the fit failed there",
            stage="joints",
        )
    # No two points of the line are farther apart than it is long.
    search = _FirstCrossing(line, min(segment_length, 2.0 * line.length))
    s, points = [0.0], [line(0.0)]
    end = line(1.0)
    while True:
        following = search(s[-1], points[-1])
        # What is left over by less than the tolerance is no segment.
        if following is None or 1.0 - following <= TOLERANCE / line.length:
            break
        s.append(following)
        points.append(line(following))
    s.append(1.0)
    points.append(end)
    positions = np.array(points)
    last = float(np.linalg.norm(positions[-1] - positions[-2]))
    if last < TOLERANCE:
        raise FitError(
            f"a loop at the end of the line is smaller than a segment of {segment_length:.3g} m: it starts and ends "
            "in one place",
            "lower e_max, so that segments get shorter",
            stage="joints",
        )
    return Joints(np.array(s), positions, segment_length if len(s) > 2 else last, last)


class _FirstCrossing:
    """Finds the first s beyond s_i at which f leaves the sphere of radius l around f(s_i).

    Looks at g(s) = |f(s) - f(s_i)|^2 - l^2 on small intervals of width h. If |g''| <= G there, g stays below the larger
    of its values at the ends plus G h^2 / 8: where that is negative there is no crossing. Where g rises by more than
    3/2 G h^2, then g' > G h at the lower end and g grows all along: a crossing is the only one. All other intervals
    are halved. So no crossing is missed, however short its excursion.
    """

    def __init__(self, line: Skeleton, radius: float) -> None:
        self.line, self.radius = line, radius
        self.count = max(_LEAST_INTERVALS, _PER_FUNCTION * line.basis.size)
        self.grid = np.linspace(0.0, 1.0, self.count + 1)
        self.points = line(self.grid)
        speed, change = (np.linalg.norm(line(self.grid, derivative), axis=1) for derivative in (1, 2))
        # The ends of an interval are samples: f'' may be larger within, but not twice as large on so fine a grid.
        most_change = 2.0 * np.maximum(change[:-1], change[1:])
        most_speed = np.maximum(speed[:-1], speed[1:]) + most_change / self.count
        # G >= |g''| = 2 | |f'|^2 + (f - f(s_i)) . f'' |, for intervals that reach into the sphere.
        self.limit = 2.0 * (most_speed**2 + (radius + most_speed / self.count) * most_change)

    def __call__(self, s: float, centre: Array) -> float | None:
        start = int(np.searchsorted(self.grid, s, side="right"))
        if start > self.count:
            return None
        grid = np.concatenate([[s], self.grid[start:]])
        offset = self.points[start:] - centre
        value = np.concatenate([[0.0], dots(offset, offset)]) - self.radius**2
        limit = self.limit[start - 1 :]
        highest = np.maximum(value[:-1], value[1:]) + limit * np.diff(grid) ** 2 / 8.0
        for k in np.flatnonzero(highest >= 0.0).tolist():
            found = self._inside(grid[k], grid[k + 1], value[k], value[k + 1], limit[k], centre)
            if found is not None:
                return found
        return None

    def _inside(
        self, low: float, high: float, value_low: float, value_high: float, limit: float, centre: Array
    ) -> float | None:
        """The first crossing in (low, high], where f(low) is inside the sphere."""
        width = high - low
        if max(value_low, value_high) + limit * width**2 / 8.0 < 0.0:
            return None
        narrow = width * self.line.length < TOLERANCE
        if value_high >= 0.0 and (narrow or value_high - value_low > 1.5 * limit * width**2):
            return self._root(low, high, value_low, value_high, centre)
        if narrow:
            return None
        middle = 0.5 * (low + high)
        value = self._value(middle, centre)
        found = self._inside(low, middle, value_low, value, limit, centre)
        if found is None and value < 0.0:
            found = self._inside(middle, high, value, value_high, limit, centre)
        return found

    def _value(self, s: float, centre: Array) -> float:
        """g(s)."""
        offset = self.line(s) - centre
        return float(offset @ offset) - self.radius**2

    def _root(self, low: float, high: float, value_low: float, value_high: float, centre: Array) -> float:
        """g = 0 in the bracket, by false position (the Illinois variant: an end that stays counts half)."""
        s = high
        for _ in range(100):
            s = low - value_low * (high - low) / (value_high - value_low)
            value = self._value(s, centre)
            # g is the distance from the sphere times 2 l.
            if abs(value) < 0.02 * TOLERANCE * self.radius:
                break
            if value > 0.0:
                high, value_high, value_low = s, value, 0.5 * value_low
            else:
                low, value_low, value_high = s, value, 0.5 * value_high
        return s
