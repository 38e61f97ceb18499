"""Chains whose joints leave the skeleton line, so that it runs on both sides of them.

A chord lies on the inner side of a bend, all of it: its deviation is its whole sagitta. With its ends moved outwards by
half of that, the chain is half a sagitta off on either side, and segments may be sqrt(2) times as long on an arc.

For a given number of segments the joints are sought that make the largest deviation smallest, with all segments but the
last equal and the first and last joint at the line's ends: the p-norm of the deviations for growing p, by Newton's
method with the lengths as constraints. This is a local search; what it finds holds, but it does not prove that fewer
segments would not do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, solve_banded

from dlogen.geometry.segments import feet
from dlogen.geometry.vectors import column_dots
from dlogen.stages.segmentation.curve_table import CurveTable, deviations, trace
from dlogen.types import Array, Joints

#: The exponents and how many Newton steps each gets.
_EXPONENTS = (4, 4, 8, 8, 8, 16, 16, 16, 16, 32, 32, 32, 32, 64, 64, 64, 64)
#: Places of a piece whose distances count, as shares of it.
_PLACES = np.linspace(0.0, 1.0, 17)
#: An arc needs no fewer segments than this share of those with joints on it; bends of both senses a little fewer.
_SHARE = 0.66
#: A chain whose last segment has less of the line than this share of a segment's length is no better than one without.
_STUB = 0.05
#: Segment lengths are met to this many metres.
_TOLERANCE = 1e-12
#: Bandwidth of the Newton system, whose unknowns are a joint and the multiplier of its segment in turn.
_BAND = 7


@dataclass(frozen=True, eq=False)
class Minimax:
    """What the search found.

    Attributes:
        joints: of the chain with the fewest segments that was found; None if that is the one with joints on the line.
        tried: the smallest deviation that was found for each number of segments that was tried, metres.
    """

    joints: Joints | None
    tried: dict[int, float]


def minimax_joints(table: CurveTable, e_max: float, most: int) -> Minimax:
    """The fewest segments that the search finds whose chain is within e_max of the line.

    Args:
        table: the line.
        e_max: largest deviation allowed, metres.
        most: segments of a chain that does with its joints on the line.
    """
    tried: dict[int, float] = {}
    best: Joints | None = None
    # A few more segments always do where fewer do, nearly: bisection, from a number that is hardly enough.
    low, high = max(0, int(_SHARE * most) - 1), most
    while high - low > 1:
        middle = (low + high) // 2
        joints, tried[middle] = _attempt(table, e_max, middle)
        if joints is None:
            low = middle
        else:
            high, best = middle, joints
        if high - low == 1 and low > 0 and low not in tried:
            low -= 1
    return Minimax(best, tried)


def _attempt(table: CurveTable, e_max: float, count: int) -> tuple[Joints | None, float]:
    """Joints of a chain of so many segments within e_max, if they are found; the smallest deviation found."""
    smallest = np.inf
    for u in _starts(table, count):
        joints, reached = _Chain(table, u).improve(e_max)
        smallest = min(smallest, reached)
        if joints is not None:
            return joints, smallest
        if reached > 1.1 * e_max:
            break
    return None, smallest


def _starts(table: CurveTable, count: int) -> list[Array]:
    """Places of the joints of chains on the line to start from: the one nearest to the line, and a shifted one."""
    if count == 1:
        return [np.array([0.0, float(table.cells)])]
    length = table.line.length
    chains = trace(table, length / np.linspace(max(count - 1.1, 0.5), 1.1 * count + 1.0, 96))
    fits = np.flatnonzero(chains.counts == count)
    if len(fits) == 0:
        return []
    u = chains.u[fits, : count + 1]
    middle = 0.5 * (u[:, :-1] + u[:, 1:])
    joints = table(u)
    sagitta = table(middle) - 0.5 * (joints[..., :-1] + joints[..., 1:])
    order = np.argsort(column_dots(sagitta, sagitta).max(axis=1), kind="stable")
    return [u[order[0]], u[order[len(order) // 2]]]


class _Chain:
    """A chain that is being moved: joints x_0 .. x_n, the feet u of the joints on the line, and the length l."""

    def __init__(self, table: CurveTable, u: Array) -> None:
        self.table = table
        self.u = u.copy()
        self.x = table(self.u)
        self.length = float(np.linalg.norm(np.diff(self.x, axis=1), axis=0)[: max(len(u) - 2, 1)].mean())
        # Half the sagitta of a chord about each joint, outwards.
        half = np.minimum(0.5 * self.length / table.step, np.minimum(u, table.cells - u))
        self.x += 0.5 * (self.x - 0.5 * (table(u - half) + table(u + half)))
        self.last_is_long = False

    def improve(self, e_max: float) -> tuple[Joints | None, float]:
        """Newton steps until the chain is within e_max; the smallest deviation on the way."""
        smallest = np.inf
        if len(self.u) == 2:
            return self._within(e_max)
        for exponent in _EXPONENTS:
            try:
                self._step(exponent)
            except LinAlgError:
                break
            deviation = self._deviation()
            if deviation < 1.001 * smallest and self._uneven() < 0.01 * e_max:
                joints, reached = self._within(e_max)
                smallest = min(smallest, reached)
                if joints is not None:
                    return joints, smallest
        return None, smallest

    def _within(self, e_max: float) -> tuple[Joints | None, float]:
        """The chain with its lengths made exactly equal, if it is within e_max then, and its deviation."""
        keep = self.x.copy(), self.u.copy(), self.length
        if len(self.u) > 2:
            for _ in range(8):
                if self._uneven() < _TOLERANCE:
                    break
                self._step(None)
        pieces = float(deviations(self.table, self.u, self.x, 33).distance.max())
        deviation = max(pieces, self._apart())
        stub = float(np.diff(self.u).min()) * self.table.step < _STUB * self.length
        even = self._uneven() < 1e3 * _TOLERANCE and not stub
        joints = None
        if deviation <= e_max and even:
            s = self.table.parameter(self.u)
            s[0], s[-1] = 0.0, 1.0
            sizes = np.linalg.norm(np.diff(self.x, axis=1), axis=0)
            length = float(sizes[0])
            positions = np.ascontiguousarray(self.x.T)
            positions[[0, -1]] = self.table.line([0.0, 1.0])
            joints = Joints(s, positions, length, float(sizes[-1]))
        self.x, self.u, self.length = keep
        return joints, deviation if even else np.inf

    def _uneven(self) -> float:
        """By how much the lengths that ought to be equal differ, metres."""
        sizes = np.linalg.norm(np.diff(self.x, axis=1), axis=0)
        first = sizes[:-1] if len(sizes) > 1 else sizes
        beyond = max(0.0, float(sizes[-1] - first.max())) if len(sizes) > 1 else 0.0
        return float(np.ptp(first)) + beyond

    def _deviation(self) -> float:
        """The largest distance between pieces and segments, at a few places, and between joints and feet, metres."""
        _, residual = self._pieces()
        return max(float(np.sqrt(column_dots(residual, residual).max())), self._apart())

    def _apart(self) -> float:
        """The largest distance between a joint and its foot, metres."""
        return float(np.linalg.norm(self.x - self.table(self.u), axis=0).max())

    def _pieces(self) -> tuple[Array, Array]:
        """Feet on the segments, (P, n), and vectors from there to the line, (3, P, n)."""
        line = self.table(self.u[:-1] + _PLACES[:, None] * np.diff(self.u))
        t, residual = feet(np.moveaxis(line, 0, -1), self.x[:, :-1].T, np.diff(self.x, axis=1).T)
        return t, np.moveaxis(residual, -1, 0)

    def _step(self, exponent: int | None) -> None:
        """A Newton step on the p-norm of the deviations, or, without one, the least move that evens the lengths."""
        x, n = self.x, self.x.shape[1] - 1
        chord = np.diff(x, axis=1)
        sizes = np.linalg.norm(chord, axis=0)
        unit = chord / np.maximum(sizes, 1e-300)
        self.last_is_long |= bool(sizes[-1] > self.length)
        if exponent is None:
            own = np.repeat(np.eye(3)[:, :, None], n - 1, axis=2)
            across, gradient = np.zeros((3, 3, max(n - 2, 0))), np.zeros((3, n - 1))
        else:
            own, across, gradient = self._quadratic(exponent, unit)

        # Unknowns: x_1, lambda_1, x_2, lambda_2, ... and lambda_n where the last segment must not grow.
        constraints = n if self.last_is_long else n - 1
        size = 4 * (n - 1) + constraints - (n - 1)
        band = np.zeros((2 * _BAND + 1, size))
        joint = 4 * np.arange(n - 1)
        for a in range(3):
            for b in range(3):
                band[_BAND + a - b, joint + b] = own[a, b]
                # x_k in rows, x_{k+1} in columns, and the other way round.
                band[_BAND + a - 4 - b, joint[1:] + b] = across[a, b]
                band[_BAND + 4 + b - a, joint[:-1] + a] = across[a, b]
            # |x_k - x_{k-1}|: multiplier k in row 4 (k - 1) + 3.
            band[_BAND + 3 - a, joint + a] = unit[a, : n - 1]
            band[_BAND + a - 3, joint + 3] = unit[a, : n - 1]
            band[_BAND + 7 - a, joint[:-1] + a] = -unit[a, 1 : n - 1]
            band[_BAND + a - 7, joint[:-1] + 7] = -unit[a, 1 : n - 1]
            if self.last_is_long:
                # The last joint does not move: the multiplier of its segment takes its place.
                band[_BAND + 4 - a, joint[-1] + a] = -unit[a, n - 1]
                band[_BAND + a - 4, joint[-1] + 4] = -unit[a, n - 1]
        right = np.zeros((size, 2))
        multiplier = joint + 3
        if self.last_is_long:
            multiplier = np.append(multiplier, size - 1)
        for a in range(3):
            right[joint + a, 0] = -gradient[a]
        right[multiplier, 0] = self.length - sizes[:constraints]
        right[multiplier, 1] = 1.0
        solution = solve_banded((_BAND, _BAND), band, right, check_finite=False)
        if not np.isfinite(solution).all():
            raise LinAlgError
        sums = solution[multiplier].sum(axis=0)
        # The length is free: its multipliers' sum is zero.
        growth = -sums[0] / sums[1] if sums[1] != 0.0 else 0.0
        moves = solution[:, 0] + growth * solution[:, 1]
        move = np.stack([moves[joint + a] for a in range(3)])
        most = float(np.abs(move).max())
        scale = min(1.0, 0.25 * self.length / most) if most > 0.0 else 1.0
        self.x[:, 1:-1] += scale * move
        self.length += scale * growth
        self._find_feet()

    def _quadratic(self, exponent: int, unit: Array) -> tuple[Array, Array, Array]:
        """Second derivatives (3, 3, n - 1) and (3, 3, n - 2), and gradient (3, n - 1), of the sum of (distance)^p."""
        t, residual = self._pieces()
        feet, tangent = self.table.with_tangent(self.u[1:-1])
        apart = feet - self.x[:, 1:-1]
        distance, gap = np.sqrt(column_dots(residual, residual)), np.sqrt(column_dots(apart, apart))
        top = max(float(distance.max()), float(gap.max()), 1e-300)
        weight, joint_weight = (np.maximum(d / top, 1e-3) ** (exponent - 2) for d in (distance, gap))
        towards = residual / np.maximum(distance, 1e-300)

        def second(w: Array, direction: Array, free: Array) -> Array:
            """w ((p - 2) d d^T + I - c c^T): (3, 3, ...)."""
            return w * (
                (exponent - 2) * direction[:, None] * direction[None]
                + np.eye(3).reshape(3, 3, *[1] * w.ndim)
                - free[:, None] * free[None]
            )

        along = np.broadcast_to(unit[:, None], residual.shape)
        bend = second(weight, towards, along)
        first, last = 1.0 - t, t
        own = (bend * last**2).sum(axis=2)[..., :-1] + (bend * first**2).sum(axis=2)[..., 1:]
        across = (bend * (first * last)).sum(axis=2)[..., 1:-1]
        gradient = -(weight * last * residual).sum(axis=1)[:, :-1] - (weight * first * residual).sum(axis=1)[:, 1:]
        own += second(joint_weight, apart / np.maximum(gap, 1e-300), tangent)
        gradient -= joint_weight * apart
        stiff = 1e-7 * float(np.abs(own).max())
        own += stiff * np.eye(3)[:, :, None]
        return own, across, gradient

    def _find_feet(self) -> None:
        """The places on the line nearest to the joints, in their order."""
        u = self.u[1:-1]
        for _ in range(2):
            point, tangent = self.table.with_tangent(u)
            u = u + column_dots(self.x[:, 1:-1] - point, tangent) / self.table.step
            u = np.clip(u, 0.0, self.table.cells)
        self.u[1:-1] = np.maximum.accumulate(u)
