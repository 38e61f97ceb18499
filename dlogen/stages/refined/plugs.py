"""Thick ends: plugs, boots and tape, which are rounder and thicker than the object that they end.

The model has one radius. A line that is looked for with it ends in front of a plug or wanders on its surface. So the
stretch that certainly is the object is followed straight into the plug; if the points around are those of a thicker
tube, they are moved to the radius of the object, about that axis, and the fit is made again. They keep the length and
say nothing of the radius.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.vectors import unit
from dlogen.stages.quality.findings import BRANCH, CROSSING, GAP, RADIUS_VARIES, SEVERAL_OBJECTS, STRAY_POINTS
from dlogen.stages.refined.ordering import Ordering
from dlogen.stages.refined.refine import Refined, refine
from dlogen.types import Array, Finding, IntArray
from dlogen.types.texts import millimetres

#: Stretches of a radius that are looked at from either end, at most this share of the length; and how many in a row
#: have to be as usual for the object to be certain.
_STRETCHES, _MOST, _IN_A_ROW = 24, 0.25, 4

#: A stretch is as usual if so large a share of the points around is on the tube and a circle through them has its
#: radius, to so much; points that a circle needs.
_ON, _ALIKE, _CIRCLE = 0.75, 0.12, 15

#: A plug is so many times as thick as the object, is followed in steps of so many radii or due points, and has so large
#: a share of its points so close to its radius, relative.
_THICKER, _THICKEST, _STEP, _PER_STEP, _ROUND, _CLOSE = 1.2, 3.6, 0.5, 12.0, 0.55, 0.15

#: Least length of a plug in radii, and points that it needs.
_SHORTEST, _FEWEST = 0.7, 30

#: A plug is looked for so many radii ahead; the quantile of the distances to its axis that is about its radius, where
#: some are those of its faces.
_LONGEST, _OUTER = 30.0, 0.7

#: With so large a share of the points on the tube, no strays are worth a word.
_NO_STRAYS = 0.98


@dataclass(frozen=True)
class Plug:
    """A thick end.

    Attributes:
        place: (3,) on the axis, where the object is certain, metres.
        direction: (3,) from there to the end.
        start, end: distances from `place` between which it is thicker, metres.
        radius: of it, metres.
        cut: coordinate of `place` on the line that it was found with.
    """

    place: Array
    direction: Array
    start: float
    end: float
    radius: float
    cut: float

    def contains(self, position: Array, margin: float) -> bool:
        """Whether a place is in it or so many metres from it."""
        along = float((position - self.place) @ self.direction)
        away = float(np.linalg.norm(position - self.place - along * self.direction))
        return -margin < along < self.end + margin and away < self.radius + margin


def find_plug(points: Array, fitted: Refined, last: bool) -> Plug | None:
    """The thick end of an object, if it has one.

    Args:
        points: (M, 3) metres.
        fitted: the tube that was fitted to them.
        last: whether the end at s = 1 is looked at.
    """
    line, radius = fitted.skeleton, fitted.radius
    # Where points are few, stretches are longer than a radius.
    length = max(radius, _CIRCLE * line.length / max(0.7 * float(np.count_nonzero(fitted.inliers)), 1.0))
    stretches = min(_STRETCHES, int(_MOST * line.length / length))
    if stretches < 2 * _IN_A_ROW:
        return None
    step = length / line.length
    s = 1.0 - fitted.s if last else fitted.s
    near = np.flatnonzero((s < stretches * step) & (np.abs(fitted.residuals) < _THICKEST * radius))
    order = near[np.argsort(s[near], kind="stable")]
    edges = np.searchsorted(s[order], step * np.arange(stretches + 1))
    usual: list[int] = []
    for k in range(stretches):
        inside = order[edges[k] : edges[k + 1]]
        if len(inside) < _CIRCLE:
            continue
        middle = (k + 0.5) * step
        if _is_usual(points[inside], fitted, 1.0 - middle if last else middle, inside):
            usual.append(k)
        else:
            usual.clear()
        if len(usual) == _IN_A_ROW:
            break
    if len(usual) < _IN_A_ROW:
        return None
    at = usual[0]
    # A stretch may be half usual.
    cut = (at + (1.0 if at else 0.25)) * step
    cut = 1.0 - cut if last else cut
    place, direction = line(cut), unit(line(cut, 1)) * (1.0 if last else -1.0)
    return _followed(points, fitted, place, direction, cut)


def _is_usual(points: Array, fitted: Refined, s: float, inside: IntArray) -> bool:
    """Whether a stretch of the line around s has points of the object only: of them, the indices are given as well."""
    on = np.abs(fitted.residuals[inside]) < max(4.0 * fitted.noise, 0.1 * fitted.radius)
    if float(np.mean(on)) < _ON:
        return False
    frame = minimal_rotation_frames(unit(fitted.skeleton(s, 1))[None])[0]
    flat = (points - fitted.skeleton(s)) @ frame[:, 1:]
    found, std = _circle(flat, fitted.radius)
    return abs(found - fitted.radius) < max(_ALIKE * fitted.radius, 4.0 * std)


def _circle(flat: Array, radius: float) -> tuple[float, float]:
    """Radius of the circle through points (K, 2), started around the origin, and its standard deviation."""
    centre = np.zeros(2)
    guess, std = radius, np.inf
    for _ in range(8):
        offset = flat - centre
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9 * radius)
        residual = distance - guess
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-3 * radius)
        weight = np.maximum(1.0 - (residual / (6.0 * scale)) ** 2, 0.0) ** 2
        rows = np.column_stack([offset / distance[:, None], np.ones(len(flat))])
        normal = (rows * weight[:, None]).T @ rows + 1e-6 * np.eye(3)
        step = np.linalg.solve(normal, (rows * weight[:, None]).T @ residual)
        centre, guess = centre + step[:2], guess + float(step[2])
        std = scale * float(np.sqrt(np.linalg.inv(normal)[2, 2]))
        if not 0.1 * radius < guess < 10.0 * radius:
            return guess, np.inf
    return guess, std


def _followed(points: Array, fitted: Refined, place: Array, direction: Array, cut: float) -> Plug | None:
    """The plug that a straight axis from a place goes through, if there is one."""
    radius, line = fitted.radius, fitted.skeleton
    close = points[np.linalg.norm(points - place, axis=1) < min(_MOST * line.length, _LONGEST * radius)]
    place, direction = _aligned(close, place, direction, radius)
    offset = points - place
    along = offset @ direction
    ahead = np.flatnonzero((along > 0.0) & (along < _MOST * line.length))
    away = np.linalg.norm(offset[ahead] - along[ahead, None] * direction, axis=1)
    # Another part of the object may pass by.
    elsewhere = (np.abs(fitted.s[ahead] - cut) * line.length > along[ahead] + 8.0 * radius) & fitted.inliers[ahead]
    near = (away < _THICKEST * radius) & ~elsewhere
    along, away = along[ahead][near], away[near]
    density = np.count_nonzero(fitted.inliers) / line.length
    step = max(_STEP * radius, _PER_STEP / max(density, 1e-9))
    usual = density * step
    bins = np.bincount((along / step).astype(np.intp), minlength=1)
    empty = np.flatnonzero(bins < max(3.0, 0.2 * usual))
    count = int(empty[0]) if len(empty) else len(bins)
    kept = along < count * step
    along, away = along[kept], away[kept]
    order = np.argsort(along, kind="stable")
    along, away = along[order], away[order]
    edges = np.searchsorted(along, step * np.arange(count + 1))
    medians = np.array([float(np.median(away[a:b])) for a, b in pairwise(edges)])
    thick = np.flatnonzero(medians > _THICKER * radius)
    if not len(thick):
        return None
    first = int(thick[0])
    # Without the faces, which are in the first and the last of these stretches.
    inner = slice(int(edges[min(first + 1, count - 1)]), int(edges[max(count - 1, min(first + 2, count))]))
    body = away[inner] if count - first > 3 else away[edges[first] :]
    body = body[body > 1.1 * radius]
    length = float(along[-1]) - first * step
    if len(body) < _FEWEST or length < _SHORTEST * radius or len(thick) < 0.7 * (count - first):
        return None
    found = float(np.median(body))
    if float(np.mean(np.abs(body - found) < _CLOSE * found)) < _ROUND:
        return None
    return Plug(place, direction, first * step, float(along[-1]), found, cut)


def _aligned(points: Array, place: Array, direction: Array, radius: float) -> tuple[Array, Array]:
    """The axis of what lies ahead of a place: through it as far as the points of the object tell, and turned a little.

    Farther and farther ahead, the distances of the points to the axis are made alike by least squares. A direction
    taken from the object alone would miss the end of a long plug.

    Args:
        points: (M, 3) metres.
        place, direction: where to start, and a unit vector.
        radius: of the object, metres.

    Returns:
        Both, corrected.
    """
    for reach in (3.0, 4.5, 7.0, 10.0, 15.0, _LONGEST):
        for _ in range(3):
            frame = minimal_rotation_frames(direction[None])[0]
            along, y, z = ((points - place) @ frame).T
            away = np.hypot(y, z)
            ahead = (along > 0.0) & (along < reach * radius) & (away < _THICKEST * radius)
            thick = ahead & (away > 1.1 * radius)
            if np.count_nonzero(thick) < _FEWEST:
                break
            scale = reach * radius
            ratio, normal = along[thick] / scale, np.stack([y, z], axis=1)[thick] / away[thick, None]
            ones = np.ones((len(ratio), 1))
            # The place is known from the object, the direction less so.
            rows = np.concatenate([normal, normal * ratio[:, None], ones], axis=1)
            residual = away[thick]
            # Its faces lie within it: most of what is far out is its surface.
            middle = float(np.quantile(residual, _OUTER))
            spread = float(np.clip(1.4826 * np.median(np.abs(residual - middle)), 0.02 * radius, 0.08 * middle))
            weight = np.maximum(1.0 - ((residual - middle) / (4.0 * spread)) ** 2, 0.0) ** 2
            hold = np.diag([*([2.0 * len(ratio)] * 2), *([0.01 * len(ratio)] * 2), 1e-9])
            matrix = (rows * weight[:, None]).T @ rows + hold
            step = np.linalg.solve(matrix, (rows * weight[:, None]).T @ (residual - middle))
            place = place + frame[:, 1:] @ step[:2]
            direction = unit(direction + frame[:, 1:] @ step[2:4] / scale)
    return place, direction


def contracted(points: Array, plug: Plug, radius: float) -> Array:
    """The points (M, 3) with those of a plug moved towards its axis, as if it was as thick as the object."""
    offset = points - plug.place
    along = offset @ plug.direction
    across = offset - along[:, None] * plug.direction
    away = np.linalg.norm(across, axis=1)
    inside = (along > plug.start) & (along < plug.end + radius) & (away < 1.5 * plug.radius)
    # The step in front of it: what is as thin as the object stays.
    middle = 0.5 * (radius + plug.radius)
    inside &= (away > middle) | (along > plug.start + radius)
    result: Array = points.copy()
    result[inside] -= across[inside] * (1.0 - radius / plug.radius)
    return result


def with_plugs(
    points: Array, ordering: Ordering, fitted: Refined, fixed_radius: bool
) -> tuple[Array, Ordering, Refined] | None:
    """The fit again with thick ends, if the object has any.

    Args:
        points: (M, 3) metres.
        ordering: of them.
        fitted: the fit that started from it.
        fixed_radius: whether the radius was given.

    Returns:
        The points as if the ends were as thick as the object, the ordering without what it found in the plugs, and the
        fit with findings about them; None if there are none.
    """
    line, radius = fitted.skeleton, fitted.radius
    first, last = find_plug(points, fitted, False), find_plug(points, fitted, True)
    plugs = [plug for plug in (first, last) if plug is not None]
    if not plugs:
        return None
    moved = points
    for plug in plugs:
        moved = contracted(moved, plug, radius)
    low, high = first.cut if first else 0.0, last.cut if last else 1.0
    backbone = line(np.linspace(low, high, max(8, round((high - low) * line.length / radius))))
    if first is not None:
        backbone = np.concatenate([_axis(first, radius)[::-1], backbone])
    if last is not None:
        backbone = np.concatenate([backbone, _axis(last, radius)])
    try:
        again = refine(moved, backbone, radius, fixed_radius=fixed_radius)
    except FitError:
        return None
    if np.mean(again.inliers) < np.mean(fitted.inliers) or again.noise > 2.0 * fitted.noise + 0.02 * radius:
        return None
    kept = tuple(item for item in ordering.findings if not _is_about(item, plugs, radius, again))
    notes = tuple(_note(plug, again) for plug in plugs)
    return moved, replace(ordering, backbone=backbone, findings=kept), replace(again, findings=again.findings + notes)


def _axis(plug: Plug, radius: float) -> Array:
    """Places of the axis of a plug about a radius apart, up to half a radius from its end: (K, 3)."""
    away = np.linspace(0.0, max(plug.end - 0.5 * radius, radius), max(3, round(plug.end / radius)))[1:]
    places: Array = plug.place + away[:, None] * plug.direction
    return places


def _is_about(item: Finding, plugs: list[Plug], radius: float, again: Refined) -> bool:
    """Whether what the ordering found is only a plug."""
    if STRAY_POINTS.matches(item):
        return float(np.mean(again.inliers)) > _NO_STRAYS
    if item.position is None or not any(kind.matches(item) for kind in (BRANCH, CROSSING, GAP, SEVERAL_OBJECTS)):
        return False
    return any(plug.contains(np.array(item.position), 2.5 * radius) for plug in plugs)


def _note(plug: Plug, fitted: Refined) -> Finding:
    middle = plug.place + 0.5 * (plug.start + plug.end) * plug.direction
    ends = fitted.skeleton(np.array([0.0, 1.0]))
    at_last = bool(np.linalg.norm(middle - ends[1]) < np.linalg.norm(middle - ends[0]))
    share = 0.5 * (plug.end - plug.start) / fitted.skeleton.length
    name, length = "last" if at_last else "first", millimetres(plug.end - plug.start)
    text = (
        f"the {name} end is thicker for {length}, with a radius of {millimetres(plug.radius)}: left "
        "out of the radius, kept in the length"
    )
    return RADIUS_VARIES.at(fitted.skeleton, 1.0 - share if at_last else share, text, "note")
