"""The skeleton line as a table of cubics, even in arc length: chains of many segment lengths are laid on it at once.

The search for the longest segment tries hundreds of lengths. On the line itself, joint by joint, each would take
milliseconds; here all of them take a step together. Coordinates come first in all arrays here, (3, ...): every sum
over a coordinate then runs over contiguous numbers, which is three times as fast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.vectors import column_dots
from dlogen.types import Array, IntArray, Skeleton

#: Cells of the first table, and most of any.
_CELLS, _MOST_CELLS = 1024, 65_536
#: The table may be off the line by this share of the line's length.
_ACCURACY = 1e-9
#: This many cells off a crossing a last Newton step is enough, and so many count as none.
_CLOSE, _LEAST = 1e-3, 1e-8
#: Shortest step of the search for a crossing, in cells. An excursion out of the sphere that is shorter can be
#: overlooked; it reaches out by less than a nanometre.
_LEAST_STEP = 0.02
#: Steps of that search at most.
_MOST_STEPS = 20_000
#: Joints that are laid at a time.
_STEPS = 64
#: Places that are worked on at a time: they stay in the processor's cache.
_AT_ONCE = 1 << 14


class CurveTable:
    """f as a cubic Hermite polynomial in each of `cells` pieces of equal arc length.

    Coordinates u run from 0 to `cells`.

    Args:
        line: the skeleton line.

    Attributes:
        cells: how many; as many as the accuracy needs (1e-9 of the length).
        step: arc length of a cell, metres.
        s: (cells + 1,) the line's own coordinate at the cells' ends.
        points: (3, cells + 1) the line there, metres.
        bend: the line's largest curvature, with a margin of 1 %, 1/m.
    """

    def __init__(self, line: Skeleton) -> None:
        self.line = line
        self._fill(_CELLS)
        middle = np.arange(0.5, self.cells, 1.0)
        error = float(np.linalg.norm(self(middle).T - line(self.parameter(middle)), axis=1).max())
        allowed = _ACCURACY * line.length
        if error > allowed > 0.0:
            # Of fourth order in the step, so the number of cells that will do is known.
            self._fill(min(_MOST_CELLS, int(np.ceil(_CELLS * (2.0 * error / allowed) ** 0.25))))

    def _fill(self, cells: int) -> None:
        self.cells = cells
        self.s = even_parameters(self.line, cells + 1)
        self.step = self.line.length / cells
        self._slopes = np.gradient(self.s)
        points, tangents = self.line(self.s), self.line(self.s, 1)
        speed = np.linalg.norm(tangents, axis=1, keepdims=True)
        tangents *= self.step / np.maximum(speed, 1e-12 * max(self.line.length, 1e-300))
        self.points = np.ascontiguousarray(points.T)
        rise, first, last = np.diff(self.points, axis=1), tangents[:-1].T, tangents[1:].T
        cubics = (self.points[:, :-1], first, 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise)
        # (12, cells + 1): the constant terms of x, y, z, the linear ones, ... The last cell is the line's end.
        self._cubics = np.zeros((12, cells + 1))
        self._cubics[:, :-1] = np.concatenate(cubics)
        self._cubics[:3, -1], self._cubics[3:6, -1] = self.points[:, -1], tangents[-1]
        second = 2.0 * np.stack([cubics[2], cubics[2] + 3.0 * cubics[3]])
        largest = float(np.sqrt((second**2).sum(axis=1).max()))
        self.bend = 1.01 * largest / max(self.step, 1e-300) ** 2

    def __call__(self, u: Array) -> Array:
        """Points: (...,) -> (3, ...), metres."""
        a, b, c, d, t = self._cell(u)
        d *= t
        d += c
        d *= t
        d += b
        d *= t
        d += a
        return d

    def with_tangent(self, u: Array) -> tuple[Array, Array]:
        """Points and unit tangents: (...,) -> (3, ...) twice."""
        # Horner's scheme for both at once (Knuth 4.6.4).
        a, b, c, d, t = self._cell(u)
        d *= t
        c += d
        b += c * t
        a += b * t
        c += d
        b += c * t
        b /= self.step
        return a, b

    def _cell(self, u: Array) -> tuple[Array, Array, Array, Array, Array]:
        """The coefficients at u, (3, ...) each, and the place in the cell, (...,)."""
        index = u.astype(np.intp)
        cubic = self._cubics.take(index, axis=1)
        return cubic[0:3], cubic[3:6], cubic[6:9], cubic[9:12], u - index

    def parameter(self, u: Array) -> Array:
        """The line's own coordinate s at u, within about 1e-9: (...,) -> (...,)."""
        index = np.minimum(u.astype(np.intp), self.cells - 1)
        t = u - index
        low, high, first, last = self.s[index], self.s[index + 1], self._slopes[index], self._slopes[index + 1]
        s = low + t * (first + t * (3.0 * (high - low) - 2.0 * first - last + t * (first + last - 2.0 * (high - low))))
        inside: Array = np.clip(s, low, high)
        return inside


