"""From a raw cloud to a rough, ordered centre line, without a start point (the sorting walk of the paper's III.B).

The order comes from pieces that are certain (`dlogen.stages.refined.branches`); where it stays ambiguous, a finding
says so. What comes out is the same for every order of the input points.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.geometry.polyline import arc_lengths, resample, segment_lengths
from dlogen.geometry.runs import runs
from dlogen.geometry.sampling import middle, spatial_sample
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
from dlogen.stages.refined.beads import string_beads
from dlogen.stages.refined.branches import cut_at_junctions, trace_pieces
from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.joins import Join, bending_cost, bridge, chains, ways_to_join
from dlogen.stages.refined.medial import axis_votes, contract, recentre, votes_agree
from dlogen.stages.refined.piece import Piece, end_direction, parabola
from dlogen.stages.scale import Scale, estimate_scale
from dlogen.stages.view import ONE_SIDED, FlatView, thin_direction
from dlogen.types import Array, BoolArray, Finding
from dlogen.types.texts import millimetres

#: Size of the subset that the order is found on: at most, and for each radius of length.
_SAMPLE = 6000
_PER_RADIUS = 22.0
#: Points for each radius of length that long objects need, and the most points for all that.
_LEAST_PER_RADIUS, _LARGEST_SAMPLE = 11.0, 100_000
#: Size of the subset that tells the share of strays.
_LOOKED_AT = 2000
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
#: A cloud so many given radii wide, whose surface is that thick, is noise around a thin object.
_HIDDEN, _THICK = 1.8, 0.5
#: Radius, in half widths, that strips are followed with: in space and in the view.
_STRIP, _FLAT_STRIP = 2.0, 1.5
#: The most points that are taken for beads on a string.
_BEADS = 200


@dataclass(frozen=True)
class Bridge:
    """A place where two pieces were joined.

    Attributes:
        s: (start, end) coordinates on the backbone, arc length over length.
        position: the middle, metres.
        gap: longest part of it without points, metres.
        kind: "gap", "crossing" (another strand passes there) or "touch" (one that nearly touches).
        certainty: 0 to 1: how much better the join is than the next best.
    """

    s: tuple[float, float]
    position: tuple[float, float, float]
    gap: float
    kind: str
    certainty: float


@dataclass(frozen=True, eq=False)
class Ordering:
    """A rough centre line in order.

    Attributes:
        backbone: (K, 3) about one radius apart, within half a radius of the axis, metres.
        radius: the radius that was used, metres.
        pieces: the certain stretches of the backbone, in its order and direction.
        joins: what was bridged between them.
        findings: what a user should know.
        noisy: the points scatter so much that their normals say nothing.
        thread: they are too few to show a width, too (`dlogen.stages.refined.thread`).
        half_width: of the strip that they are then, metres.
    """

    backbone: Array
    radius: float
    pieces: tuple[Array, ...]
    joins: tuple[Bridge, ...]
    findings: tuple[Finding, ...]
    noisy: bool = False
    thread: bool = False
    half_width: float = float("nan")


def order(
    points: Array,
    radius: float | None = None,
    scale: Scale | None = None,
    viewpoint: Array | None = None,
    bridging: Bridging | None = None,
) -> Ordering:
    """Find the centre line of a cloud, roughly, and its order.

    Args:
        points: (M, 3) finite surface points, metres, in any order.
        radius: of the tube, metres; None takes the estimate of `scale`.
        scale: what `estimate_scale` gave for these points; None makes it here.
        viewpoint: (3,) where the points were seen from, if that is known, metres.
        bridging: which gaps belong to the object, as far as its user says so.

    Returns:
        The backbone with findings: "branch", "closed-ring", "several-objects", "not-a-line" (all bad), "gap",
        "crossing" (where which strands belong together is not certain; others are looked for when the line is fitted,
        see `dlogen.stages.quality.contacts`), "side-by-side", "stray-points", "too-few-points".

    Raises:
        FitError: nothing in the cloud is longer than wide.
    """
    scale = scale or estimate_scale(points, radius=radius)
    if not scale.resolved and len(points) <= _BEADS:
        return _beads(points, radius)
    r = radius or scale.radius
    hidden = radius is not None and scale.half_width > _HIDDEN * radius and scale.thickness > _THICK * radius
    # A wire thinner than the noise; a bundle of strands is as thick, but its surfaces are thin.
    if hidden and not _bundles(points, scale, r):
        return order_strip(points, estimate_scale(points), None, viewpoint, bridging)
    # Where strands lie close together, no neighbourhood is longer than wide; with a known radius that does not matter.
    if radius is None and (scale.line_share < 0.2 or not np.isfinite(scale.per_radius)):
        raise FitError(
            "the cloud is not that of a line: nowhere is it clearly longer than wide",
            "leave only the object in the cloud: remove table, background and fixtures; "
            "where strands of it lie close together, give r",
            stage="ordering",
        )
    if not scale.per_radius > 0.0:
        raise FitError(
            "the points have no width: they lie on a line, not on the surface of an object",
            "for points on the centre line set profile to paper, projection.enabled to false, and give r",
            stage="ordering",
        )
    # Many points for each radius of length don't make the order surer.
    chosen = spatial_sample(points, _sample_size(len(points), scale.per_radius * r / scale.radius))
    sample = points[chosen]
    origin = middle(sample)
    sample = sample - origin
    thinned = len(sample) / len(points)
    per_radius = scale.per_radius * thinned * r / scale.radius

    tree = cKDTree(sample)
    spacing = scale.spacing / np.sqrt(thinned)
    votes, projected = axis_votes(sample, tree, r, spacing, None if viewpoint is None else viewpoint - origin)
    if projected.any() and not votes_agree(sample, votes, projected, r) and not _wrong_radius(points, radius):
        # A table or a ball is no strip either: what it is is said of the line through its votes.
        with contextlib.suppress(FitError):
            return order_strip(points, scale, radius, viewpoint, bridging)
    return _traced(
        sample,
        votes,
        projected,
        r,
        per_radius,
        scale,
        radius is None,
        radius is not None or scale.radius_reliable,
        False,
        lambda place: place + origin,
        bridging or Bridging(),
    )


def _sample_size(count: int, per_radius: float) -> int:
    """Size of the subset of so many points that the order is found on."""
    radii = count / max(per_radius, 1e-9)
    most = np.clip(_LEAST_PER_RADIUS * radii, _SAMPLE, _LARGEST_SAMPLE)
    return int(np.clip(_PER_RADIUS * radii, 1000, most))


def _bundles(points: Array, scale: Scale, radius: float) -> bool:
    """Whether points gather on axes when they are projected by a radius, as those of strands side by side do."""
    sample = points[spatial_sample(points, 4 * _SAMPLE)]
    spacing = scale.spacing * np.sqrt(len(points) / len(sample))
    votes, projected = axis_votes(sample, cKDTree(sample), radius, spacing)
    return bool(projected.any()) and votes_agree(sample, votes, projected, radius)


def _wrong_radius(points: Array, radius: float | None) -> bool:
    """Whether normals say nothing with a given radius only because it is wrong."""
    if radius is None:
        return False
    scale = estimate_scale(points)
    return _bundles(points, scale, scale.radius)


def order_strip(
    points: Array,
    scale: Scale,
    radius: float | None,
    viewpoint: Array | None,
    bridging: Bridging | None = None,
) -> Ordering:
    """The order of a cloud whose depth is noise: found where its edges are sharp, in the view.

    Args:
        points, scale, radius, viewpoint, bridging: as in `order`.
    """
    view = None if viewpoint is None else FlatView.of(points, viewpoint, None)
    half_width = scale.half_width if np.isfinite(scale.half_width) else (radius or scale.radius)
    if view is None:
        rough = _order_noise(points, scale, half_width, radius is None, None, bridging)
        direction, ratio = thin_direction(points - points.mean(axis=0), rough.backbone - points.mean(axis=0))
        if ratio < ONE_SIDED:
            return rough
        view = FlatView.of(points, None, direction)
    return _order_noise(points, scale, half_width, radius is None, view, bridging)


def follow(points: Array, step: float, per_step: float, scale: Scale, bridging: Bridging | None = None) -> Ordering:
    """The order of points without normals, followed in steps.

    Args:
        points: (M, 3) metres.
        step: metres; it takes the place of the radius in all that `order` does.
        per_step: points for each step of length.
        scale: of the cloud.
        bridging: as in `order`.
    """
    scale = replace(scale, radius=step, per_radius=per_step, line_share=1.0, round=True)
    return _order_noise(points, scale, step / _STRIP, True, None, bridging)


def _order_noise(
    points: Array,
    scale: Scale,
    half_width: float,
    estimated: bool,
    view: FlatView | None,
    bridging: Bridging | None,
) -> Ordering:
    """The order of points without normals, of a strip so wide."""
    r = (_STRIP if view is None else _FLAT_STRIP) * half_width
    per_radius = scale.per_radius * r / scale.radius
    sample = points[spatial_sample(points, _sample_size(len(points), per_radius))]
    per_radius *= len(sample) / len(points)
    if view is not None:
        sample = view.flat(sample)
    origin = middle(sample)
    sample = sample - origin

    def place(flat: Array) -> Array:
        return flat + origin if view is None else view.back(flat + origin)

    nothing = np.zeros(len(sample), dtype=bool)
    return replace(
        _traced(
            sample,
            sample,
            nothing,
            r,
            per_radius,
            scale,
            estimated,
            False,
            view is not None,
            place,
            bridging or Bridging(),
        ),
        noisy=True,
        half_width=half_width,
    )


def _traced(
    sample: Array,
    votes: Array,
    projected: BoolArray,
    r: float,
    per_radius: float,
    scale: Scale,
    estimated: bool,
    centred: bool,
    in_view: bool,
    place: Callable[[Array], Array],
    bridging: Bridging,
) -> Ordering:
    """The order of a sample; `place` brings places in it to those of the cloud."""
    tree = cKDTree(sample)
    nodes = contract(votes, projected, r, per_radius)
    found = trace_pieces(nodes, r, per_radius)
    if not found:
        raise FitError(
            "no stretch of a line was found in the cloud",
            f"the radius was taken to be {millimetres(r)}: give r if it is not, and check units",
            stage="ordering",
        )
    if centred:
        found = [replace(piece, points=recentre(piece.points, sample, tree, r, per_radius)) for piece in found]
    pieces = cut_at_junctions(found, r, crossings=in_view)
    lines = bridging.best(
        (
            [_Line.of(pieces, *chain, r) for chain in chains(len(pieces), way)]
            for way in ways_to_join(pieces, r, bridging)
        ),
        lambda way: float(arc_lengths(place(_longest(way).points))[-1]),
    )
    longest = _longest(lines)
    others = [other for other in lines if other is not longest]
    line = longest.canonical()
    near = _around(sample[:: -(-len(sample) // _LOOKED_AT)], line.points, r, scale.noise)
    findings = [
        *_about_cloud(scale, estimated, per_radius, near, line, r),
        *_about_rest(others, line, r, place, in_view=in_view),
        *_about_ends(line, r, place),
    ]
    bridges = _bridges(line, sample, tree, r)
    findings += _about_bridges(bridges, line, r, place)
    return Ordering(
        backbone=place(line.points),
        radius=r,
        pieces=tuple(place(part) for part in line.parts),
        joins=tuple(replace(item, position=as_place(place(np.array(item.position)))) for item in bridges),
        findings=tuple(findings),
    )


def _beads(points: Array, radius: float | None) -> Ordering:
    """The order of a few points that are beads on a string."""
    beads = points[spatial_sample(points, _BEADS)]
    line = string_beads(beads)
    if _runs_backwards(line):
        line = line[::-1]
    steps = segment_lengths(line)
    typical = float(np.median(steps))
    s = arc_lengths(line) / steps.sum()
    message = f"only {len(beads)} points: they show an order, but no radius"
    findings = [TOO_FEW_POINTS.found(message)]
    joins = []
    for i in np.flatnonzero(steps > 4.0 * typical):
        middle = as_place(0.5 * (line[i] + line[i + 1]))
        joins.append(Bridge((float(s[i]), float(s[i + 1])), middle, float(steps[i]), "gap", 1.0))
        findings.append(_gap_finding(float(steps[i]), float(steps[i] / steps.sum()), 0.5 * (s[i] + s[i + 1]), middle))
    parts = np.split(line, [i + 1 for i in np.flatnonzero(steps > 4.0 * typical)])
    return Ordering(line, radius or typical, tuple(parts), tuple(joins), tuple(findings))


def _runs_backwards(line: Array) -> bool:
    """Whether a line begins at the larger coordinate, on the axis on which its ends differ most."""
    difference = line[-1] - line[0]
    return bool(difference[np.argmax(np.abs(difference))] < 0.0)


@dataclass(frozen=True, eq=False)
class _Line:
    """A chain of pieces with the bridges between them."""

    points: Array
    parts: tuple[Array, ...]
    densities: tuple[tuple[float, float], ...]  # surface points per metre at either end of each part
    joins: tuple[Join, ...]
    spans: tuple[tuple[int, int], ...]  # indices into points of the two ends of each bridge
    path: tuple[int, ...]
    length: float

    @staticmethod
    def of(pieces: list[Piece], path: list[tuple[int, bool]], joins: list[Join], r: float) -> _Line:
        parts, densities = [], []
        for number, back in path:
            step = -1 if back else 1
            parts.append(pieces[number].points[::step])
            first, last = pieces[number].end_densities
            densities.append((last, first) if back else (first, last))
        points, spans = [parts[0]], []
        count = len(parts[0])
        for before, after in pairwise(parts):
            fill = bridge(before[-1], end_direction(before[::-1], r), after[0], end_direction(after, r), r)
            spans.append((count - 1, count + len(fill)))
            points += [fill, after]
            count += len(fill) + len(after)
        line = np.concatenate(points)
        length = float(arc_lengths(line)[-1])
        numbers = tuple(number for number, _ in path)
        return _Line(line, tuple(parts), tuple(densities), tuple(joins), tuple(spans), numbers, length)

    def canonical(self) -> _Line:
        """The same line, from the end with the smaller coordinate where the ends differ most."""
        if not _runs_backwards(self.points):
            return self
        last = len(self.points) - 1
        return _Line(
            self.points[::-1],
            tuple(part[::-1] for part in self.parts[::-1]),
            tuple((last, first) for first, last in self.densities[::-1]),
            self.joins[::-1],
            tuple((last - b, last - a) for a, b in self.spans[::-1]),
            self.path[::-1],
            self.length,
        )


def _longest(lines: list[_Line]) -> _Line:
    return max(lines, key=lambda candidate: candidate.length)


def _around(points: Array, line: Array, r: float, noise: float) -> BoolArray:
    """Which points are no farther from the line than the surface is, with some room."""
    reach = 1.5 * r + 3.0 * (noise if np.isfinite(noise) else 0.0)
    dense = resample(line, 2 * len(line))
    step = arc_lengths(dense)[-1] / (len(dense) - 1)
    distance, _ = cKDTree(dense).query(points, distance_upper_bound=float(np.hypot(reach, 0.5 * step)))
    reached: BoolArray = np.isfinite(distance)
    return reached


def _bridges(line: _Line, points: Array, tree: cKDTree, r: float) -> list[Bridge]:
    s = arc_lengths(line.points)
    result = []
    for (a, b), join in zip(line.spans, line.joins, strict=True):
        stretch = line.points[a : b + 1]
        middle = resample(stretch, 3)[1]
        elsewhere = (s < s[a] - 4.0 * r) | (s > s[b] + 4.0 * r)
        kind = "gap"
        if elsewhere.any():
            nearest = float(cKDTree(line.points[elsewhere]).query(resample(stretch, 2 * len(stretch)))[0].min())
            kind = "touch" if nearest < 2.4 * r else "crossing" if nearest < 3.5 * r else "gap"
        certainty = 1.0 if np.isinf(join.margin) else join.margin / (join.margin + join.cost)
        gap = _largest_hole(stretch, points, tree, r)
        result.append(Bridge((s[a] / s[-1], s[b] / s[-1]), as_place(middle), gap, kind, float(certainty)))
    return result


def _largest_hole(stretch: Array, points: Array, tree: cKDTree, r: float) -> float:
    """Longest part of a stretch of the line without points around it, metres."""
    dense = resample(stretch, max(3, int(4.0 * arc_lengths(stretch)[-1] / r)))
    step = arc_lengths(dense)[-1] / (len(dense) - 1)
    # A slice across the line is empty if no point is nearer to its centre than the surface and a little more.
    lonely = np.isinf(tree.query(dense, distance_upper_bound=1.3 * r)[0])
    first, last = runs(lonely)
    longest = int((last - first).max(initial=0))
    # Points up to 0.8 r farther along fill a slice.
    return longest * step + 1.6 * r if longest else 0.0


def _about_cloud(
    scale: Scale, estimated: bool, per_radius: float, near: BoolArray, line: _Line, r: float
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


def _about_rest(
    others: list[_Line], line: _Line, r: float, place_of: Callable[[Array], Array], *, in_view: bool
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


def _about_ends(line: _Line, r: float, place_of: Callable[[Array], Array]) -> list[Finding]:
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


def _about_bridges(bridges: list[Bridge], line: _Line, r: float, place_of: Callable[[Array], Array]) -> list[Finding]:
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
            findings.append(_gap_finding(item.gap, share, s, place, join.cost))
    return findings


def _gap_finding(gap: float, share: float, s: float, place: tuple[float, float, float], cost: float = 0.0) -> Finding:
    message = f"no points for {millimetres(gap)} ({share:.1%} of the length); the gap was bridged"
    if share > _LARGE_GAP:
        return GAP.found(f"{message}, but these may be two objects", "bad", s=s, position=place)
    return GAP.found(message, "note" if share < _SMALL_GAP and cost < 0.6 else "doubtful", s=s, position=place)
