"""What an object lies on, where a mask that is too wide left a strip of it in the cloud.

Seen from above, a cable on a table hides the table under it, and its sides below its widest place hide themselves: no
point lies between the height of the table and about that of the axis. A strip of table beside the object is as flat as
the noise lets it be, with nothing just above it; no part of a round object is.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.sampling import spatial_sample
from dlogen.types import Array, BoolArray

#: Points that are looked at, and fewest of them.
_SAMPLE, _FEWEST = 4000, 200

#: Share of the lowest points that a plane is tried with first, rounds of refining it, and least share of the bed.
_LOWEST, _ROUNDS, _LEAST = 0.1, 8, 0.03

#: Standard deviations about the plane within which points are the bed's, and from which on there are none.
_WITHIN, _BEYOND = 4.0, 4.5

#: Heights over that of the object up to which nothing lies above the bed, and the share of its points that is nothing.
_EMPTY, _NOTHING = 0.35, 0.02

#: What is empty is so many times as high as the bed at least: between two heights that are alike there is nothing ever.
_CLEAR = 1.25

#: A bed scatters by less than this share of the object's height, or by no more than so many times its patches do.
_FLAT, _AS_NOISY = 0.02, 2.0

#: Points of a patch, and patches that are looked at.
_PATCH, _PATCHES = 12, 200

#: Share of all points that may be below the bed: strays.
_BELOW = 0.01

#: Heights of the object within which the bed has a point of it, and the object one of the bed; shares that must have.
_BESIDE, _ALONG, _BED_SHARE, _OBJECT_SHARE = 1.0, 2.0, 0.9, 0.6

#: An object is no higher above its bed than so many spacings of the sample, which are some radii: a flat piece of it
#: that is far below the rest is none.
_HIGHEST = 30.0


def bed_points(points: Array) -> BoolArray:
    """Which points are a strip of the plane that the object lies on; none where there is no such strip.

    Args:
        points: (M, 3) metres.

    Returns:
        (M,) whether it is of the bed.
    """
    nothing = np.zeros(len(points), dtype=bool)
    sample = points[spatial_sample(points, _SAMPLE)]
    if len(sample) < _FEWEST:
        return nothing
    normal = np.linalg.eigh(np.cov(sample.T))[1][:, 0]
    for up in (normal, -normal):
        plane = _plane_below(sample, up)
        if plane is not None:
            at, up, spread = plane
            return np.abs((points - at) @ up) < _WITHIN * spread
    return nothing


def _plane_below(sample: Array, up: Array) -> tuple[Array, Array, float] | None:
    """A place on the bed, its normal and the spread of its points about it, metres; None if it is no bed."""
    height = sample @ up
    own = height <= np.quantile(height, _LOWEST)
    for _ in range(_ROUNDS):
        at = sample[own].mean(axis=0)
        normal = np.linalg.eigh(np.cov((sample[own] - at).T))[1][:, 0]
        up = normal if normal @ up > 0.0 else -normal
        height = (sample - at) @ up
        middle = float(np.median(height[own]))
        at, height = at + middle * up, height - middle
        # The lowest points of a bed are half of it: a spread that is too small grows until nothing more comes in.
        spread = 1.4826 * float(np.median(np.abs(height[own])))
        before, own = own, np.abs(height) < 3.0 * spread
        if np.count_nonzero(own) < 0.5 * _LEAST * len(sample):
            return None
        if np.array_equal(before, own):
            break
    own = np.abs(height) < _WITHIN * spread
    above = height > _BEYOND * spread
    if own.mean() < _LEAST or above.mean() < _LEAST or np.mean(height < -_BEYOND * spread) > _BELOW:
        return None
    spacing = float(np.median(cKDTree(sample).query(sample, 2)[0][:, 1]))
    tall = min(float(np.quantile(height[above], 0.95)), _HIGHEST * spacing)
    # The lower side of a round or winding object is no plane: what it scatters by is not the noise of its points.
    if spread > _FLAT * tall and spread > _AS_NOISY * _thickness(sample[own]):
        return None
    empty = _EMPTY * tall
    if empty < _CLEAR * _BEYOND * spread:
        return None
    if np.count_nonzero(above & (height < empty)) > _NOTHING * np.count_nonzero(own):
        return None
    # Along the object on its bed, one is beside the other everywhere.
    flat = sample - height[:, None] * up
    beside = np.isfinite(cKDTree(flat[above]).query(flat[own], distance_upper_bound=_BESIDE * tall)[0])
    along = np.isfinite(cKDTree(flat[own]).query(flat[above], distance_upper_bound=_ALONG * tall)[0])
    if beside.mean() < _BED_SHARE or along.mean() < _OBJECT_SHARE:
        return None
    return at, up, spread


def _thickness(points: Array) -> float:
    """Median standard deviation of small patches of points across themselves, metres."""
    near = cKDTree(points).query(points[:: -(-len(points) // _PATCHES)], min(_PATCH, len(points)))[1]
    patches = points[near] - points[near].mean(axis=1, keepdims=True)
    values = np.linalg.eigvalsh(np.einsum("pki,pkj->pij", patches, patches) / near.shape[1])
    return float(np.sqrt(np.maximum(np.median(values[:, 0]), 0.0)))