@dataclass(frozen=True, eq=False)
class Traces:
    """Chains laid on a table, one for every segment length.

    Attributes:
        lengths: (B,) segment lengths, metres.
        u: (B, K + 1) places of the joints on the line; beyond a chain's last joint they stay at the end.
        counts: (B,) segments of each chain.
    """

    lengths: Array
    u: Array
    counts: IntArray


def trace(table: CurveTable, lengths: Array) -> Traces:
    """Joints at equal distances along the line (paper Eq. 18-20), for many distances at once.

    Args:
        table: the line.
        lengths: (B,) segment lengths, metres.
    """
    walk = Walk(table, lengths)
    columns = [np.zeros((len(lengths), 1))]
    everything = np.arange(len(lengths))
    while walk.going.any():
        columns.append(walk.advance(everything, _STEPS)[:, 1:])
    u = np.concatenate(columns, axis=1)
    return Traces(lengths, u[:, : walk.counts.max(initial=0) + 1], walk.counts)


class Walk:
    """Chains that are laid joint by joint, all of them at a time.

    Args:
        table: the line.
        lengths: (B,) segment lengths, metres.

    Attributes:
        counts: (B,) segments of each chain up to now.
        going: (B,) which chains have not come to the end; others can be stopped.
    """

    def __init__(self, table: CurveTable, lengths: Array) -> None:
        size = len(lengths)
        self.table = table
        self.counts = np.zeros(size, dtype=np.intp)
        self.going = np.ones(size, dtype=np.bool_)
        self._at = np.zeros(size)
        self._centre = np.repeat(table.points[:, :1], size, axis=1)
        self._reach = lengths / table.step
        self._passed = self._reach.copy()

    def advance(self, rows: IntArray, steps: int) -> Array:
        """Lay as many joints or fewer, until all chains are at the end.

        Args:
            rows: (R,) the chains; those that do not go stay where they are.
            steps: joints.

        Returns:
            (R, S + 1) places of the last joint before and of the new ones; a chain at the end stays there.
        """
        table, end = self.table, float(self.table.cells)
        columns = [self._at[rows]]
        inside = np.flatnonzero(self.going[rows])
        live = rows[inside]
        at, centre = self._at[live], self._centre[:, live]
        reach, passed = self._reach[live], self._passed[live]
        for _ in range(steps):
            if not len(live):
                break
            # Pieces are about as long as the ones before them.
            guess = at + np.minimum(np.maximum(passed, reach), 1.05 * reach)
            found, centre = _first_crossing(table, at, guess, centre, reach * table.step)
            passed, at = found - at, found
            self.counts[live] += 1
            column = columns[-1].copy()
            column[inside] = found
            # What is left over by less than a nanometre is no segment.
            on = (end - found) * table.step > 1e-9
            if not on.all():
                column[inside[~on]] = end
                self._at[live[~on]] = end
                self.going[live[~on]] = False
                live, inside, centre, at = live[on], inside[on], centre[:, on], at[on]
                reach, passed = reach[on], passed[on]
            columns.append(column)
        self._at[live], self._centre[:, live], self._passed[live] = at, centre, passed
        return np.stack(columns, axis=1)


