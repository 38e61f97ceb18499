"""Shapes of synthetic objects: those of the paper's Table I, random ones, loops, coils, hoses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dlogen.evaluation.centre_line import CentreLine, Curve, from_tangent
from dlogen.types import Array

#: Smallest radius of curvature of a random line unless it is given, metres.
_BEND_RADIUS = 0.1

#: Random lines longer than this many bend radii run into themselves all too often.
_BENDS = 14.0


def _bent(t: Array, derivative: int) -> Array:
    w, zero = np.pi**derivative, np.zeros_like(t)
    angle = np.pi * t + derivative * np.pi / 2  # the n-th derivative of sin(x) is sin(x + n pi/2)
    return np.stack([w * np.sin(angle), 2 * w * np.cos(angle) - (derivative == 0), zero], axis=-1)


def _straight(t: Array, derivative: int) -> Array:
    direction, start = np.array([-0.3, 1.0, 0.0]), np.array([0.55, -1.0, 0.0])
    places: Array
    if derivative == 0:
        places = start + t[..., None] * direction
    else:
        places = np.broadcast_to(direction if derivative == 1 else np.zeros(3), (*t.shape, 3)).copy()
    return places


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
        angles: Array = (wave * amplitudes).sum(axis=2).T
        return angles

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

    return from_tangent("random", length, tangent)


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

    line = from_tangent("hose", length, tangent)
    box = line.points(2000)
    return line.moved(np.eye(3), -(box.min(axis=0) + box.max(axis=0)) / 2)


def shape_by_name(
    name: str,
    rng: np.random.Generator,
    *,
    diameter: float = 0.04,
    length: float | None = None,
    bend_radius: float | None = None,
) -> CentreLine:
    """The centre line of a shape; strands that pass each other have 1.05 diameters between their axes.

    Args:
        name: a key of `TABLE_I`, or random, loop, coil, hose.
        rng: for what is random.
        diameter: of the tube, metres.
        length: of random, loop, coil and hose, metres; None for the usual one.
        bend_radius: smallest radius of curvature of random and hose, metres; None for the usual one.

    Raises:
        ValueError: there is no such shape, or none of this size.
    """
    if name in TABLE_I:
        return centre_line(name)
    size: dict[str, Any] = {} if length is None else {"length": length}
    bend: dict[str, Any] = {} if bend_radius is None else {"min_bend_radius": bend_radius}
    if name == "loop":
        return loop_centre_line(**size, separation=1.05 * diameter)
    if name == "coil":
        return coil_centre_line(**size, separation=1.05 * diameter)
    if name == "hose":
        return hose_centre_line(**size, **bend)
    if name == "random":
        bend_radius = bend_radius or max(_BEND_RADIUS, (length or 0.0) / _BENDS)
        clearance = min(1.5 * diameter, bend_radius)
        return random_centre_line(rng, **size, min_bend_radius=bend_radius, clearance=clearance)
    known = ", ".join((*TABLE_I, "random", "loop", "coil", "hose"))
    raise ValueError(f"there is no shape {name!r}; known: {known}")
