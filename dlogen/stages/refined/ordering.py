"""From a raw cloud to a rough, ordered centre line, without a start point (the sorting walk of the paper's III.B).

The order comes from pieces that are certain (`dlogen.stages.refined.branches`); where it stays ambiguous, a finding
says so. What comes out is the same for every order of the input points.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.geometry.polyline import arc_lengths, resample, segment_lengths
from dlogen.geometry.sampling import middle, spatial_sample
from dlogen.geometry.vectors import as_place
from dlogen.stages.quality.findings import (
    TOO_FEW_POINTS,
)
from dlogen.stages.refined.about_order import about_bridges, about_cloud, about_ends, about_rest, gap_finding
from dlogen.stages.refined.beads import string_beads
from dlogen.stages.refined.branches import cut_at_junctions, trace_pieces
from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.joins import chains, ways_to_join
from dlogen.stages.refined.medial import axis_votes, contract, recentre, votes_agree
from dlogen.stages.refined.ordered_line import Bridge, OrderedLine, bridges_of, longest_of, runs_backwards
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
#: A cloud so many given radii wide, whose surface is that thick, is noise around a thin object.
_HIDDEN, _THICK = 1.8, 0.5
#: Radius, in half widths, that strips are followed with: in space and in the view.
_STRIP, _FLAT_STRIP = 2.0, 1.5
#: The most points that are taken for beads on a string.
_BEADS = 200


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
            [OrderedLine.of(pieces, *chain, r) for chain in chains(len(pieces), way)]
            for way in ways_to_join(pieces, r, bridging)
        ),
        lambda way: float(arc_lengths(place(longest_of(way).points))[-1]),
    )
    longest = longest_of(lines)
    others = [other for other in lines if other is not longest]
    line = longest.canonical()
    near = _around(sample[:: -(-len(sample) // _LOOKED_AT)], line.points, r, scale.noise)
    findings = [
        *about_cloud(scale, estimated, per_radius, near, line, r),
        *about_rest(others, line, r, place, in_view=in_view),
        *about_ends(line, r, place),
    ]
    bridges = bridges_of(line, sample, tree, r)
    findings += about_bridges(bridges, line, r, place)
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
    if runs_backwards(line):
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
        findings.append(gap_finding(float(steps[i]), float(steps[i] / steps.sum()), 0.5 * (s[i] + s[i + 1]), middle))
    parts = np.split(line, [i + 1 for i in np.flatnonzero(steps > 4.0 * typical)])
    return Ordering(line, radius or typical, tuple(parts), tuple(joins), tuple(findings))


def _around(points: Array, line: Array, r: float, noise: float) -> BoolArray:
    """Which points are no farther from the line than the surface is, with some room."""
    reach = 1.5 * r + 3.0 * (noise if np.isfinite(noise) else 0.0)
    dense = resample(line, 2 * len(line))
    step = arc_lengths(dense)[-1] / (len(dense) - 1)
    distance, _ = cKDTree(dense).query(points, distance_upper_bound=float(np.hypot(reach, 0.5 * step)))
    reached: BoolArray = np.isfinite(distance)
    return reached
