"""Synthetic objects with an exactly known axis: centre lines, and points on the tube around them.

Centre lines are smooth curves with derivatives; arc lengths are integrated by Gauss-Legendre quadrature, so that the
truth is better by orders of magnitude than anything that is measured against it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Curve = Callable[[Array, int], Array]

#: Gauss-Legendre nodes and weights on [0, 1]; 8 points are exact for polynomials of degree 15.
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(8) + np.array([[1.0], [0.0]])) / 2.0
_PANELS = 1024
_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class CentreLine:
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
        return np.linalg.norm(self.curve(t, 1), axis=-1)

    def _arc(self, start: Array, end: Array) -> Array:
        """Arc length between parameters that lie in one panel: (K,), (K,) -> (K,)."""
        t = start[:, None] + (end - start)[:, None] * _NODES
        return (self._speed(t.ravel()).reshape(t.shape) @ _WEIGHTS) * (end - start)

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
        i = np.clip(np.searchsorted(arc, target, side="right") - 1, 0, len(arc) - 2)
        h = arc[i + 1] - arc[i]
        u = (target - arc[i]) / h
        # Cubic Hermite interpolation of t over the arc length is near enough for two Newton steps to reach rounding.
        t = knots[i] + (knots[i + 1] - knots[i]) * u**2 * (3 - 2 * u)
        t += h * u * (1 - u) * ((1 - u) / speed[i] - u / speed[i + 1])
        for _ in range(2):
            t -= (arc[i] + self._arc(knots[i], t) - target) / self._speed(t)
        return np.clip(t, 0.0, 1.0)

    def __call__(self, s: npt.ArrayLike) -> Array:
        """Points at the material coordinates s: (K,) -> (K, 3), metres."""
        return _in_chunks(lambda t: self.curve(t, 0), self.parameter(s))

    def points(self, count: int = 1000) -> Array:
        """(count, 3) points even in arc length, both ends among them."""
        return self(np.linspace(0.0, 1.0, count))

    def tangents(self, s: npt.ArrayLike) -> Array:
        """Unit tangents: (K,) -> (K, 3)."""
        first = _in_chunks(lambda t: self.curve(t, 1), self.parameter(s))
        return first / np.linalg.norm(first, axis=1, keepdims=True)

    def curvature(self, s: npt.ArrayLike) -> Array:
        """Curvature |f' x f''| / |f'|^3 (paper Eq. 16), 1/m: (K,) -> (K,)."""
        return _in_chunks(self._curvature, self.parameter(s))

    def _curvature(self, t: Array) -> Array:
        first, second = self.curve(t, 1), self.curve(t, 2)
        return np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1) ** 3

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
            slope = 1.0 + np.einsum("ij,ij->i", offset, self._curvature_vector(s))
            step = np.einsum("ij,ij->i", offset, tangent) / np.maximum(slope, 0.2)
            s = np.clip(s - step / self.length, start - 2 / count, start + 2 / count)
            s = np.clip(s, 0.0, 1.0)
        return s, np.linalg.norm(self(s) - points, axis=1)

    def _curvature_vector(self, s: Array) -> Array:
        t = self.parameter(s)
        first, second = self.curve(t, 1), self.curve(t, 2)
        squared = np.einsum("ij,ij->i", first, first)[:, None]
        along = np.einsum("ij,ij->i", first, second)[:, None]
        return (second - first * along / squared) / squared

    def moved(self, rotation: Array, translation: Array) -> CentreLine:
        """The line after a rigid motion x -> rotation x + translation: (3, 3) and (3,)."""

        def curve(t: Array, derivative: int) -> Array:
            value = self.curve(t, derivative) @ np.asarray(rotation).T
            return value + translation if derivative == 0 else value

        return CentreLine(self.name, curve, self.knots, self.arc_length_parameter)


def _in_chunks(function: Callable[[Array], Array], values: Array) -> Array:
    """Apply to pieces of a long array, so that quadrature does not multiply its memory."""
    if len(values) <= _CHUNK:
        return function(values)
    return np.concatenate([function(values[i : i + _CHUNK]) for i in range(0, len(values), _CHUNK)])


def _bent(t: Array, derivative: int) -> Array:
    w, zero = np.pi**derivative, np.zeros_like(t)
    angle = np.pi * t + derivative * np.pi / 2  # the n-th derivative of sin(x) is sin(x + n pi/2)
    return np.stack([w * np.sin(angle), 2 * w * np.cos(angle) - (derivative == 0), zero], axis=-1)


def _straight(t: Array, derivative: int) -> Array:
    direction, start = np.array([-0.3, 1.0, 0.0]), np.array([0.55, -1.0, 0.0])
    if derivative == 0:
        return start + t[..., None] * direction
    return np.broadcast_to(direction if derivative == 1 else np.zeros(3), (*t.shape, 3)).copy()


def _helical(t: Array, derivative: int) -> Array:
    w, offset = (3 * np.pi) ** derivative, 0.5 if derivative == 0 else 0.0
    angle = 3 * np.pi * t + derivative * np.pi / 2
    rise = (0.5 * t - 1.0, np.full_like(t, 0.5), np.zeros_like(t))[derivative]
    return np.stack([0.5 * w * np.sin(angle) + offset, 0.5 * w * np.cos(angle) + offset, rise], axis=-1)


def _helical_printed(t: Array, derivative: int) -> Array:
    value = _helical(t, derivative)
    value[..., 1] = value[..., 0]
    return value


TABLE_I: dict[str, Curve] = {
    "bent": _bent,
    "straight": _straight,
    "helical": _helical,
    "helical-printed": _helical_printed,
}


def centre_line(name: str) -> CentreLine:
    """A centre line of the paper's Table I, in metres.

    "helical" has a cosine in its second component, as the paper's figure shows. "helical-printed" is the formula as
    printed, with the same sine twice: a plane zigzag whose radius of curvature falls to 4 mm.

    Raises:
        KeyError: there is no such line.
    """
    return CentreLine(name, TABLE_I[name])


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
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if (chords <= 1e-9 * chords.sum()).any():
        raise ValueError(
            f"point {int(np.argmin(chords)) + 2} of the centre line is in the same place as the one before"
        )
    t = np.concatenate([[0.0], np.cumsum(chords)])
    t /= t[-1]
    t[-1] = 1.0
    spline = CubicSpline(t, points)
    return CentreLine(name, lambda x, derivative: np.asarray(spline(x, derivative)), t)


def _from_tangent(name: str, length: float, tangent: Curve) -> CentreLine:
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
        return np.einsum("ijk,j->ik", values, _WEIGHTS) * (end - start)[:, None] * length

    upto = np.concatenate([np.zeros((1, 3)), np.cumsum(piece(nodes[:-1], nodes[1:]), axis=0)])

    def curve(s: Array, derivative: int) -> Array:
        if derivative > 0:
            return length * tangent(s, derivative - 1)
        i = np.clip((s * _PANELS).astype(np.intp), 0, _PANELS - 1)
        return upto[i] + piece(nodes[i], s)

    return CentreLine(name, curve, arc_length_parameter=True)


def random_centre_line(
    rng: np.random.Generator | int,
    length: float = 1.4,
    min_bend_radius: float = 0.1,
    dimensions: int = 3,
    clearance: float = 0.0,
) -> CentreLine:
    """A smooth random line whose radius of curvature is nowhere below `min_bend_radius`.

    The tangent is (cos a cos b, sin a cos b, sin b) with a(s) and b(s) sums of a few sines; its curvature is at most
    sqrt(a'^2 + b'^2), which is scaled to 1 / min_bend_radius at its largest.

    Args:
        rng: generator or seed.
        length: metres.
        min_bend_radius: metres.
        dimensions: 3, or 2 for a line in the plane z = 0.
        clearance: if positive, lines are drawn until one keeps this distance from itself, metres; at most
            min_bend_radius, so that a bend alone never violates it.

    Raises:
        ValueError: out of range, or no such line was found.
    """
    if length <= 0 or min_bend_radius <= 0 or dimensions not in (2, 3) or not 0 <= clearance <= min_bend_radius:
        raise ValueError("length and bend radius must be positive, dimensions 2 or 3, clearance within the bend radius")
    rng = np.random.default_rng(rng)
    for _ in range(200):
        line = _random_line(rng, length, min_bend_radius, dimensions)
        if clearance == 0 or not _comes_near_itself(line, clearance):
            return line
    raise ValueError(f"found no line of {length:g} m that keeps {clearance:g} m from itself")


def _random_line(rng: np.random.Generator, length: float, min_bend_radius: float, dimensions: int) -> CentreLine:
    waves = np.arange(1, 6) * np.pi
    amplitudes = rng.normal(size=(2, 5)) / np.sqrt(waves)
    phases = rng.uniform(0.0, 2 * np.pi, size=(2, 5))
    start = rng.uniform(-np.pi, np.pi)
    if dimensions == 2:
        amplitudes[1] = 0.0

    def angles(s: Array, derivative: int) -> Array:
        """(2, K) the angles a and b, or their derivatives."""
        wave = np.sin(s[:, None, None] * waves + phases + derivative * np.pi / 2) * waves**derivative
        return (wave * amplitudes).sum(axis=2).T

    # The grid misses the peak of the fifth wave by less than 1e-5 of it; 0.1 % keeps the promise.
    steepest = np.linalg.norm(angles(np.linspace(0.0, 1.0, 4001), 1), axis=0).max() * 1.001
    amplitudes *= length / min_bend_radius / steepest

    def tangent(s: Array, derivative: int) -> Array:
        a, b = angles(s, 0)
        a = a + start
        if derivative == 0:
            return np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=-1)
        da, db = angles(s, 1)
        return np.stack(
            [
                -np.sin(a) * np.cos(b) * da - np.cos(a) * np.sin(b) * db,
                np.cos(a) * np.cos(b) * da - np.sin(a) * np.sin(b) * db,
                np.cos(b) * db,
            ],
            axis=-1,
        )

    return _from_tangent("random", length, tangent)


def _comes_near_itself(line: CentreLine, clearance: float) -> bool:
    """Whether two places that are more than 1.5 clearances apart along the line are nearer than one in space."""
    from scipy.spatial import cKDTree

    count = max(int(8 * line.length / clearance), 50)
    pairs = cKDTree(line.points(count)).query_pairs(clearance, output_type="ndarray")
    return bool((np.abs(pairs[:, 0] - pairs[:, 1]) * line.length / (count - 1) > 1.5 * clearance).any())


def loop_centre_line(length: float = 1.4, separation: float = 0.042) -> CentreLine:
    """A loop that crosses over itself: seen from above like a ribbon.

    The curve is ((t^3 - t) a, t^2 b, z(t)), which crosses at t = -1 and 1; z is level there, so that the axes of the
    two strands are `separation` apart. With 1.05 diameters they nearly touch.

    Args:
        length: metres.
        separation: distance between the axes of the strands where they cross, metres.
    """
    end = 1.65  # |t| at the ends

    def shape(scale: float) -> CentreLine:
        def curve(t: Array, derivative: int) -> Array:
            u = (2 * t - 1) * end
            x = (u**3 - u, 3 * u**2 - 1, 6 * u)[derivative]
            y = (u**2, 2 * u, np.full_like(u, 2.0))[derivative]
            z = ((3 * u - u**3) / 2, 1.5 * (1 - u**2), -3 * u)[derivative]
            value = np.stack([1.5 * scale * x, 1.3 * scale * y, separation / 2 * z], axis=-1)
            return value * (2 * end) ** derivative

        return CentreLine("loop", curve)

    return _scaled_to_length(shape, length)


def coil_centre_line(length: float = 1.4, separation: float = 0.042, turns: float = 2.5) -> CentreLine:
    """A coil whose neighbouring turns run side by side, `separation` apart along the coil's axis (a helix).

    Args:
        length: metres.
        separation: pitch of the helix: nearly the distance between the axes of neighbouring turns, metres.
        turns: number of turns.
    """
    pitch, angle = separation * turns, 2 * np.pi * turns
    if length <= pitch:
        raise ValueError("the coil is longer along its axis than the line: fewer turns or less separation")
    radius = float(np.sqrt(length**2 - pitch**2) / angle)

    def curve(t: Array, derivative: int) -> Array:
        phase, w = angle * t + derivative * np.pi / 2, radius * angle**derivative
        rise = (pitch * t, np.full_like(t, pitch), np.zeros_like(t))[derivative]
        return np.stack([w * np.cos(phase), w * np.sin(phase), rise], axis=-1)

    return CentreLine("coil", curve, arc_length_parameter=True)


def _scaled_to_length(shape: Callable[[float], CentreLine], length: float) -> CentreLine:
    """The member of a family of lines that has the given length (secant method; lengths grow nearly linearly).

    Raises:
        ValueError: there is none.
    """
    low, scale = 0.05 * length, 0.15 * length
    below = shape(low).length
    for _ in range(50):
        line = shape(scale)
        if abs(line.length - length) < 1e-13 * length or line.length == below:
            break
        low, below, scale = scale, line.length, scale + (length - line.length) * (scale - low) / (line.length - below)
    if scale <= 0 or abs(line.length - length) > 1e-9 * length:
        raise ValueError(f"there is no {line.name} of {length:g} m: make it longer, or the object thinner")
    return line


def hose_centre_line(length: float = 1.7, min_bend_radius: float = 0.145, s_min: float = 0.33) -> CentreLine:
    """The paper's hose (Table III, Fig. 8-9): an open C on a table whose sharpest bend is at s_min.

    Its curvature is the sum of two bumps (1 + cos) / 2 that don't overlap: one around s_min that turns by 170 degrees,
    with the given radius at its peak, and a weaker one of up to 100 degrees behind it. The line lies in the plane
    z = 0, its bounding box centred on the origin. With the default sizes it fits the view of a Kinect 80 cm above it.

    Args:
        length: metres.
        min_bend_radius: smallest radius of curvature, metres.
        s_min: where that is.

    Raises:
        ValueError: the first bend does not fit on the length.
    """
    if length <= 0 or min_bend_radius <= 0:
        raise ValueError("length and bend radius must be positive")
    turn = np.radians(170.0)
    half = turn * min_bend_radius / length  # the half width of a bump in s: its area is the turn
    if half > min(s_min, 0.95 - s_min):
        raise ValueError("the bend does not fit on this length: make it longer, or the bend radius smaller")
    back_half = (1.0 - s_min - half) / 2
    back_turn = min(np.radians(100.0), 0.8 * back_half * length / min_bend_radius)
    bumps = ((s_min, half, turn), (1.0 - back_half, back_half, back_turn))

    def tangent(s: Array, derivative: int) -> Array:
        angle, slope = np.full_like(s, -np.radians(15.0)), np.zeros_like(s)
        for centre, half, turn in bumps:
            x = np.clip((s - centre) / half, -1.0, 1.0)
            angle += turn * (1 + x + np.sin(np.pi * x) / np.pi) / 2
            slope += turn * (1 + np.cos(np.pi * x)) / 2 / half
        cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(s)
        if derivative == 0:
            return np.stack([cos, sin, zero], axis=-1)
        return np.stack([-sin * slope, cos * slope, zero], axis=-1)

    line = _from_tangent("hose", length, tangent)
    box = line.points(2000)
    return line.moved(np.eye(3), -(box.min(axis=0) + box.max(axis=0)) / 2)


@dataclass(frozen=True, eq=False)
class SyntheticCloud:
    """Points on a tube, with the truth about each of them.

    Attributes:
        points: (M, 3) metres.
        normals: (M, 3) true outward unit normals; NaN for stray points.
        s: (M,) true material coordinates; NaN for stray points.
        is_stray: (M,) which points do not belong to the tube.
        truth: the axis.
        radius: of the tube, metres.
    """

    points: Array
    normals: Array
    s: Array
    is_stray: BoolArray
    truth: CentreLine
    radius: float


def sample_tube(
    line: CentreLine,
    radius: float,
    count: int,
    rng: np.random.Generator | int,
    *,
    noise: float = 0.0,
    stray_fraction: float = 0.0,
    gaps: Sequence[tuple[float, float]] = (),
    density_ratio: float = 1.0,
    side: npt.ArrayLike | None = None,
    caps: bool = False,
) -> SyntheticCloud:
    """Random points on the surface of the tube around a line (the virtual clouds of the paper's IV.B).

    Points are uniform in arc length and in the angle around the axis.

    Args:
        line: the axis.
        radius: of the tube, metres.
        count: number of points, whatever the defects.
        rng: generator or seed.
        noise: standard deviation of each coordinate, metres.
        stray_fraction: share of the points that lie anywhere in the bounding box of the tube, padded by a tenth of
            its longest side.
        gaps: intervals (s0, s1) without points.
        density_ratio: density at s = 1 over density at s = 0; linear in between.
        side: (3,) direction in which a far viewer looks; only points whose surface faces them remain.
        caps: whether the flat ends have points, at the density of the rest.

    Raises:
        ValueError: a parameter out of range, or gaps that leave nothing.
    """
    if radius <= 0 or count < 0 or noise < 0 or not 0 <= stray_fraction <= 1 or density_ratio <= 0:
        raise ValueError("radius and density ratio must be positive, noise not negative, the stray fraction in [0, 1]")
    rng = np.random.default_rng(rng)
    strays = round(stray_fraction * count)
    s = _draw_coordinates(rng.random(count - strays), gaps, density_ratio)
    tangents = line.tangents(s)
    normals = _draw_normals(rng.random(count - strays), tangents, side)
    points = line(s) + radius * normals
    if caps:
        _put_on_caps(rng, line, radius, side, s, tangents, normals, points)
    points += rng.normal(scale=noise, size=points.shape) if noise else 0.0

    if strays:
        axis = line.points(2000)
        low, high = axis.min(axis=0) - radius, axis.max(axis=0) + radius
        pad = 0.1 * (high - low).max()
        points = np.concatenate([points, rng.uniform(low - pad, high + pad, size=(strays, 3))])
        normals = np.concatenate([normals, np.full((strays, 3), np.nan)])
        s = np.concatenate([s, np.full(strays, np.nan)])
        order = rng.permutation(count)
        points, normals, s = points[order], normals[order], s[order]
    return SyntheticCloud(points, normals, s, np.isnan(s), line, radius)


def _draw_coordinates(uniform: Array, gaps: Sequence[tuple[float, float]], ratio: float) -> Array:
    """Material coordinates with density 1 + (ratio - 1) s outside the gaps, by inversion: uniform (K,) -> (K,)."""
    edges = [0.0]
    for start, end in sorted(gaps):
        if not 0 <= start < end <= 1:
            raise ValueError(f"gap {start}:{end} is not an interval within [0, 1]")
        edges += [max(start, edges[-1]), max(end, edges[-1])]
    low, high = np.array(edges[::2]), np.array([*edges[1::2], 1.0])
    grow = ratio - 1.0

    def cumulative(s: Array) -> Array:
        return (s + grow * s**2 / 2) / (1 + grow / 2)

    mass = np.concatenate([[0.0], np.cumsum(cumulative(high) - cumulative(low))])
    if mass[-1] <= 0:
        raise ValueError("the gaps leave nothing of the object")
    kept = uniform * mass[-1]
    i = np.clip(np.searchsorted(mass, kept, side="right") - 1, 0, len(low) - 1)
    share = cumulative(low)[i] + kept - mass[i]
    if grow == 0:
        s = share
    else:
        s = (np.sqrt(1 + share * grow * (2 + grow)) - 1) / grow
    return np.clip(s, low[i], high[i])


def _draw_normals(uniform: Array, tangents: Array, side: npt.ArrayLike | None) -> Array:
    """Unit vectors across the tangents, at any angle or within the half circle that faces the viewer."""
    if side is None:
        # Any direction across will do, since the angle is uniform: start from the axis least along the tangent.
        towards = np.eye(3)[np.abs(tangents).argmin(axis=1)]
        angle = 2 * np.pi * uniform
    else:
        towards = np.broadcast_to(-_unit_vector(side), tangents.shape)
        angle = np.pi * (uniform - 0.5)
    across = towards - tangents * np.einsum("ij,ij->i", towards, tangents)[:, None]
    norm = np.linalg.norm(across, axis=1, keepdims=True)
    if (norm < 1e-9).any():
        raise ValueError("the viewer looks exactly along the object: choose another side")
    across /= norm
    return np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(tangents, across)


def _unit_vector(direction: npt.ArrayLike) -> Array:
    vector = np.asarray(direction, dtype=float)
    norm = np.linalg.norm(vector) if vector.shape == (3,) and np.isfinite(vector).all() else 0.0
    if norm == 0:
        raise ValueError("a direction needs three finite numbers, not all of them zero")
    return vector / norm


def _put_on_caps(
    rng: np.random.Generator,
    line: CentreLine,
    radius: float,
    side: npt.ArrayLike | None,
    s: Array,
    tangents: Array,
    normals: Array,
    points: Array,
) -> None:
    """Move a share of the points (in place) to the flat ends: as many as their part of the visible area."""
    ends = np.array([0.0, 1.0])
    outward = line.tangents(ends) * np.array([[-1.0], [1.0]])
    visible = np.ones(2, dtype=bool) if side is None else outward @ _unit_vector(side) < 0
    mantle = 2 * np.pi * radius * line.length * (1.0 if side is None else 0.5)
    cap = np.pi * radius**2 * visible
    which = rng.choice(3, size=len(s), p=np.array([mantle, *cap]) / (mantle + cap.sum())) - 1
    at = np.flatnonzero(which >= 0)
    end = which[at]
    # A direction across the end's tangent, drawn anew: the old one belongs to another tangent, or to half a circle.
    across = _draw_normals(rng.random(len(at)), outward[end], None)
    rho = radius * np.sqrt(rng.random((len(at), 1)))
    s[at] = ends[end]
    points[at] = line(ends)[end] + rho * across
    normals[at] = outward[end]


def truth(line: CentreLine, radius: float, settings: dict[str, Any], seed: int | None) -> dict[str, Any]:
    """What is known about a synthetic object, as it stands in a truth file.

    Schema `dlogen.truth/1`, all lengths in metres:
        schema: "dlogen.truth/1".
        units: "m", whatever the units of the cloud are.
        curve: name of the centre line.
        radius: of the tube.
        length: arc length of the centre line.
        points: [[x, y, z] x 1000] on the centre line, even in arc length, from end to end.
        settings: how the cloud was made.
        seed: of the random numbers, or null.

    Numbers are rounded to 1e-9 m, so that the last bit of another machine's sine does not show.
    """
    return {
        "schema": "dlogen.truth/1",
        "units": "m",
        "curve": line.name,
        "radius": radius,
        "length": round(line.length, 9),
        "settings": settings,
        "seed": seed,
        # Adding zero turns -0.0 into 0.0.
        "points": (np.round(line.points(1000), 9) + 0.0).tolist(),
    }


def truth_bytes(content: dict[str, Any]) -> bytes:
    """The truth file for `truth`: JSON with one point per line."""
    head = {key: value for key, value in content.items() if key != "points"}
    text = json.dumps(head, indent=2, ensure_ascii=False, allow_nan=False)
    rows = ",\n    ".join(json.dumps(point, allow_nan=False) for point in content["points"])
    return f'{text[:-2]},\n  "points": [\n    {rows}\n  ]\n}}\n'.encode()


def write_truth(
    path: str | Path, line: CentreLine, radius: float, settings: dict[str, Any] | None = None, seed: int | None = None
) -> None:
    """Write a truth file (schema: see `truth`), the same bytes for the same arguments."""
    from dlogen.io.atomic import write_all

    write_all({Path(path): truth_bytes(truth(line, radius, settings or {}, seed))})
