"""What a user should know of the order that was found: whether it is that of one open line, and where it is a guess."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.vectors import as_place
from dlogen.stages.quality.findings import (
    BRANCH,
    CLOSED_RING,
    CROSSING,
    GAP,
    NOT_A_LINE,
    SEVERAL_OBJECTS,
    SIDE_BY_SIDE,
    STRAY_POINTS,
    TOO_FEW_POINTS,
)
from dlogen.stages.refined.joins import bending_cost
from dlogen.stages.refined.ordered_line import Bridge, OrderedLine
from dlogen.stages.refined.piece import end_direction, parabola
from dlogen.stages.scale import Scale
from dlogen.types import Array, BoolArray, Finding
from dlogen.types.texts import millimetres

#: Share of places where the cloud is longer than wide, below which it is no line.
_LINE_SHARE = 0.35
#: Shorter than this, in radii, and it is no line.
_SHORTEST_LINE = 6.0
#: What is left over and comes nearer to the line than this, in radii, is a branch of it.
_BRANCH = 5.0
#: What is left over is something if it is so long, in radii and as a share of the line; if its points are as dense as
#: those of the line, so many radii are enough, for these are no strays.
_LEFT_OVER, _LEFT_OVER_SHARE, _DENSE_LEFT_OVER = 4.0, 0.02, 3.0
#: In a view, what is left over and shorter than this share of the line is doubtful only.
_SHORT_LEFT_OVER = 0.05
#: Density over the least one of the line from which on points count as dense.
_DENSE = 0.5
#: Shares of the length: up to the one a gap is bridged without doubt, beyond the other it makes two objects.
_SMALL_GAP, _LARGE_GAP = 0.05, 0.3


def about_cloud(
    scale: Scale, estimated: bool, per_radius: float, near: BoolArray, line: OrderedLine, r: float
) -> list[Finding]:
    """What the cloud as a whole says; `estimated`: the radius is not a given one."""
    findings = []
    stray = 1.0 - float(near.mean())
    if estimated and scale.line_share < _LINE_SHARE:
        message = "the cloud is longer than wide in few places only: it is not that of a line alone"
        findings.append(NOT_A_LINE.found(message, "bad"))
    elif stray > 0.4:
        message = f"{stray:.0%} of the points do not lie around the line that was found"
        findings.append(NOT_A_LINE.found(message, "bad"))
    elif stray > 0.01:
        message = f"{stray:.1%} of the points do not lie around the line and were left out"
        findings.append(STRAY_POINTS.found(message, "note" if stray < 0.25 else "doubtful"))
    if line.length < _SHORTEST_LINE * r:
        message = f"the object is only {line.length / (2 * r):.1f} diameters long: it is hardly a line"
        findings.append(NOT_A_LINE.found(message, "bad"))
    if estimated and not scale.round:
        message = "the cross-sections are not round: strands may lie side by side; give r to tell them apart"
        findings.append(SIDE_BY_SIDE.found(message))
    if per_radius < 1.5:
        message = f"only {per_radius:.1f} points for each radius of length: the order is uncertain"
        findings.append(TOO_FEW_POINTS.found(message))
    return findings


def about_rest(
    others: list[OrderedLine], line: OrderedLine, r: float, place_of: Callable[[Array], Array], *, in_view: bool
) -> list[Finding]:
    """Chains that are not part of the line; in a view, short ones may be pixels that fly behind an edge."""
    findings = []
    thinnest = float(np.min(line.densities))
    for other in others:
        dense = float(np.mean(other.densities)) > _DENSE * thinnest
        if other.length < (_DENSE_LEFT_OVER * r if dense else max(_LEFT_OVER * r, _LEFT_OVER_SHARE * line.length)):
            continue
        distance, index = cKDTree(line.points).query(other.points)
        nearest = int(np.argmin(distance))
        what = f"{millimetres(other.length)} long"
        if in_view and other.length < _SHORT_LEFT_OVER * line.length:
            place = as_place(place_of(other.points[len(other.points) // 2]))
            message = f"a group of points {what} is not part of the line and was left out"
            findings.append(STRAY_POINTS.found(message, "doubtful", position=place))
            continue
        if distance[nearest] < _BRANCH * r:
            place = as_place(place_of(line.points[index[nearest]]))
            s = float(index[nearest] / (len(line.points) - 1))
            findings.append(BRANCH.found(f"a branch leaves the line, {what}", s=s, position=place))
        else:
            place = as_place(place_of(other.points[len(other.points) // 2]))
            findings.append(SEVERAL_OBJECTS.found(f"another object is in the cloud, {what}", position=place))
    return findings


def about_ends(line: OrderedLine, r: float, place_of: Callable[[Array], Array]) -> list[Finding]:
    """Whether the two ends of the line belong together."""
    first, last = line.points[0], line.points[-1]
    gap = float(np.linalg.norm(last - first))
    if line.length < 12.0 * r or gap > max(4.0 * r, 0.1 * line.length):
        return []
    cost = bending_cost(*parabola(line.points, 1.5 * r, r), *parabola(line.points[::-1], 1.5 * r, r), r)
    place = as_place(place_of(0.5 * (first + last)))
    if gap < 4.0 * r and cost < 0.8:
        return [CLOSED_RING.found("the object is a closed ring: it has no ends", "bad", s=0.0, position=place)]
    # The ends of an object that is folded in two lie side by side and point the same way.
    folded = float(end_direction(line.points, r) @ end_direction(line.points[::-1], r)) > 0.5
    if (gap < 4.0 * r and not folded) or cost < 0.3:
        message = f"the two ends face each other {millimetres(gap)} apart: it may be a ring with a gap"
        return [CLOSED_RING.found(message, "doubtful", s=0.0, position=place)]
    return []


def about_bridges(
    bridges: list[Bridge], line: OrderedLine, r: float, place_of: Callable[[Array], Array]
) -> list[Finding]:
    """Gaps that were bridged, and places where strands meet and may be joined otherwise."""
    findings = []
    for number, (item, join) in enumerate(zip(bridges, line.joins, strict=True)):
        s, place = 0.5 * (item.s[0] + item.s[1]), as_place(place_of(np.array(item.position)))
        share = item.gap / line.length
        if item.certainty < 0.5:
            message = "strands meet here, and which of them belong together is not certain"
            findings.append(CROSSING.found(message, "doubtful", s=s, position=place))
        density = min(line.densities[number][1], line.densities[number + 1][0])
        # A hole where fifteen points were due is none by chance.
        if item.kind == "gap" and item.gap > 2.0 * r and item.gap * density > 15.0:
            findings.append(gap_finding(item.gap, share, s, place, join.cost))
    return findings


def gap_finding(gap: float, share: float, s: float, place: tuple[float, float, float], cost: float = 0.0) -> Finding:
    """What to say of a gap: its length in metres and as a share of the line, its place, and the cost of its bridge."""
    message = f"no points for {millimetres(gap)} ({share:.1%} of the length); the gap was bridged"
    if share > _LARGE_GAP:
        return GAP.found(f"{message}, but these may be two objects", "bad", s=s, position=place)
    return GAP.found(message, "note" if share < _SMALL_GAP and cost < 0.6 else "doubtful", s=s, position=place)
