"""Circles through the cross-sections of a raw cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.eigen3 import eigenvalues, products, smallest_axes
from dlogen.geometry.vectors import dots, normals_to
from dlogen.types import Array, BoolArray, IntArray

NEIGHBOURS = 144

#: Every so many points are looked at first; if the neighbours of these don't reach far enough, every 16th, and so on.
_THINNING = 4

#: A neighbourhood counts as a stretch of a line if its variance along it is this many times that across.
_ELONGATION = 4.0

#: Fewest points of a neighbourhood that is judged, and of a cross-section.
_FEWEST = 8

#: What Tukey weights with a limit of three standard deviations leave of the standard deviation of normal noise.
_TUKEY = 0.73


@dataclass(frozen=True)
class Circles:
    """Circles through cross-sections: radius, standard deviation about it, distance of the points' centroid from the
    centre in radii, points per length, and whether the fit can be used; (P,) each."""

    radius: Array
    noise: Array
    lopsided: Array
    per_length: Array
    good: BoolArray


def cross_sections(tree: cKDTree, points: Array, found: Stretches, guess: float) -> Circles:
    """Fit circles to the points of a slab across each place, two `guess`es long, or four where points are few.

    Other strands and strays are left out by a limit on the distance first, by Tukey weights then.
    """
    centre, direction = found.centre, found.direction
    distance, index = tree.query(centre, min(NEIGHBOURS, len(points)), distance_upper_bound=2.0 * np.sqrt(2.0) * guess)
    # Beyond the distance the query fills up with an index past the end.
    width = max(int(np.isfinite(distance).sum(axis=1).max()), 1)
    index = index[:, :width]
    inside = index < len(points)
    offset = points[np.where(inside, index, 0)] - centre[:, None, :]
    first, second = across(direction)
    along, u, v = (dots(offset, axis[:, None]) for axis in (direction, first, second))
    inside &= u * u + v * v < (2.0 * guess) ** 2
    count = (inside & (np.abs(along) < guess)).sum(axis=1)
    half = np.where(count < 2 * _FEWEST, 2.0 * guess, guess)
    inside &= np.abs(along) < half[:, None]
    count = inside.sum(axis=1)
    weight = inside.astype(float)
    for _ in range(3):
        x, y, radius = _circle(u, v, weight)
        dx, dy = u - x[:, None], v - y[:, None]
        distance = np.sqrt(dx * dx + dy * dy)
        residual = distance - radius[:, None]
        total = np.maximum(weight.sum(axis=1), 1e-12)
        spread = np.sqrt((weight * residual**2).sum(axis=1) / total)
        limit = np.maximum(3.0 * spread, 0.1 * guess)[:, None]
        weight = np.where(inside & (np.abs(residual) < limit), (1.0 - (residual / limit) ** 2) ** 2, 0.0)
    total = np.maximum(weight.sum(axis=1), 1e-12)
    weight /= np.maximum(distance, 1e-300)
    lopsided = np.hypot((weight * dx).sum(axis=1), (weight * dy).sum(axis=1)) / total
    # Three numbers were fitted to n residuals.
    noise = spread / _TUKEY * np.sqrt(count / np.maximum(count - 3.0, 1.0))
    good = (count >= _FEWEST) & (radius > 0.3 * guess) & (radius < 2.5 * guess) & (noise < 0.6 * radius)
    return Circles(radius, noise, lopsided, count / (2.0 * half), good)


def across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors across each unit vector: (P, 3) -> (P, 3), (P, 3)."""
    first = normals_to(direction)
    return first, np.cross(direction, first)


