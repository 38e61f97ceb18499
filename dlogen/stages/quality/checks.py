"""What a user should know before trusting a chain: refusals before the fit and findings after it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.stages.chain import minimal_rotation_frames
from dlogen.stages.scale import Scale, spatial_sample
from dlogen.stages.segmentation.curvature import curvature
from dlogen.types import Array, BoolArray, Finding, IntArray, Segmentation, Skeleton

#: Fewer points than this cannot show a tube; the paper works with 5,000.
MIN_POINTS = 12

#: Nobody scans cables of this many metres in one cloud.
_LONGEST = 50.0
#: Nor any as short as this, metres.
_SHORTEST = 0.01

#: Extents of clouds, in whatever units, that can be those of an object.
_POSSIBLE = (1e-9, 1e9)
#: Points so many extents of the rest away from it mark missing data, and how many points tell the extent.
_FAR_AWAY, _TELLING = 1000.0, 10_000

#: Stretches of the line whose radius is looked at, and the points that each needs.
_STRETCHES, _PER_STRETCH = 20, 40
#: Deviation of the radius of a stretch from that of the object that is reported, relative.
_UNEVEN = 0.25
#: Deviation of a given radius from that of the cross-sections that is reported, relative.
_CONTRADICTED = 0.15
#: A bend is a guess where a stretch of two radii that turns by so many radians has less than this share of the points
#: that the stretches around it have, and so many were due.
_TURN, _HARDLY, _DUE = 0.5, 0.25, 24
#: Radii on either side that tell how many points are due.
_AROUND = 10
#: Points, stretches of the line and sectors around it that show the shape of the cross-section; the points that a
#: sector needs, and the sectors that a stretch needs; frames along the line.
_SHAPED, _PROFILES, _SECTORS, _PER_SECTOR, _FEWEST_SECTORS, _FRAMES = 10_000, 8, 16, 10, 6, 400
#: A stretch is not round if its shape is more than this, in radii and in standard deviations of the noise; and the
#: object if so many of its stretches are not.
_ODD, _ODD_NOISE, _ODD_SHARE = 0.1, 0.4, 0.75
#: Points that are looked at to see whether the line follows all of the object.
_LOOKED_AT = 4000


def check_points(points: Array, *, surface: bool = True) -> None:
    """Refuse clouds from which no chain can be made.

    Args:
        points: (M, 3) finite points, any units.
        surface: whether the points are those of a surface, so that a flat cloud makes no sense.

    Raises:
        FitError: too few points, all in one place, flat, or pixel coordinates.
    """
    if len(points) < MIN_POINTS:
        raise FitError(
            f"{len(points)} points are too few: at least {MIN_POINTS} are needed",
            "a few hundred points along the object are a good start",
            stage="input",
        )
    extent = np.ptp(points, axis=0)
    size = float(extent.max())
    # What is left of double precision at these coordinates.
    noise_floor = 1e-12 * max(float(np.abs(points).max()), 1e-300)
    if size <= 10.0 * noise_floor:
        raise FitError(f"all {len(points)} points are in one place", "check how the cloud was written", stage="input")
    if not _POSSIBLE[0] <= size <= _POSSIBLE[1]:
        raise FitError(
            f"the cloud is {size:.2g} large, which no object is in metres, centimetres or millimetres",
            "check how the cloud was written",
            stage="input",
        )
    flat = extent <= max(1e-9 * size, 10.0 * noise_floor)
    if flat.any() and surface:
        axis = "xyz"[int(np.argmax(flat))]
        whole = np.all(points[:: max(1, len(points) // 1000)] % 1.0 == 0.0)
        if whole:
            raise FitError(
                f"the points look like two-dimensional pixel data: whole numbers, {axis} the same for all",
                "convert the depth image to metric 3-D points first",
                stage="input",
            )
        raise FitError(
            f"the cloud is flat: {axis} is the same for all points",
            "points on the surface are needed; for points on the centre line set profile to paper, "
            "projection.enabled to false, and give r",
            stage="input",
        )


def far_away(points: Array) -> BoolArray:
    """(M,) which points are so far from all others that they mark missing data, as 1e10 or the largest float do.

    Args:
        points: (M, 3) finite points, any units.
    """
    none = np.zeros(len(points), dtype=bool)
    if len(points) < MIN_POINTS:
        return none
    low, middle, high = np.quantile(points[:: -(-len(points) // _TELLING)], [0.05, 0.5, 0.95], axis=0)
    reach = _FAR_AWAY * float((high - low).max())
    lowest, highest = points.min(axis=0), points.max(axis=0)
    if reach == 0.0 or ((lowest > middle - reach) & (highest < middle + reach)).all():
        return none
    result: BoolArray = (np.abs(points - middle) > reach).any(axis=1)
    return result


def check_line(
    line: Skeleton, radius: float, distance: Array, on_tube: BoolArray, max_curvature: tuple[float, float]
) -> list[Finding]:
    """Findings about a skeleton line and the cloud around it, whatever profile made it.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        distance: (M,) distance of every point to the line, metres.
        on_tube: (M,) whether it counts as a point of the tube's surface.
        max_curvature: kappa (1/m) and the s where it is.
    """
    findings = []
    kappa, s_kappa = max_curvature
    if kappa * radius > 1.0:
        text = (
            f"the line bends with a radius of {1e3 / kappa:.3g} mm, tighter than the object's own {1e3 * radius:.3g} mm"
        )
        findings.append(_at(line, "bend-tighter-than-radius", text, "bad", s_kappa))
    # Strays are far from the line; points near it but not on the surface say that there is no tube of this radius.
    near = distance < 2.5 * radius
    off = float(np.mean(~on_tube[near])) if near.any() else 1.0
    if off > 0.1:
        findings.append(
            Finding(
                "points-off-the-tube",
                f"{100 * off:.0f} % of the points around the line are not on a tube of radius {1e3 * radius:.3g} mm: "
                "the cloud is something else, or the fit failed",
                "bad" if off > 0.3 else "doubtful",
            )
        )
    median = float(np.median(distance[near])) if near.any() else 0.0
    if abs(median - radius) > 0.2 * radius:
        findings.append(
            Finding(
                "radius-mismatch",
                f"the points are {1e3 * median:.3g} mm from the line (median), but the radius is {1e3 * radius:.3g} mm",
                "doubtful",
            )
        )
    if line.length > _LONGEST:
        findings.append(
            Finding("units", f"the object is {line.length:.0f} m long: set units (mm, cm) if it is not", "doubtful")
        )
    if line.length < _SHORTEST:
        message = f"the object is only {1e3 * line.length:.2g} mm long: check units"
        findings.append(Finding("units", message, "doubtful"))
    return findings


def check_radius(radius: float | None, free: Scale) -> list[Finding]:
    """Whether the cross-sections contradict a given radius, or tell one if none was given.

    Args:
        radius: the given one, metres.
        free: the scale of the cloud, estimated without it.
    """
    if radius is None:
        message = f"the cross-sections do not agree on a radius; {1e3 * free.radius:.3g} mm is a guess: give r"
        return [] if free.radius_reliable else [Finding("radius-unknown", message, "doubtful")]
    # The estimate is as uncertain as the noise is large.
    if not free.radius_reliable or abs(free.radius - radius) <= max(_CONTRADICTED * radius, free.noise):
        return []
    message = f"r = {1e3 * radius:.3g} mm was given, but the cross-sections have a radius of {1e3 * free.radius:.3g} mm"
    return [Finding("radius-mismatch", message, "doubtful")]


def check_radius_along(line: Skeleton, radius: float, s: Array, distance: Array) -> list[Finding]:
    """Whether the object is thicker or thinner in places: a chain has one radius.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        s: (M,) foot coordinate of every point.
        distance: (M,) distance of every point to the line, metres.
    """
    near = (distance < 2.5 * radius) & (s > 0.0) & (s < 1.0)
    order = np.argsort(s[near])
    s, distance = s[near][order], distance[near][order]
    edges = np.searchsorted(s, np.linspace(0.0, 1.0, _STRETCHES + 1))
    medians = {
        i: float(np.median(distance[low:high]))
        for i, (low, high) in enumerate(pairwise(edges))
        if high - low >= _PER_STRETCH
    }
    if not medians:
        return []
    usual = float(np.median(distance))
    worst = max(medians, key=lambda i: abs(medians[i] - usual))
    if abs(medians[worst] - usual) <= _UNEVEN * usual:
        return []
    text = (
        f"the radius is not the same everywhere: {1e3 * medians[worst]:.3g} mm here, {1e3 * radius:.3g} mm in the model"
    )
    return [_at(line, "radius-varies", text, "doubtful", (worst + 0.5) / _STRETCHES)]


def check_bends(line: Skeleton, radius: float, s: Array) -> list[Finding]:
    """Whether there are points where the line bends: ends of two objects may look like one that turns round.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        s: (K,) foot coordinates of the points on the tube.
    """
    pieces = int(line.length / radius)
    if pieces < 2 * _AROUND:
        return []
    counts = np.bincount(np.minimum((s * pieces).astype(np.intp), pieces - 1), minlength=pieces).astype(float)
    padded = np.pad(counts, _AROUND, mode="reflect")
    due = 2.0 * np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1)[1:]
    turn = np.pad(curvature(line, (np.arange(pieces) + 0.5) / pieces) * line.length / pieces, 1)
    # From half a radius before the two to half a radius after them.
    turn = turn[1:-2] + turn[2:-1] + 0.5 * (turn[:-3] + turn[3:])
    found = counts[:-1] + counts[1:]
    guessed = np.flatnonzero((turn > _TURN) & (found < _HARDLY * due) & (due >= _DUE))
    if not len(guessed):
        return []
    worst = guessed[np.argmax(turn[guessed])]
    angle = np.degrees(turn[worst])
    text = f"hardly any points are on the tube where it turns by {angle:.0f} degrees: the bend is a guess"
    return [_at(line, "gap", text, "doubtful", (worst + 1.0) / pieces)]


def check_cross_section(points: Array, s: Array, residual: Array, line: Skeleton, radius: float) -> list[Finding]:
    """Whether the cross-section is that of one tube, and not of two that lie side by side.

    The fit makes up for what the residual is all around the axis and for what it is more on one side than on the other
    (its harmonics 0 and 1). What else it is in the same place around the axis all along the line is shape.

    Args:
        points: (M, 3) metres.
        s: (M,) foot coordinate of every point.
        residual: (M,) its distance to the tube's surface, positive outside, metres.
        line: the skeleton line.
        radius: of the object, metres.
    """
    near = np.flatnonzero((np.abs(residual) < radius) & (s > 0.0) & (s < 1.0))
    if len(near) < _PROFILES * _FEWEST_SECTORS * _PER_SECTOR // 2:
        return []
    near = near[spatial_sample(points[near], _SHAPED)]
    points, s, residual = points[near], s[near], residual[near]
    tangent = line((np.arange(_FRAMES) + 0.5) / _FRAMES, 1)
    frames = minimal_rotation_frames(tangent / np.linalg.norm(tangent, axis=1, keepdims=True))
    across = frames[(s * _FRAMES).astype(np.intp), :, 1:]
    y, z = np.einsum("ij,ijk->ki", points - line(s), across)
    sector = ((np.arctan2(z, y) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.intp) % _SECTORS
    cell = (s * _PROFILES).astype(np.intp) * _SECTORS + sector
    order = np.lexsort((residual, cell))
    cell, residual = cell[order], residual[order]
    counts = np.bincount(cell, minlength=_PROFILES * _SECTORS)
    first = np.cumsum(counts) - counts
    medians = residual[np.minimum(first + counts // 2, len(residual) - 1)]
    off = np.abs(residual - medians[cell])
    rows = [slice(k * _SECTORS, (k + 1) * _SECTORS) for k in range(_PROFILES)]
    parts = np.split(off, first[_SECTORS::_SECTORS])
    shapes = [_shape(counts[row], medians[row], part) for row, part in zip(rows, parts, strict=True)]
    known = [shape for shape in shapes if shape is not None]
    odd = [shape > _ODD * radius and shape > _ODD_NOISE * noise for shape, noise in known]
    if len(known) < 0.5 * _PROFILES or sum(odd) < _ODD_SHARE * len(known):
        return []
    message = "the cross-sections are not those of one round object: two strands may lie side by side"
    return [Finding("side-by-side", message, "doubtful")]


def _shape(counts: IntArray, medians: Array, off: Array) -> tuple[float, float] | None:
    """How much of a stretch's residual is shape, beyond harmonics 0 and 1, and how much noise: root mean squares.

    Args:
        counts: (S,) points of each sector.
        medians: (S,) of their residuals, metres.
        off: (K,) how far the residuals are from those, metres.

    Returns:
        Both in metres; None where there are too few points.
    """
    full = np.flatnonzero(counts >= _PER_SECTOR)
    if len(full) < _FEWEST_SECTORS:
        return None
    noise = 1.4826 * float(np.median(off))
    angle = (full + 0.5) * (2.0 * np.pi / _SECTORS)
    weight = np.sqrt(counts[full] / counts[full].sum())
    harmonics = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1) * weight[:, None]
    rest = medians[full] * weight
    rest = rest - harmonics @ np.linalg.lstsq(harmonics, rest, rcond=None)[0]
    # A median of n is uncertain by 1.25 standard deviations over the root of n.
    chance = 1.57 * noise**2 * (len(full) - 3) / counts[full].sum()
    return float(np.sqrt(max(rest @ rest - chance, 0.0))), noise


def check_followed(points: Array, backbone: Array, distance: Array, radius: float) -> list[Finding]:
    """Whether the skeleton line follows all of the rough line that it was made from.

    Args:
        points: (M, 3) metres.
        backbone: (K, 3) vertices of the rough line, about a radius apart, metres.
        distance: (M,) distance of the points to the skeleton line, metres.
        radius: of the object, metres.
    """
    chosen = spatial_sample(points, _LOOKED_AT)
    near = np.isfinite(cKDTree(backbone).query(points[chosen], distance_upper_bound=2.0 * radius)[0])
    if not near.any():
        return []
    share = float(np.mean(distance[chosen][near] > 2.5 * radius))
    if share <= 0.02:
        return []
    message = f"the line misses {100 * share:.0f} % of the points along the object"
    return [Finding("points-not-reached", message, "bad" if share > 0.15 else "doubtful")]


def on_surface(distance: Array, radius: float) -> BoolArray:
    """Which points count as points of the tube's surface, by the spread of their own distances to it.

    Args:
        distance: (M,) to the skeleton line, metres.
        radius: of the object, metres.
    """
    error = np.abs(distance - radius)
    # Four standard deviations (the median absolute deviation is 0.67 of one), within half a radius and one.
    result: BoolArray = error < np.clip(4.0 * 1.4826 * float(np.median(error)), 0.5 * radius, radius)
    return result


def check_walk(line: Skeleton, radius: float, s: Array, on_tube: BoolArray, unreached: int) -> list[Finding]:
    """Findings about the paper's sorting walk, which knows nothing of gaps, branches and rings.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        s: (M,) foot coordinate of every point.
        on_tube: (M,) whether it counts as a point of the tube's surface.
        unreached: number of points that the walk did not reach.
    """
    findings = []
    share = unreached / len(s)
    if share > 0.02:
        findings.append(
            Finding(
                "points-not-reached",
                f"{100 * share:.0f} % of the points were not reached along the object: strays, a branch, a gap "
                "or a second object",
                "bad" if share > 0.15 else "doubtful",
            )
        )
    return [*findings, *_gaps(line, radius, s[on_tube]), *_closed(line, radius)]


def check_deviation(line: Skeleton, segmentation: Segmentation, e_max: float) -> list[Finding]:
    """Whether the chain is farther from the line than allowed: where its segments were given, it may be.

    Args:
        line: the skeleton line.
        segmentation: of it.
        e_max: largest deviation allowed, metres.
    """
    # Eq. 17 is met to rounding on an arc.
    if segmentation.deviation <= e_max * (1.0 + 1e-9):
        return []
    message = (
        f"the chain is {1e3 * segmentation.deviation:.2f} mm off the skeleton line, more than e_max = "
        f"{1e3 * e_max:.2f} mm"
    )
    return [_at(line, "deviation-above-e_max", message, "doubtful", segmentation.deviation_s)]


def _gaps(line: Skeleton, radius: float, s: Array) -> list[Finding]:
    """Stretches without points that chance does not explain."""
    if len(s) < 2:
        return []
    order = np.sort(s)
    steps = np.diff(order)
    # Of M random points the largest gap is about ln(M) / M; half as much again happens once in hundreds of clouds.
    expected = (np.log(len(s)) + 6.0) * max(float(np.median(steps)) / np.log(2.0), 1.0 / len(s))
    wide = np.flatnonzero(steps > max(expected, 2.0 * radius / line.length))
    return [
        _at(
            line,
            "gap",
            f"no points over {1e3 * steps[i] * line.length:.0f} mm of the length: the line is a guess there",
            "doubtful",
            float(0.5 * (order[i] + order[i + 1])),
        )
        for i in wide
    ]


def _closed(line: Skeleton, radius: float) -> list[Finding]:
    """A ring has no ends: they meet, and the line goes on from one into the other."""
    ends = line(np.array([0.0, 1.0]))
    tangents = line(np.array([0.0, 1.0]), 1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
    gap = float(np.linalg.norm(ends[1] - ends[0]))
    if gap < max(3.0 * radius, 0.02 * line.length) and tangents[0] @ tangents[1] > 0.5 and line.length > 10.0 * radius:
        return [_at(line, "closed-ring", "the ends meet: a closed ring has no first and last joint", "bad", 0.0)]
    return []


def _at(line: Skeleton, code: str, message: str, severity: str, s: float) -> Finding:
    x, y, z = (float(value) for value in line(s)[0])
    return Finding(code, message, severity, s, (x, y, z))
