"""Cables along a plane wave of 1.3 m of which less is seen, or more, than one side of one round object."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def wave(count: int = 4000) -> Array:
    """(count, 3) places along the wave in the plane z = 0, even in arc length."""
    x = np.linspace(0.0, 1.2, 4000)
    line = np.stack([x, 0.12 * np.sin(5.0 * x), np.zeros_like(x)], axis=1)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    even = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(even, along, column) for column in line.T], axis=1)


def sections(rng: np.random.Generator, side: Array, up: Array, hanging: bool = False) -> Array:
    """Points at random places of the wave, so far to the side of it and above it; bent up and down if it hangs."""
    line = wave()
    if hanging:
        line = line[:, [0, 2, 1]]
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross([0.0, 0.0, 1.0], tangent)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    at = rng.integers(0, len(line), len(side))
    return line[at] + side[:, None] * across[at] + up[:, None] * np.cross(tangent, across)[at]


def arc(
    radius: float, half: float, count: int = 8000, noise: float = 0.0, seed: int = 0, hanging: bool = False
) -> Array:
    """A tube around the wave of which so many degrees to each side of its top are seen."""
    rng = np.random.default_rng(seed)
    angle = np.radians(rng.uniform(-half, half, count))
    points = sections(rng, radius * np.sin(angle), radius * np.cos(angle), hanging)
    return points + noise * rng.normal(size=points.shape)


def oval(width: float, height: float, count: int = 6000, noise: float = 0.0, seed: int = 0) -> Array:
    """A cable with an elliptic section around the wave, seen from above."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-0.45 * np.pi, 0.45 * np.pi, count)
    points = sections(rng, 0.5 * width * np.sin(angle), 0.5 * height * np.cos(angle))
    return points + noise * rng.normal(size=points.shape)


def on_table(radius: float, edge: float, count: int = 6000, noise: float = 0.0, seed: int = 0) -> Array:
    """A tube around the wave, seen from above, and after its points those of so much of a table on either side."""
    rng = np.random.default_rng(seed)
    tube = arc(radius, 84.0, count, seed=seed)
    more = int(count * edge / radius)
    side = rng.choice([-1.0, 1.0], more) * (radius + edge * rng.random(more))
    points = np.concatenate([tube, sections(rng, side, np.full(more, -radius))])
    return points + noise * rng.normal(size=points.shape)


def two_views(radius: float, shift: float, count: int = 8000, noise: float = 0.0, seed: int = 0) -> Array:
    """A tube around the wave, seen from above and from below, where the views are pushed into each other by so much."""
    rng = np.random.default_rng(seed)
    above, below = (arc(radius, 84.0, count // 2, seed=seed + more) for more in (0, 100))
    above[:, 2] -= 0.5 * shift
    points = np.concatenate([above, below * [1.0, 1.0, -1.0] + [0.0, 0.0, 0.5 * shift]])
    return points + noise * rng.normal(size=points.shape)
