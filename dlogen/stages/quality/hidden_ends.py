"""Ends beyond which the object may go on unseen: the length of the line is a lower bound then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import dots, unit
from dlogen.stages.quality.findings import END_NOT_SEEN
from dlogen.types import Array, BoolArray, Finding, IntArray, Skeleton
from dlogen.types.texts import millimetres

#: Points that are looked at.
_LOOKED_AT = 20_000

#: Mean offset of the points from the axis towards the viewer, in radii, from which on a cloud is one-sided. It is 0.64
#: where half of the circumference is seen, and 0.3 where three quarters are.
_ONE_SIDED = 0.4

#: Weight of the view being across the line, to that of its lying in the planes of tangents and offsets.
_ACROSS = 0.02

#: Cosine of the angle to the view from which on a strand runs along it; an end is so many radii long there, and its
#: density over the usual one is below the first number where hardly any of it shows, and below the other to be noted.
_ALONG, _END, _HARDLY, _SPARSE = 0.85, 4.0, 0.3, 0.45

#: Radii along the line from which on a place belongs to another strand; how much nearer that is to the viewer; and how
#: near, in the view, its axis comes to an end and to what would follow `_BEYOND` radii farther on.
_ELSEWHERE, _NEARER, _BESIDE, _BEYOND, _BEHIND = 8.0, 0.8, 2.2, 1.5, 1.3

#: Points in the outermost column or row of an image that cut off an end, how far they spread (in radii) and how far
#: from the end they may be; relative tolerance of the column; and cosines of the angle between the end and the normal
#: of the border from which on it leads out of the image, and beyond which a square end looks the same.
_CUT, _SPREAD, _NEAR, _SAME_COLUMN, _OUT, _SQUARE = 6, 1.2, 4.0, 1e-5, 0.4, 0.97

_BOUND = "it may go on there, and the length is a lower bound"


@dataclass(frozen=True)
class _End:
    """An end of a line: its name, s, place (3,), and outward direction (3,)."""

    name: str
    s: float
    tip: Array
    outward: Array


@dataclass(frozen=True)
class _Reason:
    """Why an end may not be that of the object, and whether a good deal may be missing."""

    text: str
    grave: bool = True


def ends_not_seen(
    points: Array, on_tube: BoolArray, line: Skeleton, radius: float, viewpoint: Array | None
) -> list[Finding]:
    """Findings about the ends of a one-sided cloud that may not be those of the object.

    An end may be where the surface turns away from the viewer, where the object goes on behind another strand of it, or
    where the image ends.

    Args:
        points: (M, 3) metres.
        on_tube: (M,) which of them are points of the object.
        line: the skeleton line.
        radius: of the object, metres.
        viewpoint: (3,) where they were seen from, metres, if that is known.
    """
    s = even_parameters(line, max(round(line.length / radius) + 1, 8))
    places, tangents = line(s), unit(line(s, 1))
    own = points[on_tube]
    own = own[spatial_sample(own, _LOOKED_AT)] if len(own) > _LOOKED_AT else own
    if len(own) < 100:
        return []
    nearest = cKDTree(places).query(own)[1]
    direction = _view(own - places[nearest], nearest, tangents, radius)
    if direction is None:
        return []
    counts = np.bincount(nearest, minlength=len(places))
    findings = []
    for name, at, sign in (("first", 0.0, -1.0), ("last", 1.0, 1.0)):
        end = _End(name, at, line(at), sign * unit(line(at, 1)))
        ray = direction if viewpoint is None else unit(end.tip - viewpoint)
        reason = (
            _at_border(points, end, radius, viewpoint)
            or _turned_away(end, ray, counts[::-1] if at else counts)
            or _behind(end, ray, places[::-1] if at else places, radius)
        )
        if reason is not None:
            message = f"the {name} end {reason.text}: {_BOUND}"
            findings.append(END_NOT_SEEN.at(line, at, message, "doubtful" if reason.grave else "note"))
    return findings


def _view(offset: Array, nearest: IntArray, tangents: Array, radius: float) -> Array | None:
    """The direction in which a far viewer looks, from where around the axis the points are; None if that is all around.

    The points of a stretch are, on average, on the side of the axis that faces the viewer: their mean offset is along
    the part of the direction that is across the tangent.

    Args:
        offset: (M, 3) from the axis to the points, metres.
        nearest: (M,) index of the place on the axis.
        tangents: (K, 3) there.
        radius: metres.
    """
    along = tangents[nearest]
    offset = offset - dots(offset, along)[:, None] * along
    count = np.bincount(nearest, minlength=len(tangents))
    sums = np.stack([np.bincount(nearest, column, len(tangents)) for column in offset.T], axis=1)
    seen = count >= 3
    mean, tangent = sums[seen] / count[seen, None], tangents[seen]
    # The view lies in the plane of tangent and offset of each stretch; where these planes are all the same one, it is
    # taken to be across the line.
    out_of_plane = np.cross(tangent, unit(mean))
    direction = np.linalg.eigh(out_of_plane.T @ out_of_plane + _ACROSS * tangent.T @ tangent)[1][:, 0]
    expected = direction - (tangent @ direction)[:, None] * tangent
    if dots(mean, expected).sum() > 0.0:
        direction, expected = -direction, -expected
    weight = np.linalg.norm(expected, axis=1)
    towards = -dots(mean, expected).sum() / max(float(weight.sum()), 1e-9)
    return direction if towards > _ONE_SIDED * radius else None


def _turned_away(end: _End, ray: Array, counts: IntArray) -> _Reason | None:
    """Whether an end runs along the view; `counts`: points at places a radius apart, from this end on."""
    if abs(float(end.outward @ ray)) < _ALONG:
        return None
    usual = float(np.median(counts[counts > 0]))
    density = float(counts[: round(_END)].mean()) / usual
    if density > _SPARSE:
        return None
    text = f"runs along the view, so that only {100.0 * density:.0f} % of the usual points show it"
    return _Reason(text, density < _HARDLY)


def _behind(end: _End, ray: Array, places: Array, radius: float) -> _Reason | None:
    """Whether what would follow beyond an end is behind another strand; `places`: (K, 3) from this end on."""
    others = places[round(_ELSEWHERE) :] - end.tip
    others = others[others @ ray < -_NEARER * radius]
    if not len(others):
        return None

    def beside(place: Array) -> Array:
        """Distances from a place to the others as they are seen."""
        away = others - place
        distances: Array = np.linalg.norm(away - (away @ ray)[:, None] * ray, axis=1)
        return distances

    near, beyond = beside(0.0 * ray), beside(_BEYOND * radius * end.outward)
    if near.min() > _BESIDE * radius or beyond.min() > _BEHIND * radius:
        return None
    nearer = -float(others[int(np.argmin(beyond))] @ ray)
    return _Reason(f"is behind another strand, {millimetres(nearer)} nearer to the viewer")


def _at_border(points: Array, end: _End, radius: float, viewpoint: Array | None) -> _Reason | None:
    """Whether an end is cut off by the outermost column or row of the image of a pinhole camera."""
    if viewpoint is None:
        return None
    seen, tip = points - viewpoint, end.tip - viewpoint
    for axis in range(3):
        depth = seen[:, axis]
        if not ((depth > 0.0).all() or (depth < 0.0).all()):
            continue
        ratios = np.delete(seen, axis, axis=1) / depth[:, None]
        # How the image moves along the end.
        leads = np.delete(end.outward, axis) / tip[axis] - np.delete(tip, axis) * end.outward[axis] / tip[axis] ** 2
        leads = unit(leads)
        for column in range(2):
            outwards = 1.0 if leads[column] > 0.0 else -1.0
            values = outwards * ratios[:, column]
            outermost = seen[values > values.max() - _SAME_COLUMN]
            apart = np.linalg.norm(outermost - tip, axis=1).max()
            spread = float(np.ptp(np.delete(outermost, axis, axis=1)[:, 1 - column]))
            out = abs(float(leads[column]))
            wide = len(outermost) >= _CUT and apart < _NEAR * radius and spread > _SPREAD * radius
            if wide and _OUT < out < _SQUARE:
                return _Reason("is cut off by the outermost pixels, as by the border of the image")
    return None
