"""The skeleton line through points that are on the axis already (`dlogen.stages.refined.nodes`).

It is a penalised spline (Eilers and Marx, Statistical Science 11, 1996), smoothed as the least generalised
cross-validation error asks for (Craven and Wahba, Numerische Mathematik 31, 1979): exact nodes are interpolated, and
jitter is not followed.
"""

from __future__ import annotations

import numpy as np

from dlogen.config.defaults import R_PER_E_MAX
from dlogen.geometry.arc_length import arc_length, arc_length_table, even_parameters
from dlogen.geometry.basis import CubicBSpline
from dlogen.geometry.curvature import max_curvature
from dlogen.geometry.polyline import arc_lengths, segment_lengths
from dlogen.geometry.vectors import as_place, unit
from dlogen.stages.prepare import check_given_radius
from dlogen.stages.quality.findings import (
    CLOSED_RING,
    CROSSING,
    GAP,
    NOISE,
    RADIUS_UNKNOWN,
    STRAY_POINTS,
    TOO_FEW_POINTS,
)
from dlogen.stages.quality.residual import foot_points
from dlogen.stages.refined.nodes import MAY_BE_NEAR, MOST_NODES, NodeOrder, is_thin, order_nodes
from dlogen.stages.scale import estimate_scale
from dlogen.types import Array, Finding, FittedLine, Intermediate, Severity, Skeleton
from dlogen.types.texts import counted, millimetres

#: The most intervals of the spline; with fewer nodes there is one between any two.
_INTERVALS = 250
#: Strengths of the smoothing that are tried, over that at which the data and the penalty weigh the same.
_SMOOTHING = np.logspace(-6.0, 6.0, 25)
#: A curve that is so many times as long as the polyline through the nodes swings.
_SWINGS = 1.3
#: Rounds of looking for the places of the nodes on the curve.
_ROUNDS = 3
#: Samples of the curve for each interval, when it is given the arc length as parameter.
_SAMPLES = 8
#: A radius that is not known is this share of the length, but no more than this share of the smallest bend radius, and
#: no less than this share of the length.
_SLENDER, _BENT, _THINNEST = 1.0 / 200.0, 0.5, 1.0 / 1000.0
#: Steps of so many usual ones are gaps; shares of the length up to which they are bridged without doubt, and beyond
#: which there are two objects.
_GAP, _SMALL_GAP, _LARGE_GAP = 4.0, 0.05, 0.3
#: Cosine of the angle between a gap and the line at both of its ends below which these are two objects.
_ASIDE = 0.5
#: Share of the nodes, at either end, that may be strays.
_STRAYS = 0.04
#: Ends so many usual steps apart are those of a ring.
_RING = 1.6
#: Scatter over the radius that is worth a note, and over a given radius beyond which the line is doubtful.
_NOTED, _NOISY = 0.01, 0.5


def clear_nodes(points: Array, known: float | None) -> FittedLine | None:
    """The line of a cloud whose points clearly are nodes on the axis; None for any other cloud.

    Args:
        points: (M, 3) metres.
        known: the radius, metres, if it was given.

    Raises:
        ConfigError: the given radius is larger than the cloud.
    """
    order = clear_order(points)
    return None if order is None else node_line(points, order, known)


def clear_order(points: Array) -> NodeOrder | None:
    """The order of a cloud whose points clearly are nodes on the axis, in any units; None for any other cloud."""
    if len(points) > MOST_NODES and not is_thin(points):
        return None
    order = order_nodes(points, clear=True)
    if order is None or not order.likely:
        return None
    # Points of scan lines along a tube lie on lines, too, but show a radius.
    return order if order.certain or not estimate_scale(points).radius_reliable else None


def possible_nodes(points: Array, known: float | None) -> FittedLine | None:
    """As `clear_nodes`, of a cloud that is no tube: its points may scatter more about the line, and be more."""
    order = order_nodes(points)
    return node_line(points, order, known) if order is not None and order.possible else None


def flat_nodes(points: Array) -> bool:
    """Whether a flat cloud is that of nodes on the axis, which a curve in a plane has: (M, 3) in any units.

    Whole numbers are taken for pixels.
    """
    extent = np.ptp(points, axis=0)
    if extent.min() > 1e-9 * extent.max() or not (points % 1.0).any():
        return False
    return clear_order(points) is not None