def _circle(u: Array, v: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Weighted circle fits by Taubin's method (IEEE PAMI 13, 1991; moments and Newton steps after Chernov, "Circular
    and Linear Regression", 2010), which is nearly free of the bias towards small radii of the plain algebraic fit.

    Args:
        u, v, weight: (P, K).

    Returns:
        Centres u (P,), v (P,) and radii (P,).
    """
    total = np.maximum(weight.sum(axis=1), 1e-12)
    u0, v0 = (weight * u).sum(axis=1) / total, (weight * v).sum(axis=1) / total
    x, y = u - u0[:, None], v - v0[:, None]
    z = x * x + y * y

    def mean(value: Array) -> Array:
        mean: Array = (weight * value).sum(axis=1) / total
        return mean

    xx, yy, xy, xz, yz, zz = mean(x * x), mean(y * y), mean(x * y), mean(x * z), mean(y * z), mean(z * z)
    mz = xx + yy
    cov = xx * yy - xy * xy
    var = zz - mz * mz
    a2 = -3.0 * mz * mz - zz
    a1 = var * mz + 4.0 * cov * mz - xz * xz - yz * yz
    a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - var * cov
    root = np.zeros_like(mz)
    for _ in range(12):
        slope = a1 + root * (2.0 * a2 + 12.0 * mz * root)
        value = a0 + root * (a1 + root * (a2 + 4.0 * mz * root))
        root -= np.divide(value, slope, out=np.zeros_like(value), where=slope != 0.0)
    det = 2.0 * (root * root - root * mz + cov)
    scale = np.divide(1.0, det, out=np.zeros_like(det), where=np.abs(det) > 1e-300)
    cx = (xz * (yy - root) - yz * xy) * scale
    cy = (yz * (xx - root) - xz * xy) * scale
    return cx + u0, cy + v0, np.sqrt(np.maximum(cx * cx + cy * cy + mz, 0.0))


@dataclass(frozen=True)
class Stretches:
    """Neighbourhoods that are longer than wide, one for each place that has one.

    Attributes:
        centre: (P, 3) mean of the neighbourhood.
        direction: (P, 3) unit vector along it.
        width: (P,) radius of a tube with its variance across, which is r^2 / 2 in the direction in which a one-sided
            view is complete, too; metres.
        per_length: (P,) points per metre.
        resolved: (P,) whether there was a smaller neighbourhood that was not longer than wide.
    """

    centre: Array
    direction: Array
    width: Array
    per_length: Array
    resolved: BoolArray


def stretches(points: Array, tree: cKDTree, places: IntArray) -> Stretches:
    """Grow the neighbourhood of each place until it is longer than wide.

    Every fourth point will do at first; where these are too few to see a width, all are looked at, and where the
    neighbourhoods have to be larger, fewer.
    """
    rows = np.zeros((len(places), 9))  # centre, direction, width, points per metre, resolved
    todo = np.arange(len(places))
    step = start = _THINNING if len(points) >= _THINNING * NEIGHBOURS else 1
    while len(todo):
        thinned = points[::step]
        complete = len(thinned) <= NEIGHBOURS
        near = cKDTree(thinned) if step > 1 else tree
        rows[todo] = _grow(thinned[near.query(points[places[todo]], min(NEIGHBOURS, len(thinned)))[1]], step, complete)
        todo = todo[rows[todo, 6] == 0.0]
        step *= _THINNING
        if complete:
            break
    again = np.flatnonzero((rows[:, 6] > 0.0) & (rows[:, 8] == 0.0))
    if start > 1 and len(again):
        finer = _grow(points[tree.query(points[places[again]], NEIGHBOURS)[1]], 1, False)
        seen = finer[:, 6] > 0.0
        rows[again[seen]] = finer[seen]
    rows = rows[rows[:, 6] > 0.0]
    return Stretches(rows[:, :3], rows[:, 3:6], rows[:, 6], rows[:, 7], rows[:, 8] > 0.0)


def _grow(around: Array, step: int, complete: bool) -> Array:
    """Rows of `stretches` from neighbours (P, K, 3) in the order of their distance.

    `step`: only every so many points were looked at; `complete`: there are no more neighbours.
    """
    total = around.shape[1]
    growth = (total / _FEWEST) ** (np.arange(16) / 15.0)
    sizes = np.unique(np.minimum(np.round(_FEWEST * growth).astype(np.intp), total))
    origin = around[:, 0, :]
    x, y, z = np.ascontiguousarray(np.moveaxis(around - origin[:, None, :], 2, 0))
    features = np.stack([x, y, z, *products(x, y, z)])
    sums = np.cumsum(np.add.reduceat(features, np.concatenate([[0], sizes[:-1]]), axis=2), axis=2) / sizes
    covariance = sums[3:] - np.stack(products(*sums[:3]))
    _, middle, largest = eigenvalues(covariance)
    elongated = largest > _ELONGATION * middle
    # A few points are elongated by chance: it must last over the next sizes, too.
    after = np.concatenate([elongated[:, 1:], np.full((len(elongated), 2), complete)], axis=1)
    lasting = elongated & after[:, :-1] & after[:, 1:]
    at = np.argmax(lasting, axis=1)
    each = np.arange(len(around))
    direction = smallest_axes(-covariance[:, each, at])
    along, across = (np.sqrt(np.maximum(values[each, at], 1e-300)) for values in (largest, middle))
    width = np.where(lasting.any(axis=1), np.sqrt(2.0) * across, 0.0)
    per_length = step * sizes[at] / (2.0 * np.sqrt(3.0) * along)
    return np.column_stack([sums[:3, each, at].T + origin, direction, width, per_length, at > 0])
