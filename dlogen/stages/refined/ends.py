"""Where an object ends: the edge of the density of its points along the axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.types import Array

#: Points that decide about an end: so many, or those within so many standard deviations of the last one. Farther
#: ones know nothing of it, and the density may change on the way.
_WINDOW, _REACH = 150, 15.0

#: The least share of points that belong to something else, such as a strand beside the end.
_STRAY = 1e-4

#: Places that are tried for an edge.
_EDGES = 64

#: A gap is compared with the spacing of so many points on either side, and has to be so many times longer.
_NEAR, _UNLIKELY = 15, 16.0


@dataclass(frozen=True)
class End:
    """An end of an object on its axis.

    Attributes:
        position: arc length, metres.
        std: its standard deviation, metres.
    """

    position: float
    std: float


def find_ends(s: Array, deviation: Array, sigma: float) -> tuple[End, End]:
    """The two ends of an object.

    Args:
        s: (K,) arc lengths of the feet of its points, metres, in any order.
        deviation: (M,) distance of all points near the axis to the surface, in standard deviations: what is between 5
            and 15 are strays, and tells how many of them are among the K points.
        sigma: standard deviation of the noise along the axis, metres.
    """
    s = np.sort(s)
    strays = np.count_nonzero((deviation > 5.0) & (deviation < 15.0)) * 0.4
    background = strays / max(float(s[-1] - s[0]), 1e-12)
    lower = _upper_edge(-s[::-1], sigma, background)
    return End(-lower.position, lower.std), _upper_edge(s, sigma, background)


def find_gaps(s: Array, start: float, end: float, radius: float) -> tuple[tuple[float, float], ...]:
    """Stretches without points that chance does not explain: longer than a radius and 16 times the local spacing.

    Args:
        s: (K,) arc lengths of the feet of the points, metres, in any order.
        start, end: arc lengths of the ends, metres.
        radius: metres.

    Returns:
        (s0, s1) of each gap, in [0, 1].
    """
    s = np.sort(s[(s > start) & (s < end)])
    if len(s) < 2 * _NEAR:
        return ()
    steps = np.diff(s)
    # The spacing on either side of each step; the smaller one, since another gap may be near.
    i = np.arange(len(steps))
    low, high = np.maximum(i - _NEAR, 0), np.minimum(i + 1 + _NEAR, len(s) - 1)
    before = (s[i] - s[low]) / np.maximum(i - low, 1)
    after = (s[high] - s[i + 1]) / np.maximum(high - i - 1, 1)
    # Two or three points happen to lie close together.
    before[i - low < _NEAR // 2], after[high - i - 1 < _NEAR // 2] = np.inf, np.inf
    wide = np.flatnonzero(steps > np.maximum(radius, _UNLIKELY * np.minimum(before, after)))
    return tuple((float((s[j] - start) / (end - start)), float((s[j + 1] - start) / (end - start))) for j in wide)


def _upper_edge(s: Array, sigma: float, background: float) -> End:
    """The upper edge of a uniform density, given points with Gaussian noise (posterior mean under a flat prior).

    The last of n random points lies one mean spacing short of the edge on average, and noise carries points beyond it.
    The likelihood of an edge E for the points above a is that of a uniform density on [a, E] convolved with
    N(0, sigma^2); its posterior mean, by quadrature, is unbiased for both. Without noise it is the largest s plus one
    spacing.

    Args:
        s: sorted arc lengths, metres.
        sigma: standard deviation of the noise along the axis, metres.
        background: density of points that do not belong to the object, per metre.
    """
    if len(s) < 8:
        return End(float(s[-1]), float(s[-1] - s[0]))
    window = max(_WINDOW, len(s) - int(np.searchsorted(s, s[-1] - _REACH * sigma)))
    s = s[-window:]
    # The window starts between two points, so that its own start is no edge.
    start, s = 0.5 * float(s[0] + s[1]), s[1:]
    count, span = len(s), max(float(s[-1]) - start, 1e-12)
    spacing = span / count
    low, high = float(s[-1]) - 6.0 * sigma - 10.0 * spacing, float(s[-1]) + sigma + 12.0 * spacing
    low = max(min(low, float(s[-1]) - 0.5 * span), start + spacing)
    share = float(np.clip(background * span / count, _STRAY, 0.5))
    for _ in range(3):
        edges = np.linspace(low, high, _EDGES)
        log_likelihood = _log_likelihood(s, start, edges, sigma, share)
        probability = np.exp(log_likelihood - log_likelihood.max())
        mean = float(probability @ edges / probability.sum())
        likely = edges[probability > 1e-4]
        step = float(edges[1] - edges[0])
        # No edge lies before the window.
        low, high = max(float(likely[0]) - step, start + 0.1 * spacing), float(likely[-1]) + step
    return End(mean, float(np.sqrt(probability @ (edges - mean) ** 2 / probability.sum())))


def _log_likelihood(s: Array, start: float, edges: Array, sigma: float, background: float) -> Array:
    """(E,) log-likelihood of the edges; `background` is the share of points that do not belong to the object."""
    span = max(float(edges[-1]), float(s[-1])) - start
    width = edges - start
    # Far below all edges, a point is inside for certain.
    certain = int(np.searchsorted(s, edges[0] - 6.0 * sigma))
    near = s[certain:]
    if sigma > 1e-6 * span:
        inside = _gaussian_cdf((edges[:, None] - near) / sigma)
    else:
        inside = (edges[:, None] >= near).astype(float)
    floor = background / span + 1e-12 / span
    density = (1.0 - background) * inside / width[:, None] + floor
    result: Array = np.log(density).sum(axis=1) + certain * np.log((1.0 - background) / width + floor)
    return result


def _gaussian_cdf(z: Array) -> Array:
    """Phi(z), by a logistic approximation with an absolute error below 2e-4 (Bowling et al. 2009)."""
    cdf: Array = 1.0 / (1.0 + np.exp(np.clip(-(0.07056 * z**2 + 1.5976) * z, -600.0, 600.0)))
    return cdf