def node_line(points: Array, order: NodeOrder, known: float | None) -> FittedLine:
    """A smooth curve through nodes in order.

    Args:
        points: (M, 3) all points of the cloud, metres.
        order: of the nodes among them.
        known: the radius, metres, if it was given.

    Raises:
        ConfigError: the given radius is larger than the cloud.
    """
    check_given_radius(points, known)
    nodes = _without_strays(order)
    line = smooth_line(nodes)
    s, distance = foot_points(points, line)
    radius, findings = known, list[Finding]()
    if radius is None:
        kappa = max_curvature(line)[0]
        bent = max(_BENT / kappa, _THINNEST * line.length) if kappa > 0.0 else np.inf
        radius = min(_SLENDER * line.length, bent)
        message = (
            f"the points lie on a line and show no width: the radius of {millimetres(radius)} is a guess, and so is "
            f"e_max where it is r / {R_PER_E_MAX}: give r (--set r=..., in metres)"
        )
        findings.append(RADIUS_UNKNOWN.found(message))
    on_line = distance < _GAP * order.spacing
    scatter = float(np.sqrt(np.mean(distance[on_line] ** 2)))
    findings += [
        *_about_strays(int((~on_line).sum()), len(points)),
        *_about_scatter(scatter, known, radius),
        *_about_steps(nodes, order.spacing),
        *_about_strands(order),
        *_about_order(order),
    ]
    along = np.argsort(s, kind="stable")
    return FittedLine(
        line,
        radius,
        # Nodes are inside of the object: anywhere in it is right.
        np.maximum(distance, radius),
        on_line,
        (
            Intermediate("ordering", nodes),
            Intermediate("tube", points[along], {"s": s[along], "residual": distance[along]}, colour="s"),
        ),
        tuple(findings),
        {"r": radius, "N": line.basis.size},
    )


def smooth_line(nodes: Array) -> Skeleton:
    """The penalised spline through nodes in order, with s proportional to arc length: (K, 3) metres."""
    origin = nodes.mean(axis=0)
    near = nodes - origin
    basis = CubicBSpline(int(np.clip(len(nodes) - 1, 4, _INTERVALS)) + 3)
    length = float(segment_lengths(near).sum())
    curve = _fitted(basis, near, arc_lengths(near) / length, length, _SMOOTHING)
    for _ in range(_ROUNDS):
        # Along the line, jitter makes steps longer and changes the order of near nodes.
        s = np.interp(foot_points(near, curve, 8 * basis.size)[0], *arc_length_table(curve))
        low, high = float(s.min()), float(s.max())
        curve = _fitted(basis, near, (s - low) / (high - low), length, _SMOOTHING)
    samples = _SAMPLES * basis.size
    even = curve(even_parameters(curve, samples))
    weights = np.asarray(np.linalg.lstsq(basis(np.linspace(0.0, 1.0, samples)), even, rcond=None)[0], dtype=np.float64)
    return Skeleton(basis, weights, origin, arc_length(Skeleton(basis, weights, origin, 1.0)))


def _fitted(basis: CubicBSpline, nodes: Array, s: Array, length: float, strengths: Array) -> Skeleton:
    """The spline through nodes at places s, smoothed as far as it has to be in order not to swing.

    Args:
        basis: of the spline.
        nodes: (K, 3) metres.
        s: (K,) their places on it.
        length: of the polyline through the nodes, metres.
        strengths: of the smoothing, those that are tried.
    """
    curve = Skeleton(basis, _penalised(basis, s, nodes, strengths), np.zeros(3), 1.0)
    # Where a jump follows a step, a spline that hardly is smoothed makes a loop.
    if len(strengths) > 1 and arc_length(curve) > _SWINGS * length:
        return _fitted(basis, nodes, s, length, strengths[1:])
    return curve


