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
from dlogen.geometry.sampling import middle, spatial_sample
from dlogen.geometry.vectors import dots, unit
from dlogen.stages.cross_sections import NEIGHBOURS, Circles, Stretches, cross_sections, stretches
from dlogen.types import Array, IntArray

#: Size of the subset that is looked at; so many times as many points where these are too few to see a width.
_SAMPLE, _MORE = 4000, 4
#: Patches of a subset are elongated, by the ratio of their variances, where it shows no width.
_STRING = 3.0
#: Places where the cross-section is looked at, and how many points around each of them.
_PLACES = 48
#: Points that the cross-sections need for each radius of length.
_PER_RADIUS = 30.0
#: With fewer points than this, bends are taken for cross-sections.
_ENOUGH = 50
#: Patches that tell how thick the surface is, and the points of each.
_PATCHES, _PATCH = 240, 10
#: Points whose patches are thinner than this, in spacings, lie on a line.
_FLAT = 0.05
#: Radii that are tried with normals: from so many spacings on, growing by this factor.
_RESOLVED, _GROWTH = 2.0, 1.3
#: Every so many places are looked at first.
_SCREENED = 2
#: Share of the places with neighbourhoods longer than wide from which on strands are apart, and the largest radius that
#: is tried then, in half widths: a sixth of the circumference may be all that was seen.
_APART, _WIDEST = 0.8, 3.0
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
        thickness: median standard deviation of small patches across themselves, metres: small on a surface.
        half_width: of the neighbourhoods that are longer than wide, as of a strip that is covered evenly, metres.
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
    thickness: float = float("nan")
    half_width: float = float("nan")


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
    if scale.radius_reliable:
        return scale
    # Where neighbourhoods are longer than wide, they are single strands, or bundles whose strands are half as wide at
    # most. Normals say nothing of noise that is thicker than these may be.
    apart = scale.line_share > _APART and np.isfinite(scale.half_width)
    if apart and scale.thickness > 0.5 * _THIN * scale.half_width:
        return scale
    return _from_normals(points, scale.spacing, _WIDEST * scale.half_width if apart else np.inf) or scale


