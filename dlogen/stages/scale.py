"""How large things are in a raw cloud: spacing of the points, radius of the tube, noise. Needs no order and no start.

The radius is found in two steps. Around some fifty points of the cloud, neighbourhoods are grown until they are longer
than wide; their width tells the order of magnitude. Then a circle is fitted to the cross-section of each of them. A
circle fit asks for no full circumference, so that a tube that was seen from one side does as well. Where strands lie so
close together that no neighbourhood is longer than wide, the normals of the surface tell where the cross-sections are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.geometry.eigen3 import eigenvalues, smallest_axes
from dlogen.types import Array, BoolArray, IntArray

#: Size of the subset that is looked at.
_SAMPLE = 4000
#: Places where the cross-section is looked at, and how many points around each of them.
_PLACES = 48
_NEIGHBOURS = 144
#: Every so many points are looked at first; if the neighbours of these don't reach far enough, every 16th, and so on.
_THINNING = 4
#: Points that the cross-sections need for each radius of length.
_PER_RADIUS = 30.0
#: A neighbourhood counts as a stretch of a line if its variance along it is this many times that across.
_ELONGATION = 4.0
#: With fewer points than this, bends are taken for cross-sections.
_ENOUGH = 50
#: Patches that tell how thick the surface is, and the points of each.
_PATCHES, _PATCH = 240, 10
#: Fewest points of a neighbourhood that is judged, and of a cross-section.
_FEWEST = 8
#: Radii that are tried with normals: from so many spacings on, growing by this factor.
_RESOLVED, _GROWTH = 2.0, 1.3
#: What the circles must keep then: share of the places, noise and spread of the radii, relative to the radius.
_NEARLY_ALL, _THIN, _ALIKE = 0.8, 0.15, 0.06


@dataclass(frozen=True)
class Scale:
    """Sizes of the object in a cloud, metres.

    Attributes:
        spacing: median distance from a point to its nearest neighbour.
        radius: estimate of the radius of the tube (the given one, if one was given).
        radius_reliable: whether the cross-sections agree on a radius. If not, it is an upper bound at best.
        noise: standard deviation of the points about the circles that fit them; includes some curvature.
        coverage: share of the circumference that was seen, roughly: 1 full, 0.5 one side.
        line_share: share of the looked-at places where the cloud is longer than wide: near 1 for a tube, near 0 for
            a plane or a ball.
        per_radius: median number of points on a piece of the object that is one radius long.
        resolved: whether the points are dense enough to see a width at all; if not, they are beads on a string.
        round: whether the cross-sections are circles, within the noise: not those of strands side by side.
    """

    spacing: float
    radius: float
    radius_reliable: bool
    noise: float
    coverage: float
    line_share: float
    per_radius: float
    resolved: bool
    round: bool


def spatial_sample(points: Array, count: int) -> IntArray:
    """Indices of a subset of about `count` points that depends on the points alone, not on their order.

    A point is taken if a hash of its coordinates falls below a threshold. Exact duplicates are taken once. The indices
    are in lexicographic order of the coordinates, so that whatever is computed from them in sequence is the same for
    every order of the input, to the last bit.

    Args:
        points: (M, 3) the cloud.
        count: about how many; all if there are not more.

    Returns:
        (K,) indices.
    """
    index = thinned(points, count)
    first = points[index, 0]
    order = np.argsort(first)
    first = first[order]
    if (first[1:] != first[:-1]).all():
        return index[order]
    chosen = points[index]
    order = np.lexsort(chosen.T[::-1])
    chosen = chosen[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (chosen[1:] != chosen[:-1]).any(axis=1)
    return index[order[fresh]]


def thinned(points: Array, count: int) -> IntArray:
    """Indices, ascending, of about `count` points; which ones depends on each point alone, not on their order.

    Args:
        points: (M, 3) the cloud.
        count: about how many; all if there are not more.
    """
    if len(points) <= count:
        return np.arange(len(points))
    share, block = count / len(points), 65536
    return np.concatenate(
        [start + np.flatnonzero(_hash(points[start : start + block]) < share) for start in range(0, len(points), block)]
    )


def _hash(points: Array) -> Array:
    """A number in [0, 1) for each point, as good as random, from the bits of its coordinates (splitmix64 finaliser)."""
    # Adding zero turns -0.0 into 0.0, which has other bits.
    bits = (np.ascontiguousarray(points, dtype=np.float64) + 0.0).view(np.uint64)
    value = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for column, factor in ((1, 0xBF58476D1CE4E5B9), (2, 0x94D049BB133111EB)):
        value ^= value >> np.uint64(31)
        value += bits[:, column]
        value *= np.uint64(factor)
    value ^= value >> np.uint64(29)
    value *= np.uint64(0xBF58476D1CE4E5B9)
    value ^= value >> np.uint64(32)
    return (value >> np.uint64(11)).astype(np.float64) * 2.0**-53


def middle(points: Array) -> Array:
    """The middle of the box around points: (M, 3) -> (3,)."""
    columns = points.T.copy()  # numpy is slow along short rows
    result: Array = 0.5 * (columns.min(axis=1) + columns.max(axis=1))
    return result


def estimate_scale(points: Array, *, radius: float | None = None) -> Scale:
    """Spacing, radius and noise of a cloud of a tube, seen from all sides or from one.

    The noise may be up to about a third of the radius, a tenth of the points may be strays, and the density may vary
    along the object. Only a subset of large clouds is looked at.

    Args:
        points: (M, 3) finite points, metres, in any order.
        radius: the radius, where it is known, metres.

    Raises:
        FitError: fewer than four distinct points.
    """
    scale = _from_neighbourhoods(points, radius)
    return scale if scale.radius_reliable else _from_normals(points, scale.spacing) or scale


def _from_neighbourhoods(points: Array, radius: float | None) -> Scale:
    """The scale as neighbourhoods show it that are longer than wide."""
    sample = points[spatial_sample(points, _SAMPLE)]
    if len(sample) < 4:
        raise FitError(f"{len(sample)} distinct points are too few for a centre line", "four are the least")
    sample = sample - middle(sample)
    tree = cKDTree(sample)
    distance, index = tree.query(sample[:: -(-len(sample) // _PATCHES)], min(_PATCH, len(sample)))
    patch = sample[index] - sample[index].mean(axis=1, keepdims=True)
    thickness = np.sqrt(np.maximum(eigenvalues(_products(patch) / _PATCH)[0], 0.0))
    # On a surface the spacing goes with the root of the number of points.
    spacing = float(np.median(distance[:, 1])) * float(np.sqrt(len(sample) / max(len(points), len(sample))))

    places = np.unique(np.linspace(0, len(sample) - 1, _PLACES).astype(np.intp))
    found = _stretches(sample, tree, places)
    line_share = float(found.width.size / len(places))
    if not found.width.size:
        size = float(np.sqrt((sample**2).sum(axis=1).mean()))
        per_radius = float("nan") if radius is None else _expected_per_radius(radius, spacing)
        return Scale(spacing, radius or size, radius is not None, float("nan"), 1.0, line_share, per_radius, True, True)

    resolved = len(sample) >= _ENOUGH and float(found.resolved.mean()) > 0.5
    guess = radius or float(np.median(found.width))
    # The slabs need no more points than this for each radius.
    thinned = sample[:: max(1, int(float(np.median(found.per_length)) * guess / _PER_RADIUS))]
    if len(thinned) < len(sample):
        tree = cKDTree(thinned)
    fit = _cross_sections(tree, thinned, found, guess)
    for _ in range(2):
        if radius is not None or not fit.good.any():
            break
        previous, guess = guess, float(np.median(fit.radius[fit.good]))
        if abs(guess - previous) < 0.1 * previous:
            break
        fit = _cross_sections(tree, thinned, found, guess)
    good = fit.good
    per_radius = float(np.median(fit.per_length)) * guess * len(points) / len(thinned)
    if good.sum() < max(3, 0.2 * len(good)):
        if radius is not None:
            per_radius = _expected_per_radius(radius, spacing)
        return Scale(spacing, guess, radius is not None, float("nan"), 1.0, line_share, per_radius, resolved, True)
    noise = float(np.median(fit.noise[good]))
    estimate = float(np.median(fit.radius[good]))
    coverage = _coverage(float(np.median(fit.lopsided[good])))
    spread = float(np.median(np.abs(fit.radius[good] - estimate)))
    # Noise across the axis moves points outward on average.
    estimate -= min(noise**2 / (2.0 * estimate), 0.2 * estimate)
    # Neighbourhoods that were longer than wide from the first say nothing about a width.
    clear = noise < 0.12 * estimate or (noise < 0.45 * estimate and line_share > 0.5)
    # Noise thickens small patches of the surface, too; a bundle of strands does not.
    circular = noise < 0.15 * estimate or noise < 4.0 * float(np.median(thickness))
    reliable = (
        clear and circular and resolved and spread < 0.3 * estimate and coverage > 0.2 and float(good.mean()) > 0.4
    )
    return Scale(
        spacing,
        estimate if radius is None else radius,
        reliable or radius is not None,
        noise,
        coverage,
        line_share,
        per_radius,
        resolved,
        circular,
    )


def _coverage(lopsided: float) -> float:
    """Share of the circumference that was seen, from the distance of its centroid from the centre, in radii."""
    # Half the circumference has its centroid at 2 r / pi; less of it, farther out.
    return float(np.interp(lopsided, [0.0, 0.2, 2 / np.pi, 1.0], [1.0, 1.0, 0.5, 0.0]))


def _from_normals(points: Array, spacing: float) -> Scale | None:
    """The scale of strands that lie close together, from the normals of their surfaces; None if these show no tube.

    The normals around a place are across the axis (paper Eq. 6), and the axis is one radius away along the normal. So
    every radius that is tried has its cross-sections; it is right if the circles through nearly all of them have it.
    """
    sample = points[spatial_sample(points, 2 * _SAMPLE)]
    sample = sample - middle(sample)
    if len(sample) < _ENOUGH:
        return None
    tree = cKDTree(sample)
    distance, index = tree.query(sample, _PATCH)
    patch = sample[index] - sample[index].mean(axis=1, keepdims=True)
    normals = smallest_axes(_products(patch))
    places = np.unique(np.linspace(0, len(sample) - 1, _PLACES).astype(np.intp))
    smallest = _RESOLVED * float(np.median(distance[:, 1]))
    largest = 0.5 * float(np.ptp(sample, axis=0).max())
    best: tuple[float, float, _Circles] | None = None
    for radius in smallest * _GROWTH ** np.arange(int(np.log(max(largest / smallest, 1.0)) / np.log(_GROWTH)) + 1):
        fit, estimate = _with_radius(sample, tree, normals, places, float(radius))
        if abs(estimate - radius) > (_GROWTH - 1.0) * radius:
            continue
        fit, estimate = _with_radius(sample, tree, normals, places, estimate)
        noise = float(np.median(fit.noise[fit.good])) if fit.good.any() else np.inf
        spread = float(np.median(np.abs(fit.radius[fit.good] - estimate))) if fit.good.any() else np.inf
        kept = fit.good.mean() > _NEARLY_ALL and noise < _THIN * estimate and spread < _ALIKE * estimate
        if kept and (best is None or noise / estimate < best[0]):
            best = noise / estimate, estimate, fit
    if best is None:
        return None
    relative, estimate, fit = best
    return Scale(
        spacing,
        estimate * (1.0 - 0.5 * relative**2),
        True,
        relative * estimate,
        _coverage(float(np.median(fit.lopsided[fit.good]))),
        float(fit.good.mean()),
        float(np.median(fit.per_length)) * estimate * len(points) / len(sample),
        True,
        True,
    )


def _with_radius(
    sample: Array, tree: cKDTree, normals: Array, places: IntArray, radius: float
) -> tuple[_Circles, float]:
    """Circles through the cross-sections that a radius suggests, and the radius that they have: 0 if they have none."""
    around = _within(tree, sample[places], 1.5 * radius)
    inside = around < len(sample)
    near = normals[np.where(inside, around, 0)] * inside[:, :, None]
    direction = smallest_axes(_products(near))
    across = normals[places] - direction * np.einsum("pi,pi->p", normals[places], direction)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    # The normal has no sign: the axis is on the side where the surface is one radius from it, and nothing is nearer.
    centres = [sample[places] + side * radius * across for side in (1.0, -1.0)]
    votes = [_votes(sample, tree, centre, direction, radius) for centre in centres]
    centre = np.where((votes[0] >= votes[1])[:, None], *centres)
    even = np.ones(len(places))
    fit = _cross_sections(tree, sample, _Stretches(centre, direction, radius * even, even, even > 0.0), radius)
    return fit, float(np.median(fit.radius[fit.good])) if fit.good.any() else 0.0


def _votes(sample: Array, tree: cKDTree, centre: Array, direction: Array, radius: float) -> IntArray:
    """Points of each cross-section that are about a radius from its centre, less those that are nearer."""
    around = _within(tree, centre, 1.6 * radius)
    inside = around < len(sample)
    offset = sample[np.where(inside, around, 0)] - centre[:, None]
    along = np.einsum("pki,pi->pk", offset, direction)
    distance = np.sqrt(np.maximum(np.einsum("pki,pki->pk", offset, offset) - along**2, 0.0))
    inside &= np.abs(along) < radius
    votes: IntArray = (inside & (np.abs(distance - radius) < 0.3 * radius)).sum(axis=1) - (
        inside & (distance < 0.7 * radius)
    ).sum(axis=1)
    return votes


def _within(tree: cKDTree, places: Array, reach: float) -> IntArray:
    """(P, K) indices of the points around places; an index past the end where there are fewer."""
    index: IntArray = tree.query(places, min(_NEIGHBOURS, tree.n), distance_upper_bound=reach)[1]
    return index


def _products(vectors: Array) -> Array:
    """Sums of the products of vectors with themselves, as `eigenvalues` takes them: (P, K, 3) -> (6, P)."""
    result: Array = np.einsum("pki,pkj->ijp", vectors, vectors)[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return result


def _expected_per_radius(radius: float, spacing: float) -> float:
    """Points on a radius of length of a tube that is seen from all sides.

    The median distance of random points on a surface to their nearest neighbours is sqrt(ln 2 / (pi density)).

    Args:
        radius: of the tube, metres.
        spacing: median distance to the nearest neighbour, metres.
    """
    return 2.0 * float(np.log(2.0)) * (radius / max(spacing, 1e-6 * radius)) ** 2


@dataclass(frozen=True)
class _Stretches:
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


def _stretches(points: Array, tree: cKDTree, places: IntArray) -> _Stretches:
    """Grow the neighbourhood of each place until it is longer than wide.

    Every fourth point will do at first; where these are too few to see a width, all are looked at, and where the
    neighbourhoods have to be larger, fewer.
    """
    rows = np.zeros((len(places), 9))  # centre, direction, width, points per metre, resolved
    todo = np.arange(len(places))
    step = start = _THINNING if len(points) >= _THINNING * _NEIGHBOURS else 1
    while len(todo):
        thinned = points[::step]
        complete = len(thinned) <= _NEIGHBOURS
        near = cKDTree(thinned) if step > 1 else tree
        rows[todo] = _grow(thinned[near.query(points[places[todo]], min(_NEIGHBOURS, len(thinned)))[1]], step, complete)
        todo = todo[rows[todo, 6] == 0.0]
        step *= _THINNING
        if complete:
            break
    again = np.flatnonzero((rows[:, 6] > 0.0) & (rows[:, 8] == 0.0))
    if start > 1 and len(again):
        finer = _grow(points[tree.query(points[places[again]], _NEIGHBOURS)[1]], 1, False)
        seen = finer[:, 6] > 0.0
        rows[again[seen]] = finer[seen]
    rows = rows[rows[:, 6] > 0.0]
    return _Stretches(rows[:, :3], rows[:, 3:6], rows[:, 6], rows[:, 7], rows[:, 8] > 0.0)


def _grow(around: Array, step: int, complete: bool) -> Array:
    """Rows of `_stretches` from neighbours (P, K, 3) in the order of their distance.

    `step`: only every so many points were looked at; `complete`: there are no more neighbours.
    """
    total = around.shape[1]
    growth = (total / _FEWEST) ** (np.arange(16) / 15.0)
    sizes = np.unique(np.minimum(np.round(_FEWEST * growth).astype(np.intp), total))
    origin = around[:, 0, :]
    x, y, z = np.ascontiguousarray(np.moveaxis(around - origin[:, None, :], 2, 0))
    features = np.stack([x, y, z, x * x, x * y, y * y, x * z, y * z, z * z])
    sums = np.cumsum(np.add.reduceat(features, np.concatenate([[0], sizes[:-1]]), axis=2), axis=2) / sizes
    x, y, z = sums[:3]
    covariance = sums[3:] - np.stack([x * x, x * y, y * y, x * z, y * z, z * z])
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


@dataclass(frozen=True)
class _Circles:
    """Circles through cross-sections: radius, standard deviation about it, distance of the points' centroid from the
    centre in radii, points per length, and whether the fit can be used; (P,) each."""

    radius: Array
    noise: Array
    lopsided: Array
    per_length: Array
    good: BoolArray


#: What Tukey weights with a limit of three standard deviations leave of the standard deviation of normal noise.
_TUKEY = 0.73


def _cross_sections(tree: cKDTree, points: Array, found: _Stretches, guess: float) -> _Circles:
    """Fit circles to the points of a slab across each place, two `guess`es long, or four where points are few.

    Other strands and strays are left out by a limit on the distance first, by Tukey weights then.
    """
    centre, direction = found.centre, found.direction
    distance, index = tree.query(centre, min(_NEIGHBOURS, len(points)), distance_upper_bound=2.0 * np.sqrt(2.0) * guess)
    # Beyond the distance the query fills up with an index past the end.
    width = max(int(np.isfinite(distance).sum(axis=1).max()), 1)
    index = index[:, :width]
    inside = index < len(points)
    offset = points[np.where(inside, index, 0)] - centre[:, None, :]
    first, second = _across(direction)
    along, u, v = (np.einsum("pki,pi->pk", offset, axis) for axis in (direction, first, second))
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
    return _Circles(radius, noise, lopsided, count / (2.0 * half), good)


def _across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors across each unit vector: (P, 3) -> (P, 3), (P, 3)."""
    first = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
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
        return (weight * value).sum(axis=1) / total

    xx, yy, xy, xz, yz, zz = mean(x * x), mean(y * y), mean(x * y), mean(x * z), mean(y * z), mean(z * z)
    mz = xx + yy
    cov = xx * yy - xy * xy
    var = zz - mz * mz
    a2 = 4.0 * cov - 3.0 * mz * mz - zz
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