def _penalised(basis: CubicBSpline, s: Array, nodes: Array, strengths: Array) -> Array:
    """Weights of the spline with the least generalised cross-validation error: (K,), (K, 3) -> (N, 3)."""
    values = basis(s)
    third = np.diff(np.eye(basis.size), 3, axis=0)
    normal, penalty = values.T @ values, third.T @ third
    right = values.T @ nodes
    scale = float(np.trace(normal) / np.trace(penalty))
    best, chosen = np.inf, np.empty((basis.size, 3))
    for strength in scale * strengths:
        inverse = np.linalg.inv(normal + strength * penalty)
        weights = inverse @ right
        free = len(s) - float(np.einsum("ij,ji->", inverse, normal))
        error = float(((nodes - values @ weights) ** 2).sum()) / max(free, 1e-9) ** 2
        if error < best:
            best, chosen = error, weights
    return chosen


def _about_scatter(scatter: float, known: float | None, radius: float) -> list[Finding]:
    if scatter <= _NOTED * radius:
        return []
    doubtful = known is not None and scatter > _NOISY * known
    message = f"the points are {millimetres(scatter)} from the line (root mean square)"
    return [NOISE.found(message, "doubtful" if doubtful else "note")]


def _without_strays(order: NodeOrder) -> Array:
    """The nodes without the few at the ends that are far from all others: (K, 3) metres."""
    few = max(1, int(_STRAYS * len(order.points)))
    far = np.flatnonzero(segment_lengths(order.points) > _GAP * order.spacing)
    first = far[far < few].max(initial=-1) + 1
    last = far[far >= len(order.points) - 1 - few].min(initial=len(order.points) - 1)
    return order.points[first : last + 1]


def _about_strays(count: int, of: int) -> list[Finding]:
    if count == 0:
        return []
    message = f"{counted(count, 'point')} of {of} do not lie on the line and were left out"
    return [STRAY_POINTS.found(message, "note" if count <= _STRAYS * of else "doubtful")]


def _about_steps(nodes: Array, spacing: float) -> list[Finding]:
    """Gaps between nodes, and whether the ends are those of a ring."""
    steps = segment_lengths(nodes)
    s = arc_lengths(nodes) / steps.sum()
    findings = []
    way = unit(np.diff(nodes, axis=0))
    for i in np.flatnonzero(steps > _GAP * spacing).tolist():
        # Ends that do not face one another are those of two objects.
        aside = 0 < i < len(steps) - 1 and max(way[i] @ way[i - 1], way[i] @ way[i + 1]) < _ASIDE
        share = float(steps[i] / steps.sum())
        middle = as_place(0.5 * (nodes[i] + nodes[i + 1]))
        message = f"no points for {millimetres(float(steps[i]))} ({share:.1%} of the length); the gap was bridged"
        message += ", but these may be two objects" if aside or share > _LARGE_GAP else ""
        severity: Severity = "bad" if aside or share > _LARGE_GAP else "doubtful" if share > _SMALL_GAP else "note"
        findings.append(GAP.found(message, severity, s=float(0.5 * (s[i] + s[i + 1])), position=middle))
    if float(np.linalg.norm(nodes[0] - nodes[-1])) < _RING * spacing:
        place = as_place(nodes[0])
        findings.append(
            CLOSED_RING.found("the points are those of a closed ring: it has no ends", "bad", s=0.0, position=place)
        )
    return findings


def _about_order(order: NodeOrder) -> list[Finding]:
    """Whether strands are as near to one another as nodes are."""
    if order.near <= MAY_BE_NEAR:
        return []
    message = f"{100 * order.near:.0f} % of the points are as near to another strand as to their own neighbours"
    return [TOO_FEW_POINTS.found(f"{message}: the order is uncertain")]


def _about_strands(order: NodeOrder) -> list[Finding]:
    """Places where strands come so near to one another that another order would be nearly as good."""
    if not len(order.doubtful):
        return []
    s = arc_lengths(order.points) / segment_lengths(order.points).sum()
    # Neighbouring nodes are one place.
    places = np.split(order.doubtful, np.flatnonzero(np.diff(order.doubtful) > 3) + 1)
    message = "strands meet here, and which of them belong together is not certain"
    middles = [int(place[len(place) // 2]) for place in places]
    return [CROSSING.found(message, "doubtful", s=float(s[i]), position=as_place(order.points[i])) for i in middles]