def _first_crossing(table: CurveTable, start: Array, guess: Array, centre: Array, radius: Array) -> tuple[Array, Array]:
    """Where the line first leaves the sphere around its place `start`, and the point there; its end if it never does.

    Newton's method from the guess, and the slow way where the distance may not grow all the way there. The guess is
    at most 5 % farther than the sphere is.
    """
    end = float(table.cells)
    u, simple = np.minimum(guess, end), start + radius / table.step < end
    for attempt in range(4):
        point, tangent = table.with_tangent(u)
        offset = point - centre
        distance = np.sqrt(column_dots(offset, offset))
        gap = radius - distance
        slope = column_dots(offset, tangent) / np.maximum(distance, 1e-300)
        simple &= slope > 0.5
        off = np.abs(gap)
        if attempt == 0:
            simple &= off < 0.05 * radius
        near = off < _CLOSE * table.step
        move = gap / np.maximum(slope, 0.5)
        result = u + move / table.step
        if near[simple].all():
            break
        u = np.minimum(result, end)
    # A last step leaves less than rounding.
    simple &= near & (result <= end)
    tangent *= move
    place = point + tangent
    if not simple.all():
        slow = np.flatnonzero(~simple)
        result[slow], place[:, slow] = _march(table, start[slow], centre[:, slow], radius[slow])
    return result, place


def _march(table: CurveTable, start: Array, centre: Array, radius: Array) -> tuple[Array, Array]:
    """The same for any line.

    The distance d to the centre changes by no more than the arc length passed, and its slope by no more than
    kappa + 1 / d per arc length: the line can be followed for as long as it cannot have left the sphere by either bound
    (sphere tracing; Hart 1996). Newton steps finish it.
    """
    end = float(table.cells)
    result, place = np.full(len(start), end), np.repeat(table.points[:, -1:], len(start), axis=1)
    rows = np.flatnonzero(start + radius / table.step < end)
    start, centre, radius = start[rows], centre[:, rows], radius[rows]
    low, high = start, np.full(len(start), np.inf)
    u = start + radius / table.step
    for _ in range(_MOST_STEPS if len(rows) else 0):
        point, tangent = table.with_tangent(u)
        offset = point - centre
        distance = np.sqrt(column_dots(offset, offset))
        gap = (radius - distance) / table.step
        within = gap > 0.0
        low, high = np.where(within, u, low), np.where(within, high, u)
        done = (np.abs(gap) < _LEAST) | (low >= end) | (high - low < _LEAST)
        if done.any():
            result[rows[done]], place[:, rows[done]] = u[done], point[:, done]
            rest = ~done
            if not rest.any():
                break
            rows, u, centre, radius, gap = rows[rest], u[rest], centre[:, rest], radius[rest], gap[rest]
            low, high, offset, distance = low[rest], high[rest], offset[:, rest], distance[rest]
            tangent = tangent[:, rest]
        slope = column_dots(offset, tangent) / np.maximum(distance, 1e-300)
        newton = u + gap / np.where(np.abs(slope) > 1e-3, slope, 1e-3)
        # Before the sphere has been crossed, only where the distance is sure to grow all the way.
        near = (slope > 0.5) & (gap * table.step < 0.05 * radius)
        # Within half the distance to the centre, 1 / d doubles at most.
        most = table.bend + 2.0 / np.maximum(distance, 1e-300)
        safe = (np.sqrt(slope**2 + 2.0 * most * np.maximum(gap, 0.0) * table.step) - slope) / most / table.step
        safe = np.maximum(np.minimum(safe, 0.5 * distance / table.step), np.maximum(gap, _LEAST_STEP))
        forward = np.where(near, newton, low + safe)
        with np.errstate(invalid="ignore"):
            bracketed = np.where((newton > low) & (newton < high), newton, 0.5 * (low + high))
        u = np.minimum(np.where(np.isinf(high), forward, bracketed), end)
    return result, place


