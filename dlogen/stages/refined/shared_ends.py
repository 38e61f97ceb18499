"""Points near the ends of a tube that lie on another part of it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.stages.refined.tube import Tube, expected_distance
from dlogen.stages.refined.tube_curve import arc_at, arc_table
from dlogen.types import Array, BoolArray

#: An end is so many radii long where it is compared with other strands; those are this far from it along the curve.
_END, _ELSEWHERE = 6.0, 12.0

#: Samples of the curve that stand for it there.
_SAMPLES_PER_RADIUS = 8.0

#: Points within so many standard deviations of the surface belong to the tube; and within this share of the radius.
INLIER, INLIER_FLOOR = 4.0, 0.02


def shared_at_ends(points: Array, tube: Tube) -> BoolArray:
    """Which points near an end of the curve lie on the surface around another part of it, or inside: (3, M) points."""
    curve, radius = tube.curve, tube.radius
    grid, arc, _ = arc_table(curve)
    count = round(_SAMPLES_PER_RADIUS * float(arc[-1]) / radius)
    even = np.linspace(0.0, float(arc[-1]), count)
    places = curve(np.interp(even, arc, grid))
    s = arc_at(arc, tube.x)
    reach = expected_distance(radius, tube.sigma) + INLIER * max(tube.sigma, INLIER_FLOOR / INLIER * radius)
    shared = np.zeros(points.shape[1], dtype=bool)
    for at_end, away in ((s, even), (arc[-1] - s, arc[-1] - even)):
        near = np.flatnonzero(at_end < _END * radius)
        if not len(near):
            continue
        end = points[:, near]
        # Most curves do not come back to their ends: nothing is left to ask then.
        low, high = end.min(axis=1) - reach, end.max(axis=1) + reach
        others = places[(away > _ELSEWHERE * radius) & ((places > low) & (places < high)).all(axis=1)]
        if len(others):
            distance = cKDTree(others).query(end.T, distance_upper_bound=reach)[0]
            shared[near] |= np.isfinite(distance)
    return shared
