"""Recordings of objects that move without stretching, with known material points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from dlogen.config.sections import JointSettings
from dlogen.evaluation.centre_line import CentreLine
from dlogen.sequence.captures import CaptureFit
from dlogen.sequence.rigid_links import Shape, equal_links, fit_links
from dlogen.sequence.shared_model import shared_model
from dlogen.sequence.trajectory import Motion, motion_of

Array = np.ndarray
#: (s (K,), t) -> angles a, b of the tangent (cos a cos b, sin a cos b, sin b).
Angles = Callable[[Array, float], tuple[Array, Array]]

LENGTH, RADIUS = 1.2, 0.012
_PANELS = 400
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(6) + np.array([[1.0], [0.0]])) / 2.0


def line(angles: Angles, t: float, middle: Array, length: float = LENGTH) -> CentreLine:
    """The object at the time t; s is material. The middle of its length is at `middle`."""

    def tangent(s: Array) -> Array:
        a, b = angles(s, t)
        return np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b) + 0 * a], axis=-1)

    knots = np.linspace(0, 1, _PANELS + 1)

    def piece(start: Array, end: Array) -> Array:
        s = start[:, None] + (end - start)[:, None] * _NODES
        values = tangent(s.ravel()).reshape(*s.shape, 3)
        return np.einsum("ijk,j->ik", values, _WEIGHTS) * (end - start)[:, None] * length

    upto = np.concatenate([np.zeros((1, 3)), np.cumsum(piece(knots[:-1], knots[1:]), axis=0)])
    shift = middle - upto[_PANELS // 2]

    def curve(s: Array, derivative: int) -> Array:
        if derivative == 0:
            i = np.clip((s * _PANELS).astype(int), 0, _PANELS - 1)
            return upto[i] + piece(knots[i], s) + shift
        if derivative == 1:
            return length * tangent(s)
        h = 1e-5
        return length * (tangent(s + h) - tangent(s - h)) / (2 * h)

    return CentreLine("moving", curve, arc_length_parameter=True)


def hose(seed: int, wild: float = 1.0) -> tuple[Angles, Callable[[float], Array]]:
    """A hose that is swung about by both ends: bends and turns as slow sums of waves in s and t."""
    rng = np.random.default_rng(seed)
    waves = np.arange(1, 5)
    amplitude = wild * rng.normal(size=(2, 4)) * [[1.6], [0.7]] / waves
    swing = rng.uniform(0.6, 1.4, size=(2, 4)) * 2 * np.pi
    phase = rng.uniform(0, 2 * np.pi, size=(2, 3, 4))
    drift = rng.normal(size=(2, 3)) * 0.15
    turn = rng.uniform(-1.5, 1.5)

    def angles(s: Array, t: float) -> tuple[Array, Array]:
        size = amplitude * (0.7 + 0.5 * np.sin(swing * t + phase[:, 0]))
        wave = np.sin(np.pi * waves * s[:, None, None] + phase[:, 1])
        a, b = (size * wave).sum(axis=2).T
        return a + turn * np.sin(2 * t), b

    return angles, lambda t: drift[0] * np.sin(3 * t) + drift[1] * t


def helix(seed: int = 0) -> tuple[Angles, Callable[[float], Array]]:
    """A helix that is wound up and screws about its axis."""
    return (
        lambda s, t: (2 * np.pi * (1.0 + 0.8 * np.sin(2.1 * t)) * s + 4.0 * t, 0.4 + 0.2 * np.cos(1.7 * t) + 0 * s),
        lambda t: np.array([0.0, 0.1 * np.sin(2 * t), 0.3 * t]),
    )


def whip(seed: int = 0) -> tuple[Angles, Callable[[float], Array]]:
    """A wave that runs along the object and grows towards its end, after a while at rest."""

    def angles(s: Array, t: float) -> tuple[Array, Array]:
        bump = np.exp(-(((s - 1.6 * (t - 0.6)) / 0.25) ** 2))
        return 1.4 * bump * (0.5 + s), 0.3 * np.sin(2 * s) + 0 * s

    return angles, lambda t: np.zeros(3)


def rod(seed: int = 0) -> tuple[Angles, Callable[[float], Array]]:
    """Nearly straight, turned by 360 degrees about its middle."""
    return lambda s, t: (np.pi * t + 0.05 * np.sin(3 * s), 0.02 * s), lambda t: np.zeros(3)


def loop(seed: int = 0) -> tuple[Angles, Callable[[float], Array]]:
    """A loop whose ends cross, rolling along."""

    def angles(s: Array, t: float) -> tuple[Array, Array]:
        return 2.4 * np.pi * (s - 0.3 * np.sin(2 * np.pi * s) / (2 * np.pi)) + 1.5 * np.sin(2 * t), 0.12 + 0 * s

    return angles, lambda t: np.array([0.2 * t, 0.0, 0.1 * np.sin(3 * t)])


def hairpin(seed: int = 0) -> tuple[Angles, Callable[[float], Array]]:
    """Folded in half, swung sideways by the distance of its strands from capture to capture (at 60 captures)."""

    def angles(s: Array, t: float) -> tuple[Array, Array]:
        return np.pi / (1 + np.exp(-(s - 0.5) / 0.02)), 0.05 * np.sin(2 * t) + 0 * s

    return angles, lambda t: np.array([0.0, 2.4 * t, 0.0])


MOTIONS = {"hose": hose, "helix": helix, "whip": whip, "rod": rod, "loop": loop, "hairpin": hairpin}


@dataclass(frozen=True)
class Recorded:
    """A recording and the truth about it."""

    times: Array
    lines: list[CentreLine]
    captures: list[CaptureFit]

    def truth(self, s: Array) -> Array:
        """(F, K, 3) material points."""
        return np.array([line(s) for line in self.lines])


def recorded(
    name: str,
    seed: int = 0,
    count: int = 60,
    *,
    noise: float = 0.0003,
    end_noise: float = 0.002,
    flips: bool = True,
    duration: float = 2.0,
) -> Recorded:
    """What single fits of a recording might give: smooth errors across, the ends a little off, any direction."""
    rng = np.random.default_rng([seed, 7])
    angles, middle = MOTIONS[name](seed)
    times = np.linspace(0.0, duration, count)
    lines = [line(angles, t, middle(t)) for t in times]
    captures = []
    for k, true in enumerate(lines):
        cut = rng.normal(scale=end_noise / LENGTH, size=2)
        s = np.linspace(max(0.0, cut[0]), min(1.0, 1 + cut[1]), 1000)
        waves = np.sin(np.pi * np.arange(1, 11) * s[:, None] + rng.uniform(0, 6.3, 10))
        points = true(s) + waves @ rng.normal(scale=noise / np.sqrt(5), size=(10, 3))
        if flips and rng.random() < 0.5:
            points = points[::-1]
        captures.append(observation(f"frame_{k:02d}", points, RADIUS * (1 + 0.01 * rng.normal())))
    return Recorded(times, lines, captures)


def observation(name: str, points: Array, radius: float = RADIUS, residual: float = 0.001) -> CaptureFit:
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return CaptureFit(name, points, length, radius, residual)


def fitted_chains(
    name: str, seed: int = 0, count: int = 14, captures: int = 60, **noise: float
) -> tuple[Array, Array, Array]:
    """Rigid links fitted to a recording: (F, n + 1, 3) joints, (n,) links, (F,) times."""
    made = recorded(name, seed, captures, flips=False, **noise)
    curves = np.array([item.points for item in made.captures])
    lengths = np.array([item.length for item in made.captures])
    links = equal_links(LENGTH, count)
    return fit_links(Shape(curves, lengths, LENGTH, 0.5 * (LENGTH - lengths)), links), links, made.times


@cache
def moved(name: str = "hose", dof: int = 2, zero: str = "straight", times: bool = True) -> Motion:
    """The motion of 30 captures, of which the fits of number 7 and of the last one failed."""
    made = recorded(name, 3, 30)
    captures = list(made.captures)
    captures[7] = CaptureFit("frame_07", None, problem="the file is empty")
    captures[29] = CaptureFit("frame_29", None, problem="the file is empty")
    at = made.times if times else None
    return motion_of(shared_model(captures, at), at, JointSettings(dof=dof, zero=zero))
