"""Clouds of strips, as depth cameras see ropes: a strip of pixels whose depth is noise that neighbours share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.evaluation.centre_line import from_points
from dlogen.types import Array


@dataclass(frozen=True, eq=False)
class Strip:
    """A strip before a camera at the origin that looks along z.

    Attributes:
        points: (M, 3) metres.
        axis: (K, 3) the true axis, metres.
        radius: metres.
    """

    points: Array
    axis: Array
    radius: float

    @property
    def length(self) -> float:
        """Of the axis, metres."""
        return float(np.linalg.norm(np.diff(self.axis, axis=0), axis=1).sum())


def wave(height: float = 0.5, amplitude: float = 0.08, length: float = 0.6) -> Array:
    """(K, 3) a line at one distance from the camera."""
    x = np.linspace(-0.5 * length, 0.5 * length, 2000)
    return np.stack([x, amplitude * np.sin(12.0 * x), np.full_like(x, height)], axis=1)


def loop(height: float = 0.5) -> Array:
    """(K, 3) a line that crosses itself once at a right angle, the later pass nearer to the camera."""
    t = np.linspace(-1.0, 1.0, 4000)
    x, y = 0.35 * (t**3 - 0.45 * t), 0.3 * (t**2 - 0.5)
    z = height - 0.009 * np.exp(-(((t - 0.67) / 0.08) ** 2))
    return np.stack([x, y, z], axis=1)


def strip(
    axis: Array,
    radius: float = 0.003,
    noise: float = 0.0012,
    shared: float = 0.012,
    pixel: float = 0.0006,
    seed: int = 0,
) -> Strip:
    """Pixels on a grid, in depth steps of 1 mm, with noise along the ray that is shared over a length.

    Args:
        axis: (K, 3) before the camera, metres.
        radius: of the object, metres.
        noise: standard deviation along the ray, metres.
        shared: length over which neighbours share it, metres.
        pixel: size at the distance of the object, metres.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    line = from_points(axis)
    places = np.arange(0.0, 1.0, 0.3 * pixel / line.length)
    middle = line(places)
    tangent = np.gradient(middle, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    away = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    sideways = np.cross(tangent, away)
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    waves = rng.normal(size=int(line.length / shared) + 3)
    smooth = np.interp(places * line.length / shared, np.arange(len(waves)), waves) * np.sqrt(1.5)
    rows = []
    for w in np.arange(-radius, radius, 0.3 * pixel):
        front = middle + w * sideways
        depth = np.linalg.norm(front, axis=1) - np.sqrt(radius**2 - w**2) + noise * smooth
        rows.append(front / np.linalg.norm(front, axis=1, keepdims=True) * depth[:, None])
    seen = np.concatenate(rows)
    # The pixels that the rays go through; of what lies behind one another, the camera sees the nearest.
    focal = 0.5 * (np.abs(axis[:, 2]).mean() / pixel) * 2.0
    column, row = np.round(seen[:, 0] / seen[:, 2] * focal), np.round(seen[:, 1] / seen[:, 2] * focal)
    order = np.lexsort((seen[:, 2], row, column))
    first = np.append(True, (np.diff(column[order]) != 0) | (np.diff(row[order]) != 0))
    kept = order[first]
    depth = np.round(seen[kept, 2], 3)
    points = np.stack([column[kept] / focal * depth, row[kept] / focal * depth, depth], axis=1)
    return Strip(points[rng.permutation(len(points))], axis, radius)
