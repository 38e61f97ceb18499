"""Thick stretches along an object: connectors and tape, which are round like the object and thicker.

The fit bridges them, since their points are off the tube. The order takes their surface for branches and crossings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dlogen.geometry.runs import runs
from dlogen.stages.quality.findings import BRANCH, CROSSING, GAP, RADIUS_VARIES, STRAY_POINTS
from dlogen.stages.refined.refine import Refined
from dlogen.types import Array, BoolArray, Finding
from dlogen.types.texts import millimetres

#: Distances of the points of a collar to the axis, in radii; and the share of them that is as close to its radius.
_THICKER, _THICKEST, _ROUND, _CLOSE = 1.2, 3.6, 0.55, 0.15

#: Share of the points of a stretch of a radius that are farther out than the object, its least length in such
#: stretches, at most this share of the line's length, and the points that it needs.
_MOSTLY, _SHORTEST, _MOST, _FEWEST = 0.6, 2, 0.2, 40

#: Findings of the ordering are about a collar if they are so many radii from it along the line.
_NEAR = 3.0

#: With so small a share of the points neither on the tube nor on a collar, no strays are worth a word.
_NO_STRAYS = 0.01


@dataclass(frozen=True, eq=False)
class Collar:
    """A thick stretch.

    Attributes:
        start, end: coordinates on the line.
        radius: of it, metres.
        points: (M,) which points of the cloud belong to it.
    """

    start: float
    end: float
    radius: float
    points: BoolArray


def find_collars(fitted: Refined) -> list[Collar]:
    """The thick stretches of an object, between its ends.

    Args:
        fitted: the tube that was fitted.
    """
    line, radius, s = fitted.skeleton, fitted.radius, fitted.s
    count = int(line.length / radius)
    distance = fitted.residuals + radius
    outside = (distance > _THICKER * radius) & (distance < _THICKEST * radius) & ~fitted.inliers & (s > 0.0) & (s < 1.0)
    if count < 20 or np.count_nonzero(outside) < _FEWEST:
        return []
    place = np.minimum((s * count).astype(np.intp), count - 1)
    out = np.bincount(place[outside], minlength=count)
    on = np.bincount(place[fitted.inliers], minlength=count)
    thick = (out > _MOSTLY * (out + on)) & (out > 0.3 * np.median(on))
    found = []
    for first, behind in zip(*runs(thick), strict=True):
        long = int(behind - first)
        if not _SHORTEST <= long <= _MOST * count or first == 0 or behind >= count:
            continue
        inside = outside & (place >= first - 1) & (place <= behind)
        middle = float(np.median(distance[inside]))
        alike = np.abs(distance[inside] - middle) < _CLOSE * middle
        if np.count_nonzero(inside) >= _FEWEST and float(np.mean(alike)) > _ROUND:
            found.append(Collar(first / count, behind / count, middle, inside))
    return found


def about_collars(findings: Sequence[Finding], collars: Sequence[Collar], fitted: Refined) -> list[Finding]:
    """Findings of the ordering without those that are about thick stretches, and a note about each of these.

    Args:
        findings: of the ordering.
        collars: the thick stretches of the object.
        fitted: the tube that was fitted.
    """
    if not collars:
        return list(findings)
    line, radius = fitted.skeleton, fitted.radius
    known = fitted.inliers.copy()
    for collar in collars:
        known |= collar.points
    few = 1.0 - float(np.mean(known)) < _NO_STRAYS

    def is_explained(item: Finding) -> bool:
        if STRAY_POINTS.matches(item):
            return few
        if item.position is None or not any(kind.matches(item) for kind in (BRANCH, CROSSING, GAP)):
            return False
        return any(_is_at(np.array(item.position), collar, fitted) for collar in collars)

    notes = []
    for collar in collars:
        text = (
            f"thicker for {millimetres((collar.end - collar.start) * line.length)}, with a radius of "
            f"{millimetres(collar.radius)} instead of {millimetres(radius)}: left out of the radius"
        )
        notes.append(RADIUS_VARIES.at(line, 0.5 * (collar.start + collar.end), text, "note"))
    return [*(item for item in findings if not is_explained(item)), *notes]


def _is_at(position: Array, collar: Collar, fitted: Refined) -> bool:
    """Whether a place is on a collar or at its ends."""
    margin = _NEAR * fitted.radius / fitted.skeleton.length
    places = fitted.skeleton(np.linspace(max(collar.start - margin, 0.0), min(collar.end + margin, 1.0), 50))
    return float(np.linalg.norm(places - position, axis=1).min()) < collar.radius + fitted.radius
