"""Centre lines with an exactly known truth: those of the paper's Table I, random ones, loops, coils, hoses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from dlogen.geometry.arc_length import cells
from dlogen.geometry.curvature import curvature_of
from dlogen.geometry.polyline import segment_lengths
from dlogen.geometry.vectors import dots, unit
from dlogen.types import Array
from dlogen.types.short_repr import ShortRepr

Curve = Callable[[Array, int], Array]


#: Gauss-Legendre nodes and weights on [0, 1]; 8 points are exact for polynomials of degree 15.
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(8) + np.array([[1.0], [0.0]])) / 2.0


_PANELS = 1024


_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False, repr=False)
class CentreLine(ShortRepr):
    """A curve in space, seen through its material coordinate s in [0, 1]: the arc length divided by the length.

    Attributes:
        name: what the curve is called in truth files.
        curve: (t (K,), derivative 0..2) -> (K, 3): the curve in a parameter t in [0, 1] of its own, metres.
        knots: (J,) values of t from 0 to 1 between which the curve is smooth (has all its derivatives).
        arc_length_parameter: whether t is s already.
    """

    name: str
    curve: Curve
    knots: Array = field(default_factory=lambda: np.array([0.0, 1.0]))
    arc_length_parameter: bool = False

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Panel ends t_i, arc length up to them, speed there."""
        pieces = -(-_PANELS // (len(self.knots) - 1))
        steps = np.arange(pieces) / pieces
        t = np.append((self.knots[:-1, None] + np.diff(self.knots)[:, None] * steps).ravel(), 1.0)
        lengths = self._arc(t[:-1], t[1:])
        return t, np.concatenate([[0.0], np.cumsum(lengths)]), self._speed(t)

    def _speed(self, t: Array) -> Array:
        speed: Array = np.linalg.norm(self.curve(t, 1), axis=-1)
        return speed

    def _arc(self, start: Array, end: Array) -> Array:
        """Arc length between parameters that lie in one panel: (K,), (K,) -> (K,)."""
        t = start[:, None] + (end - start)[:, None] * _NODES
        lengths: Array = (self._speed(t.ravel()).reshape(t.shape) @ _WEIGHTS) * (end - start)
        return lengths

    @cached_property
    def length(self) -> float:
        """Arc length, metres."""
        return float(self._table[1][-1])

    def parameter(self, s: npt.ArrayLike) -> Array:
        """The curve's own parameter t at the material coordinates s: (K,) -> (K,)."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        if self.arc_length_parameter:
            return s
        return _in_chunks(self._parameter, s)

    def _parameter(self, s: Array) -> Array:
        knots, arc, speed = self._table
        target = s * arc[-1]
        i, h, u = cells(arc, target)
        # Cubic Hermite interpolation of t over the arc length is near enough for two Newton steps to reach rounding.
        # Not that of `interpolated`: another last bit is another cloud, and other digits of what is measured on it.
        t = knots[i] + (knots[i + 1] - knots[i]) * u**2 * (3 - 2 * u)
        t += h * u * (1 - u) * ((1 - u) / speed[i] - u / speed[i + 1])
        for _ in range(2):
            t -= (arc[i] + self._arc(knots[i], t) - target) / self._speed(t)
        inside: Array = np.clip(t, 0.0, 1.0)
        return inside

    def __call__(self, s: npt.ArrayLike) -> Array:
        """Points at the material coordinates s: (K,) -> (K, 3), metres."""
        return _in_chunks(lambda t: self.curve(t, 0), self.parameter(s))

    def points(self, count: int = 1000) -> Array:
        """(count, 3) points even in arc length, both ends among them."""
        return self(np.linspace(0.0, 1.0, count))

    def tangents(self, s: npt.ArrayLike) -> Array:
        """Unit tangents: (K,) -> (K, 3)."""
        return unit(_in_chunks(lambda t: self.curve(t, 1), self.parameter(s)))

    def curvature(self, s: npt.ArrayLike) -> Array:
        """Curvature |f' x f''| / |f'|^3 (paper Eq. 16), 1/m: (K,) -> (K,)."""
        return _in_chunks(self._curvature, self.parameter(s))

    def _curvature(self, t: Array) -> Array:
        return curvature_of(self.curve(t, 1), self.curve(t, 2))

    def max_curvature(self) -> float:
        """The largest curvature, 1/m: one over the smallest radius of curvature."""
        s = np.linspace(0.0, 1.0, 20001)
        for _ in range(3):
            kappa = self.curvature(s)
            best = int(np.argmax(kappa))
            s = np.linspace(s[max(best - 1, 0)], s[min(best + 1, len(s) - 1)], 201)
        return float(kappa[best])

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Foot points: material coordinates (K,) and distances (K,), metres, of the points (K, 3) to the line."""
        from scipy.spatial import cKDTree

        # Coarse search over a dense polyline, then Newton on (f(s) - p) . f'(s) = 0 in arc length.
        count = 8192
        _, near = cKDTree(self.points(count)).query(points)
        start = near / (count - 1)
        s = start.copy()
        for _ in range(6):
            offset, tangent = self(s) - points, self.tangents(s)
            # d/ds of the above is 1 + (f - p) . (curvature vector) > 0 this side of the centre of curvature.
            slope = 1.0 + dots(offset, self._curvature_vector(s))
            step = dots(offset, tangent) / np.maximum(slope, 0.2)
            s = np.clip(s - step / self.length, start - 2 / count, start + 2 / count)
            s = np.clip(s, 0.0, 1.0)
        return s, np.linalg.norm(self(s) - points, axis=1)

    def _curvature_vector(self, s: Array) -> Array:
        t = self.parameter(s)
        first, second = self.curve(t, 1), self.curve(t, 2)
        squared = dots(first, first)[:, None]
        along = dots(first, second)[:, None]
        vectors: Array = (second - first * along / squared) / squared
        return vectors

    def moved(self, rotation: Array, translation: Array) -> CentreLine:
        """The line after a rigid motion x -> rotation x + translation: (3, 3) and (3,)."""

        def curve(t: Array, derivative: int) -> Array:
            value: Array = self.curve(t, derivative) @ np.asarray(rotation).T
            return value + translation if derivative == 0 else value

        return CentreLine(self.name, curve, self.knots, self.arc_length_parameter)


def _in_chunks(function: Callable[[Array], Array], values: Array) -> Array:
    """Apply to pieces of a long array, so that quadrature does not multiply its memory."""
    if len(values) <= _CHUNK:
        return function(values)
    return np.concatenate([function(values[i : i + _CHUNK]) for i in range(0, len(values), _CHUNK)])


def from_points(points: npt.ArrayLike, name: str = "points") -> CentreLine:
    """The smooth line through given points: interpolating cubic spline over the chord length.

    Args:
        points: (K, 3), K >= 2, metres, in order along the line; no two neighbours alike.
        name: name of the line.

    Raises:
        ValueError: fewer than two points, not finite, or neighbours in the same place.
    """
    from scipy.interpolate import CubicSpline

    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
        raise ValueError(f"a centre line needs at least two points with three coordinates, not {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError("a centre line needs finite coordinates")
    chords = segment_lengths(points)
    if (chords <= 1e-9 * chords.sum()).any():
        raise ValueError(
            f"point {int(np.argmin(chords)) + 2} of the centre line is in the same place as the one before"
        )
    t = np.concatenate([[0.0], np.cumsum(chords)])
    t /= t[-1]
    t[-1] = 1.0
    spline = CubicSpline(t, points)
    return CentreLine(name, lambda x, derivative: np.asarray(spline(x, derivative)), t)


def from_tangent(name: str, length: float, tangent: Curve) -> CentreLine:
    """The line of unit speed f(s) = length * integral of tangent, which starts at the origin.

    Args:
        name: name of the line.
        length: metres.
        tangent: (s (K,), derivative 0..1) -> (K, 3), unit vectors and their derivatives with respect to s.
    """
    nodes = np.linspace(0.0, 1.0, _PANELS + 1)

    def piece(start: Array, end: Array) -> Array:
        s = start[:, None] + (end - start)[:, None] * _NODES
        values = tangent(s.ravel(), 0).reshape(*s.shape, 3)
        steps: Array = np.einsum("ijk,j->ik", values, _WEIGHTS) * (end - start)[:, None] * length
        return steps

    upto = np.concatenate([np.zeros((1, 3)), np.cumsum(piece(nodes[:-1], nodes[1:]), axis=0)])

    def curve(s: Array, derivative: int) -> Array:
        if derivative > 0:
            return length * tangent(s, derivative - 1)
        i = np.clip((s * _PANELS).astype(np.intp), 0, _PANELS - 1)
        return upto[i] + piece(nodes[i], s)

    return CentreLine(name, curve, arc_length_parameter=True)
