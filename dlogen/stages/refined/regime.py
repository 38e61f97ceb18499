"""What a cloud shows of an object: its surface, or only a strip as wide as it is.

Where the noise is well below the radius, a tube is fitted to the surface. Where it is not, or where neighbours share so
much of it that the tube follows it, the width of the strip and its middle say more (`dlogen.stages.refined.strand`).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.vectors import dots, unit
from dlogen.stages.refined.refine import Refined
from dlogen.stages.refined.strand_axis import StrandFit
from dlogen.types import Skeleton

#: Noise over radius from which on a surface is doubted, and beyond which it is none.
DOUBTED, _HIDDEN = 0.04, 0.35

#: Where neighbours share no noise, less than so many points being worth one, a tube does not follow it: it is doubted
#: from more noise on.
_INDEPENDENT, _DOUBTED_THEN = 1.5, 0.1

#: Standard deviation of the depth of the seen half of a tube, in radii.
_HALF_TUBE = 0.22

#: A tube that bends so tightly, curvature times radius, follows noise: cables break before.
_TIGHT = 0.6

#: Wiggles of the tube about the strip, in radii: where neighbours share their noise, and at all.
_WIGGLES, _APART = 0.1, 0.3

#: Share of the points that a strip may miss and the tube has.
_MISSED = 0.1

#: How many points share their noise, for the former; and the relative difference of the two lengths.
_SHARED, _LONGER = 5.0, 0.015

#: Places where the two lines are compared, at least and for each radius of length, and how many of every 25 of them
#: are left out at either end.
_PLACES, _PER_RADIUS, _ENDS = 500, 1.0, 1


def is_doubted(fit: Refined) -> bool:
    """Whether the noise of a tube is so large that the strip has to be looked at, too."""
    doubted = _DOUBTED_THEN if fit.shared < _INDEPENDENT else DOUBTED
    return fit.noise > doubted * fit.radius or fit.max_curvature * fit.radius > _TIGHT


def hides_surface(strip: StrandFit) -> bool:
    """Whether the depth of a strip scatters by more than it does on a surface whose noise a tube can be fitted to."""
    return strip.noise > float(np.hypot(_HALF_TUBE, _HIDDEN)) * strip.half_width


def shows_surface(fit: Refined, strip: StrandFit) -> bool:
    """Whether the tube says more than the strip does.

    Args:
        fit: the tube, fitted to the surface.
        strip: the strip, fitted to the same points.
    """
    if fit.noise > _HIDDEN * fit.radius or fit.max_curvature * fit.radius > _TIGHT:
        return False
    if strip.inliers.mean() < fit.inliers.mean() - _MISSED:
        return True
    places = max(_PLACES, int(_PER_RADIUS * fit.skeleton.length / fit.radius))
    apart = wiggles(fit.skeleton, strip.skeleton, places) / fit.radius
    if fit.shared > _SHARED and apart > _WIGGLES:
        return False
    longer = abs(fit.skeleton.length / strip.skeleton.length - 1.0)
    return apart < _APART and (longer < _LONGER or fit.shared < _SHARED)


def wiggles(line: Skeleton, other: Skeleton, places: int = _PLACES) -> float:
    """Root mean square distance of a line from another at so many places, less what it is everywhere, metres."""
    s = np.linspace(0.0, 1.0, places)
    ends = _ENDS * places // 25
    there = other(s)
    nearest = cKDTree(there).query(line(s))[1]
    tangent = unit(np.gradient(there, axis=0))[nearest]
    offset = line(s) - there[nearest]
    offset = (offset - dots(offset, tangent)[:, None] * tangent)[ends:-ends]
    offset -= offset.mean(axis=0)
    return float(np.sqrt(dots(offset, offset).mean()))
