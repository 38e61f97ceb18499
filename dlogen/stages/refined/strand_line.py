"""The skeleton line of a strip: an object whose depth is noise, seen from one side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.vectors import normals_to, unit
from dlogen.stages.quality.contacts import find_contacts
from dlogen.stages.quality.findings import (
    CROSSING,
    GAP,
    NOISE,
    POSITION_UNCERTAIN,
    RADIUS_MISMATCH,
    RADIUS_UNKNOWN,
    RADIUS_VARIES,
    SIDE_BY_SIDE,
    SIDE_UNKNOWN,
    STRAND,
)
from dlogen.stages.refined.fit_findings import gap_findings
from dlogen.stages.refined.ordering import Ordering
from dlogen.stages.refined.strand import Strand, fit_strand
from dlogen.stages.refined.strand_axis import StrandFit, object_of
from dlogen.stages.view import ONE_SIDED, View, rays, thin_direction
from dlogen.types import Array, Finding
from dlogen.types.texts import millimetres

#: A cloud so many given radii wide shows nothing of the surface.
_THREAD = 1.8

#: Standard deviations by which the edges of a strip must be behind its middle to tell the side that it is seen from.
_SURE = 4.0

#: Relative deviation of the width of a stretch that is reported.
_UNEVEN = 0.35

#: Relative deviation of a given radius from half the width that is reported: masks are a pixel or two too wide.
_CONTRADICTED = 0.5

#: Strands beside each other for longer than this, in radii, may have been mixed up.
_SIDE_BY_SIDE = 10.0


def strand_fit(
    points: Array, viewpoint: Array | None, ordering: Ordering, radius: float | None
) -> tuple[StrandFit, bool] | None:
    """The object that a strip shows, and whether it is known from which side; None if the cloud is no strip.

    Args:
        points: (M, 3) metres.
        viewpoint: (3,) where they were seen from, metres, if that is known.
        ordering: of the cloud.
        radius: the given one, metres.
    """
    origin = ordering.backbone.mean(axis=0)
    near, backbone = points - origin, ordering.backbone - origin
    columns = np.ascontiguousarray(near.T)
    half_width = ordering.half_width if ordering.noisy else ordering.radius
    direction, ratio = thin_direction(near, backbone)
    if ordering.thread or (viewpoint is None and ratio < ONE_SIDED):
        if not ordering.thread and (radius is None or half_width < _THREAD * radius):
            return None
        strand = fit_strand(columns, _any_view(backbone), backbone, half_width)
        return object_of(strand, columns, _any_view(backbone), radius, origin, side=True, around=True), True
    view = rays(None if viewpoint is None else viewpoint - origin, direction)
    strand = fit_strand(columns, view, backbone, half_width)
    side = viewpoint is not None
    if not side:
        sure = _behind_at_edges(strand)
        if sure < 0.0:
            view = rays(None, -direction)
            strand = replace(strand, depth=-strand.depth, across=-strand.across)
        side = abs(sure) > _SURE
    return object_of(strand, columns, view, radius, origin, side=side), side


def _any_view(backbone: Array) -> View:
    """A view across the line everywhere: where the noise is the same all around, any direction will do."""
    across = normals_to(unit(np.gradient(backbone, axis=0)))
    tree = cKDTree(backbone)

    def view(places: Array) -> Array:
        return np.ascontiguousarray(across[tree.query(places.T)[1]].T)

    return view


def _behind_at_edges(strand: Strand) -> float:
    """By how many standard deviations the edges of the strip are behind its middle, along the view."""
    near = (strand.deviation < 1.0) & strand.on_curve
    depth, squares = strand.depth[near], strand.across[near] ** 2
    squares = squares - squares.mean()
    slope = float(depth @ squares / (squares @ squares))
    left = depth - depth.mean() - slope * squares
    independent = len(depth) / strand.inflation[0]
    return slope / float(np.sqrt(left @ left / (squares @ squares) / max(independent, 1.0)))


def strand_findings(fit: StrandFit, ordering: Ordering, known: float | None, side: bool) -> list[Finding]:
    """What a user should know about it."""
    line = fit.skeleton
    message = f"seen as a strip {millimetres(2.0 * fit.half_width)} wide; along the view the points scatter by "
    message += f"{millimetres(fit.noise)}, and about {fit.shared:.0f} neighbours share what they are off by"
    findings = [item for item in ordering.findings if not GAP.matches(item) and not CROSSING.matches(item)]
    findings += [STRAND.found(message), *gap_findings(ordering, line, fit.half_width, fit.gaps)]
    findings.append(NOISE.found(f"the points scatter by {millimetres(fit.noise)} along the view", "note"))
    if not side:
        findings.append(SIDE_UNKNOWN.found("seen from one side, and the points do not tell from which"))
        message = (
            "no cross-section is that of one round object: this is a strip seen from one side, or strands lie side "
        )
        findings.append(SIDE_BY_SIDE.found(message + "by side: give r, and the sensor's position"))
    if known is None and not fit.radius_known:
        share = 100.0 * fit.radius_std / fit.radius
        findings.append(RADIUS_UNKNOWN.found(f"the width of the strip tells the radius to {share:.0f} % only: give r"))
    if known is not None and fit.regime == "strand" and abs(fit.half_width / known - 1.0) > _CONTRADICTED:
        message = f"r = {millimetres(known)} was given, but the strip is {millimetres(2.0 * fit.half_width)} wide"
        findings.append(RADIUS_MISMATCH.found(message))
    known_to = fit.uncertainty.position
    worst = int(np.argmax(known_to))
    if known_to[worst] > fit.radius:
        text = f"the line is known to {millimetres(float(known_to[worst]))} only here"
        findings.append(POSITION_UNCERTAIN.at(line, float(fit.uncertainty.s[worst]), text))
    return [*findings, *_widths(fit), *_contacts(fit, ordering)]


def _widths(fit: StrandFit) -> list[Finding]:
    if len(fit.widths) < 3:
        return []
    odd = np.abs(fit.widths[:, 1] / fit.half_width - 1.0)
    worst = int(np.argmax(odd))
    if odd[worst] < _UNEVEN:
        return []
    s = float(np.clip(fit.widths[worst, 0] / fit.skeleton.length, 0.0, 1.0))
    here, usual = millimetres(2.0 * float(fit.widths[worst, 1])), millimetres(2.0 * fit.half_width)
    text = f"the strip is {here} wide here, elsewhere {usual}"
    return [RADIUS_VARIES.at(fit.skeleton, s, text, "note")]


def _contacts(fit: StrandFit, ordering: Ordering) -> list[Finding]:
    """Where the strip crosses itself or lies beside itself: which strand is in front is noise."""
    even = fit.skeleton(even_parameters(fit.skeleton, max(round(fit.skeleton.length / fit.half_width) + 1, 3)))
    findings = []
    for contact in find_contacts(even, fit.half_width):
        if contact.run > _SIDE_BY_SIDE * fit.half_width:
            message = f"two strands run side by side for {millimetres(contact.run)}: they may have been mixed up"
            findings.append(SIDE_BY_SIDE.found(message, s=contact.s, position=contact.position))
        else:
            findings.append(CROSSING.found("the object crosses itself", "note", s=contact.s, position=contact.position))
    return findings + [item for item in ordering.findings if CROSSING.matches(item)]