def _from_neighbourhoods(points: Array, radius: float | None) -> Scale:
    """The scale as neighbourhoods show it that are longer than wide."""
    wanted = _SAMPLE
    while True:
        sample = points[spatial_sample(points, wanted)]
        if len(sample) < 4:
            raise FitError(f"{len(sample)} distinct points are too few for a centre line", "four are the least")
        sample = sample - middle(sample)
        tree = cKDTree(sample)
        distance, index = tree.query(sample[:: -(-len(sample) // _PATCHES)], min(_PATCH, len(sample)))
        patch = sample[index] - sample[index].mean(axis=1, keepdims=True)
        across, along, longest = eigenvalues(_products(patch) / _PATCH)
        # Of an object thousands of radii long, so few points are beads on a string.
        if wanted > len(points) // 2 or not np.median(longest / np.maximum(along, 1e-300)) > _STRING:
            break
        wanted *= _MORE
    thick = float(np.median(np.sqrt(np.maximum(across, 0.0))))
    # On a surface the spacing goes with the root of the number of points.
    spacing = float(np.median(distance[:, 1])) * float(np.sqrt(len(sample) / max(len(points), len(sample))))

    places = np.unique(np.linspace(0, len(sample) - 1, _PLACES).astype(np.intp))
    found = stretches(sample, tree, places)
    line_share = float(found.width.size / len(places))
    if not found.width.size:
        size = float(np.sqrt((sample**2).sum(axis=1).mean()))
        per_radius = float("nan") if radius is None else _expected_per_radius(radius, spacing)
        return Scale(spacing, radius or size, radius is not None, float("nan"), 1.0, line_share, per_radius, True, True)

    resolved = len(sample) >= _ENOUGH and float(found.resolved.mean()) > 0.5
    guess = radius or float(np.median(found.width))
    # `width` takes a variance of r^2 / 2 across; a strip has h^2 / 3.
    half_width = float(np.sqrt(1.5)) * float(np.median(found.width))
    # The slabs need no more points than this for each radius.
    thinned = sample[:: max(1, int(float(np.median(found.per_length)) * guess / _PER_RADIUS))]
    if len(thinned) < len(sample):
        tree = cKDTree(thinned)
    fit = cross_sections(tree, thinned, found, guess)
    for _ in range(2):
        if radius is not None or not fit.good.any():
            break
        previous, guess = guess, float(np.median(fit.radius[fit.good]))
        if abs(guess - previous) < 0.1 * previous:
            break
        fit = cross_sections(tree, thinned, found, guess)
    good = fit.good
    per_radius = float(np.median(fit.per_length)) * guess * len(points) / len(thinned)
    if radius is not None and not per_radius > 0.0 and thick > _FLAT * spacing:
        # No cross-section was found where strands lie close together; the points have a width all the same.
        per_radius = _expected_per_radius(radius, spacing)
    if good.sum() < max(3, 0.2 * len(good)):
        if radius is not None:
            per_radius = _expected_per_radius(radius, spacing)
        return Scale(
            spacing,
            guess,
            radius is not None,
            float("nan"),
            1.0,
            line_share,
            per_radius,
            resolved,
            True,
            thick,
            half_width,
        )
    noise = float(np.median(fit.noise[good]))
    estimate = float(np.median(fit.radius[good]))
    coverage = _coverage(float(np.median(fit.lopsided[good])))
    spread = float(np.median(np.abs(fit.radius[good] - estimate)))
    # Noise across the axis moves points outward on average.
    estimate -= min(noise**2 / (2.0 * estimate), 0.2 * estimate)
    # Neighbourhoods that were longer than wide from the first say nothing about a width.
    clear = noise < 0.12 * estimate or (noise < 0.45 * estimate and line_share > 0.5)
    # Noise thickens small patches of the surface, too; a bundle of strands does not.
    circular = noise < 0.15 * estimate or noise < 4.0 * thick
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
        thick,
        half_width,
    )


def _coverage(lopsided: float) -> float:
    """Share of the circumference that was seen, from the distance of its centroid from the centre, in radii."""
    # Half the circumference has its centroid at 2 r / pi; less of it, farther out.
    return float(np.interp(lopsided, [0.0, 0.2, 2 / np.pi, 1.0], [1.0, 1.0, 0.5, 0.0]))


def _from_normals(points: Array, spacing: float, widest: float) -> Scale | None:
    """The scale of strands that lie close together, from the normals of their surfaces; None if these show no tube.

    The normals around a place are across the axis (paper Eq. 6), and the axis is one radius away along the normal. So
    every radius that is tried has its cross-sections; it is right if the circles through nearly all of them have it.

    Args:
        points: (M, 3) metres.
        spacing: median distance between nearest neighbours, metres.
        widest: the largest radius that is tried, metres.
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
    largest = min(0.5 * float(np.ptp(sample, axis=0).max()), widest)
    best: tuple[float, float, Circles] | None = None
    for radius in smallest * _GROWTH ** np.arange(int(np.log(max(largest / smallest, 1.0)) / np.log(_GROWTH)) + 1):
        _, estimate = _with_radius(sample, tree, normals, places[::_SCREENED], float(radius))
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
) -> tuple[Circles, float]:
    """Circles through the cross-sections that a radius suggests, and the radius that they have: 0 if they have none."""
    around = _within(tree, sample[places], 1.5 * radius)
    inside = around < len(sample)
    near = normals[np.where(inside, around, 0)] * inside[:, :, None]
    direction = smallest_axes(_products(near))
    across = normals[places] - direction * dots(normals[places], direction)[:, None]
    across = unit(across, 1e-12)
    # The normal has no sign: the axis is on the side where the surface is one radius from it, and nothing is nearer.
    centres = [sample[places] + side * radius * across for side in (1.0, -1.0)]
    votes = [_votes(sample, tree, centre, direction, radius) for centre in centres]
    centre = np.where((votes[0] >= votes[1])[:, None], *centres)
    even = np.ones(len(places))
    fit = cross_sections(tree, sample, Stretches(centre, direction, radius * even, even, even > 0.0), radius)
    return fit, float(np.median(fit.radius[fit.good])) if fit.good.any() else 0.0


def _votes(sample: Array, tree: cKDTree, centre: Array, direction: Array, radius: float) -> IntArray:
    """Points of each cross-section that are about a radius from its centre, less those that are nearer."""
    around = _within(tree, centre, 1.6 * radius)
    inside = around < len(sample)
    offset = sample[np.where(inside, around, 0)] - centre[:, None]
    along = dots(offset, direction[:, None])
    distance = np.sqrt(np.maximum(dots(offset, offset) - along**2, 0.0))
    inside &= np.abs(along) < radius
    votes: IntArray = (inside & (np.abs(distance - radius) < 0.3 * radius)).sum(axis=1) - (
        inside & (distance < 0.7 * radius)
    ).sum(axis=1)
    return votes


def _within(tree: cKDTree, places: Array, reach: float) -> IntArray:
    """(P, K) indices of the points around places; an index past the end where there are fewer."""
    index: IntArray = tree.query(places, min(NEIGHBOURS, tree.n), distance_upper_bound=reach)[1]
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
