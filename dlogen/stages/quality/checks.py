"""What a user should know before trusting a chain: refusals before the fit and findings after it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from dlogen.config.schema import Config
from dlogen.errors import FitError
from dlogen.geometry.curvature import curvature
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.quality.findings import (
    BEND_TIGHTER_THAN_RADIUS,
    DEVIATION_ABOVE_E_MAX,
    GAP,
    POINTS_NOT_REACHED,
    POINTS_OFF_THE_TUBE,
    RADIUS_MISMATCH,
    RADIUS_UNKNOWN,
    RADIUS_VARIES,
    SETTINGS_NOT_USED,
    UNITS,
)
from dlogen.stages.scale import Scale
from dlogen.types import Array, BoolArray, Finding, Segmentation, Skeleton
from dlogen.types.texts import millimetres

#: Nobody scans cables of this many metres in one cloud.
_LONGEST = 50.0
#: Nor any as short as this, metres.
_SHORTEST = 0.01


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
#: Points that are looked at to see whether the line follows all of the object.
_LOOKED_AT = 4000


def check_line(
    line: Skeleton,
    radius: float,
    distance: Array,
    on_tube: BoolArray,
    max_curvature: tuple[float, float],
    *,
    surface: bool = True,
) -> list[Finding]:
    """Findings about a skeleton line and the cloud around it, whatever profile made it.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        distance: (M,) distance of every point to the line, metres.
        on_tube: (M,) whether it counts as a point of the tube's surface.
        max_curvature: kappa (1/m) and the s where it is.
        surface: whether the points show the surface, so that their distances tell something.
    """
    findings = []
    kappa, s_kappa = max_curvature
    if kappa * radius > 1.0:
        text = (
            f"the line bends with a radius of {1e3 / kappa:.3g} mm, tighter than the object's own {millimetres(radius)}"
        )
        findings.append(BEND_TIGHTER_THAN_RADIUS.at(line, s_kappa, text))
    if surface:
        findings += _check_distances(radius, distance, on_tube)
    if line.length > _LONGEST:
        findings.append(
            UNITS.found(f"the object is {line.length:.0f} m long: set units (mm, cm) if it is not", "doubtful")
        )
    if line.length < _SHORTEST:
        findings.append(UNITS.found(f"the object is only {1e3 * line.length:.2g} mm long: check units", "doubtful"))
    return findings


def _check_distances(radius: float, distance: Array, on_tube: BoolArray) -> list[Finding]:
    """Whether the points are where the surface of a tube of this radius is."""
    findings = []
    # Strays are far from the line; points near it but not on the surface say that there is no tube of this radius.
    near = distance < 2.5 * radius
    off = float(np.mean(~on_tube[near])) if near.any() else 1.0
    if off > 0.1:
        findings.append(
            POINTS_OFF_THE_TUBE.found(
                f"{100 * off:.0f} % of the points around the line are not on a tube of radius {millimetres(radius)}: "
                "the cloud is something else, or the fit failed",
                "bad" if off > 0.3 else "doubtful",
            )
        )
    median = float(np.median(distance[near])) if near.any() else 0.0
    if abs(median - radius) > 0.2 * radius:
        findings.append(
            RADIUS_MISMATCH.found(
                f"the points are {millimetres(median)} from the line (median), but the radius is {millimetres(radius)}"
            )
        )
    return findings


def check_radius(radius: float | None, free: Scale) -> list[Finding]:
    """Whether the cross-sections contradict a given radius, or tell one if none was given.

    Args:
        radius: the given one, metres.
        free: the scale of the cloud, estimated without it.
    """
    if radius is None:
        message = f"the cross-sections do not agree on a radius; {millimetres(free.radius)} is a guess: give r"
        return [] if free.radius_reliable else [RADIUS_UNKNOWN.found(message)]
    # The estimate is as uncertain as the noise is large.
    if not free.radius_reliable or abs(free.radius - radius) <= max(_CONTRADICTED * radius, free.noise):
        return []
    message = f"r = {millimetres(radius)} was given, but the cross-sections have a radius of {millimetres(free.radius)}"
    return [RADIUS_MISMATCH.found(message)]


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
        f"the radius is not the same everywhere: {millimetres(medians[worst])} here, {millimetres(radius)} in the model"
    )
    return [RADIUS_VARIES.at(line, (worst + 0.5) / _STRETCHES, text, "doubtful")]


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
    return [GAP.at(line, (worst + 1.0) / pieces, text, "doubtful")]


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
    return [POINTS_NOT_REACHED.found(message, "bad" if share > 0.15 else "doubtful")]


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
    return [DEVIATION_ABOVE_E_MAX.at(line, segmentation.deviation_s, message)]


def check_settings_used(config: Config, unused: Sequence[str]) -> list[Finding]:
    """Whether a user set what the profile did not use.

    Args:
        config: as the user gave it.
        unused: dotted keys that the profile does not use.
    """
    set_by_user = [key for key in unused if config.value(key) != Config().value(key)]
    if not set_by_user:
        return []
    message = f"settings of profile paper only, which this fit did not use: {', '.join(set_by_user)}"
    return [SETTINGS_NOT_USED.found(message)]


def explained(error: FitError, findings: Iterable[Finding]) -> FitError:
    """What was wrong before, if anything was: a line through what is no line fails later, in ways that say little."""
    bad = next((finding for finding in findings if finding.is_bad), None)
    if bad is None:
        return error
    return FitError(
        f"no chain can be made of this cloud: {bad.message}",
        "leave only the object in it: no table, background or fixtures (dlogen extract cuts an object out of a scene); "
        "check r and units",
        stage="ordering",
    )