@dataclass(frozen=True, eq=False)
class Deviations:
    """How far pieces of the line are from their segments, each at its farthest place w.

    Attributes:
        distance: (...,) of w to the segment, metres.
        u: (...,) where w is on the line.
        height: (...,) distance of w to the straight line through the segment, metres.
        direction: (3, ...) unit vector from that line to w.
        along: (...,) the foot of w on that line: 0 is the segment's first end, 1 its last.
    """

    distance: Array
    u: Array
    height: Array
    direction: Array
    along: Array


def deviations(table: CurveTable, u: Array, joints: Array, places: int = 7) -> Deviations:
    """The distance of every piece of the line to its segment, at the farthest place that is found.

    Looks at some places in each piece, then for the peak near the farthest of them.

    Args:
        table: the line.
        u: (..., K + 1) where the pieces begin and end.
        joints: (3, ..., K + 1) the segments' ends, metres.
        places: 7 find the peak of a plain bow to 1e-6 of its height.
    """
    low, span = u[..., :-1], np.diff(u)
    start, axis = joints[..., :-1], np.diff(joints, axis=-1)
    squared_length = np.maximum(column_dots(axis, axis), 1e-300)
    inverse = 1.0 / squared_length
    # The places come before the pieces, so that what belongs to the pieces spreads over them.
    grid = np.linspace(0.0, 1.0, places + 2).reshape(-1, *[1] * low.ndim)
    some = max(1, _AT_ONCE // low.size)
    squares = np.concatenate(
        [
            _squared(table, low + grid[k : k + some] * span, start, axis, squared_length)
            for k in range(0, len(grid), some)
        ]
    )
    best = np.argmax(squares[1:-1], axis=0)[None] + 1
    left, top, right = (np.take_along_axis(squares, best + i, axis=0)[0] for i in (-1, 0, 1))
    width = span / (places + 1.0)
    bend = np.minimum(left + right - 2.0 * top, -1e-3 * top - 1e-300)
    middle = low + best[0] * width
    peak = np.clip(middle + np.clip(0.5 * (left - right) / bend, -1.0, 1.0) * width, low, low + span)
    # A Newton step on the slope, with the parabola's curvature, gains another three digits.
    point, tangent = table.with_tangent(peak)
    offset = point - start
    offset -= np.clip(column_dots(offset, axis) * inverse, 0.0, 1.0) * axis
    slope = 2.0 * table.step * column_dots(offset, tangent)
    peak = np.clip(peak - np.clip(slope * width / bend, -0.5, 0.5) * width, low, low + span)
    peak = np.where(_squared(table, peak, start, axis, squared_length) > top, peak, middle)

    offset = table(peak) - start
    along = column_dots(offset, axis) * inverse
    beyond = (along - np.clip(along, 0.0, 1.0)) ** 2 / inverse
    offset -= along * axis
    height = np.sqrt(column_dots(offset, offset))
    return Deviations(np.sqrt(height**2 + beyond), peak, height, offset / np.maximum(height, 1e-300), along)


def _squared(table: CurveTable, u: Array, start: Array, axis: Array, squared_length: Array) -> Array:
    """Squared distances of places on the line, (P, ...) or (...,), to segments, (...,)."""
    if u.ndim > squared_length.ndim:
        start, axis = start[:, None], axis[:, None]
    offset = table(u)
    offset -= start
    along = column_dots(offset, np.broadcast_to(axis, offset.shape))
    t = np.minimum(np.maximum(along / squared_length, 0.0), 1.0)
    # |offset - t axis|^2
    along *= 2.0
    along -= t * squared_length
    along *= t
    squares = column_dots(offset, offset)
    squares -= along
    return squares
