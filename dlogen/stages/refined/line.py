"""The skeleton line of the profile refined: a robust fit of the tube, from an order that survives real captures."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dlogen.config.fields import given
from dlogen.config.schema import Config
from dlogen.errors import FitError
from dlogen.geometry.arc_length import even_parameters
from dlogen.stages.bed import bed_points
from dlogen.stages.clock import Clock
from dlogen.stages.prepare import check_given_radius
from dlogen.stages.quality.checks import (
    check_bends,
    check_followed,
    check_radius,
    check_radius_along,
    check_settings_used,
    explained,
)
from dlogen.stages.quality.contacts import check_contacts
from dlogen.stages.quality.cross_section import check_cross_section
from dlogen.stages.quality.cut_ends import cut_ends
from dlogen.stages.quality.findings import CLOSED_RING, RADIUS_UNKNOWN, SIDE_BY_SIDE, STRAY_POINTS
from dlogen.stages.quality.hidden_ends import ends_not_seen
from dlogen.stages.quality.left_over import check_left_over
from dlogen.stages.quality.ripples import check_ripples
from dlogen.stages.quality.roundness import check_roundness
from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.caps import on_faces
from dlogen.stages.refined.collars import about_collars, find_collars
from dlogen.stages.refined.fit_findings import fit_findings
from dlogen.stages.refined.node_line import clear_nodes, possible_nodes
from dlogen.stages.refined.ordering import Ordering, order_strip
from dlogen.stages.refined.plugs import with_plugs
from dlogen.stages.refined.refine import Refined, refine
from dlogen.stages.refined.regime import hides_surface, is_doubted, shows_surface
from dlogen.stages.refined.strand_axis import StrandFit
from dlogen.stages.refined.strand_line import strand_findings, strand_fit
from dlogen.stages.refined.thread import order_any
from dlogen.stages.refined.veil import without_veil
from dlogen.stages.scale import estimate_scale
from dlogen.types import Array, Cloud, Finding, FittedLine, Intermediate

#: What this profile chooses from the data by itself.
_PAPER_ONLY = (
    "r_n",
    "N",
    "beta",
    "normals.neighbours",
    "normals.radius",
    "normals.orientation",
    "projection.enabled",
    "sorting.start",
    "skeleton.tau",
)


def refined_line(cloud: Cloud, config: Config, clock: Clock) -> FittedLine:
    """Scale, ordering without a start point, and a fit of the tube's surface from end to end.

    Args:
        cloud: near the origin, metres.
        config: only `r` is used.
        clock: takes the time of each stage.

    Raises:
        ConfigError: the given radius is larger than the cloud.
        FitError: no line can be made from it.
    """
    points, known = cloud.points, given(config.r)
    nodes = clear_nodes(points, known)
    if nodes is not None:
        return replace(nodes, findings=(*check_settings_used(config, _PAPER_ONLY), *nodes.findings))
    try:
        return _tube_line(cloud, known, config, clock)
    except FitError:
        # What has no width is no tube, but may be the nodes of a tracker.
        nodes = possible_nodes(points, known)
        if nodes is None:
            raise
        return replace(nodes, findings=(*check_settings_used(config, _PAPER_ONLY), *nodes.findings))


def _tube_line(cloud: Cloud, known: float | None, config: Config, clock: Clock) -> FittedLine:
    """The line of points that lie on a surface."""
    with clock.stage("scale"):
        check_given_radius(cloud.points, known)
        cloud, on_bed = _off_its_bed(cloud)
        points = cloud.points
        scale = estimate_scale(points, radius=known)

    with clock.stage("ordering"):
        bridging = Bridging.of(config)
        first = order_any(points, known, scale, cloud.viewpoint, bridging)
        cloud, ordering = without_veil(cloud, known, first, bridging)
        points = cloud.points
        if cloud.viewpoint is not None and not ordering.noisy and any(item.is_bad for item in ordering.findings):
            # Strands that meet are told apart by their edges in the view where noise mixes up their surfaces.
            seen = order_strip(points, scale, known, cloud.viewpoint, bridging)
            if sum(item.is_bad for item in seen.findings) < sum(item.is_bad for item in ordering.findings):
                ordering = seen

    with clock.stage("refine"):
        fitted = _fitted(cloud, ordering, known)
    if isinstance(fitted, _Surface):
        line, gaps = _of_surface(points, fitted, config), fitted.fit.gaps
    else:
        line, gaps = _of_strand(points, ordering, *fitted, config), fitted[0].gaps
    unseen = ends_not_seen(points, line.on_tube, line.skeleton, line.radius, cloud.viewpoint)
    findings = bridging.about([*line.findings, *unseen], gaps, line.skeleton.length)
    return replace(line, findings=(*on_bed, *findings))


def _off_its_bed(cloud: Cloud) -> tuple[Cloud, list[Finding]]:
    """The cloud without a strip of what the object lies on, and what is said about that."""
    bed = bed_points(cloud.points)
    if not bed.any():
        return cloud, []
    normals = None if cloud.normals is None else cloud.normals[~bed]
    share = 100.0 * float(bed.mean())
    message = f"{share:.0f} % of the points lie in one plane beside the object, as what it lies on: they were left out"
    return replace(cloud, points=cloud.points[~bed], normals=normals), [STRAY_POINTS.found(message, "note")]


class _Surface(NamedTuple):
    """A tube, what it was fitted to (the points, with plugs as thick as the object), and the order of these."""

    moved: Array
    ordering: Ordering
    fit: Refined


def _fitted(cloud: Cloud, ordering: Ordering, known: float | None) -> _Surface | tuple[StrandFit, bool]:
    """The tube, or the strip where the noise hides the surface; with the latter, whether its side is known."""
    points = cloud.points
    seen = _strip(cloud, ordering, known) if ordering.noisy else None
    if seen is not None and (ordering.thread or hides_surface(seen[0])):
        return seen
    failed = None
    try:
        fitted = refine(points, ordering.backbone, ordering.radius, fixed_radius=known is not None)
        plugged = None if ordering.noisy else with_plugs(points, ordering, fitted, known is not None)
        surface = _Surface(points, ordering, fitted) if plugged is None else _Surface(*plugged)
        fitted = surface.fit
        if not ordering.noisy and not is_doubted(fitted):
            return surface
    except FitError as reason:
        if any(item.is_bad for item in ordering.findings):
            raise explained(reason, ordering.findings) from reason
        fitted, failed = None, reason
    if not ordering.noisy:
        seen = _strip(cloud, ordering, known)
    if seen is not None and (fitted is None or not shows_surface(fitted, seen[0])):
        return seen
    if fitted is None:
        assert failed is not None
        raise explained(failed, ordering.findings) from failed
    return surface


def _strip(cloud: Cloud, ordering: Ordering, known: float | None) -> tuple[StrandFit, bool] | None:
    """What the cloud shows as a strip; None where it is none."""
    try:
        return strand_fit(cloud.points, cloud.viewpoint, ordering, known)
    except FitError:
        return None


def _of_strand(points: Array, ordering: Ordering, fit: StrandFit, side: bool, config: Config) -> FittedLine:
    """The line of an object of which a strip was seen."""
    along = np.flatnonzero(fit.inliers)[np.argsort(fit.s[fit.inliers], kind="stable")]
    return FittedLine(
        fit.skeleton,
        fit.radius,
        fit.residuals + fit.radius,
        fit.inliers,
        (
            Intermediate("ordering", ordering.backbone),
            Intermediate("tube", points[along], {"s": fit.s[along], "residual": fit.residuals[along]}, colour="s"),
            Intermediate("off_tube", points[~fit.inliers], {"residual": fit.residuals[~fit.inliers]}),
        ),
        (
            *check_settings_used(config, _PAPER_ONLY),
            *strand_findings(fit, ordering, given(config.r), side),
            *check_left_over(points, fit.skeleton, fit.half_width, fit.noise),
        ),
        {"r": fit.radius, "N": fit.skeleton.basis.size},
        fit.regime,
        fit.uncertainty,
    )


def _of_surface(points: Array, surface: _Surface, config: Config) -> FittedLine:
    """The line of an object whose surface was seen."""
    known = given(config.r)
    moved, ordering, fitted = surface
    skeleton, radius, s, residual, on_tube = (
        fitted.skeleton,
        fitted.radius,
        fitted.s,
        fitted.residuals,
        fitted.inliers,
    )
    along = np.flatnonzero(on_tube)[np.argsort(s[on_tube], kind="stable")]
    oval = any(SIDE_BY_SIDE.matches(item) for item in ordering.findings)
    # The two ends of a ring overlap.
    ring = any(CLOSED_RING.matches(item) and item.is_bad for item in ordering.findings)
    even = skeleton(even_parameters(skeleton, round(skeleton.length / radius) + 1))
    collars = find_collars(fitted)
    ordering = replace(ordering, findings=tuple(about_collars(ordering.findings, collars, fitted)))
    # What is said of them already.
    usual = ~np.any([np.zeros(len(s), dtype=bool), *(collar.points for collar in collars)], axis=0)
    faces = on_faces(s, residual, on_tube, fitted.closed, radius / skeleton.length)
    return FittedLine(
        skeleton,
        radius,
        # The faces of closed ends are no points that a tube would have missed.
        np.where(faces, np.inf, residual + radius),
        on_tube,
        (
            Intermediate("ordering", ordering.backbone),
            Intermediate("tube", points[along], {"s": s[along], "residual": residual[along]}, colour="s"),
            Intermediate("off_tube", points[~on_tube], {"residual": residual[~on_tube]}),
        ),
        (
            *check_settings_used(config, _PAPER_ONLY),
            *fit_findings(ordering, fitted),
            *([] if ring else check_contacts(even, ordering.backbone, radius)),
            *cut_ends(moved, s, on_tube, skeleton, radius, fitted.closed),
            *check_followed(moved, ordering.backbone, residual + radius, radius),
            *check_left_over(moved[usual & ~faces], skeleton, radius, fitted.noise),
            *check_radius_along(skeleton, radius, s[usual], residual[usual] + radius),
            *check_ripples(skeleton, radius, s[on_tube], residual[on_tube]),
            *([] if oval else _section_findings(moved, fitted, known)),
            *check_bends(skeleton, radius, s[on_tube]),
            *([] if known is None else check_radius(known, estimate_scale(points))),
        ),
        {"r": radius, "N": skeleton.basis.size},
        uncertainty=fitted.uncertainty,
    )


def _section_findings(points: Array, fitted: Refined, known: float | None) -> list[Finding]:
    """Whether the cross-section is that of one round object."""
    s, residual, line, radius = fitted.s, fitted.residuals, fitted.skeleton, fitted.radius
    found = check_cross_section(points, s, residual, line, radius)
    if found:
        return found
    unknown = known is None and not fitted.radius_identifiable
    found = check_roundness(points, s, residual, line, radius, shared=fitted.shared, known=known is not None)
    return [item for item in found if not (unknown and RADIUS_UNKNOWN.matches(item))]
