"""Ends that are not square: where the view or a crop cut the object, it goes on."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.vectors import unit
from dlogen.stages.quality.findings import END_CUT_OFF
from dlogen.types import Array, BoolArray, Finding, Skeleton

#: Sectors of the circumference, and radii of length that are looked at.
_SECTORS, _REACH = 8, 4.0

#: Points that a sector needs on average: with fewer, the gaps behind the last points make tilts by chance.
_FEWEST = 15

#: Tilt of a cut against the cross-section (tangent of the angle) that is reported, and how many standard deviations of
#: the tilt it has to be (many: the gap behind the last of random points is exponential, with a long tail).
_TILT, _SURE = 0.6, 10.0

#: Points within so many radii of the outermost ones show how much of the edge is square. A plane cut has so few of them
#: that they span an angle that its tilt tells; a square end of which a part was not seen has more by so many degrees.
_BAND, _MORE = 0.2, 30.0

#: Points that are due in the band of a square end, that have to be there, and the widest gap between neighbours of
#: them, in degrees.
_BAND_DUE, _BAND_FEWEST, _BAND_GAP = 16, 6, 40.0


def cut_ends(
    points: Array,
    s: Array,
    on_tube: BoolArray,
    line: Skeleton,
    radius: float,
    closed: tuple[bool, bool] = (False, False),
) -> list[Finding]:
    """Findings about ends whose edge runs obliquely around the tube.

    The edge of a square end is at the same s all around. For each sector of the circumference the last point is taken,
    and a plane is fitted to the edge that they make.

    Args:
        points: (M, 3) metres.
        s: (M,) their coordinates on the line.
        on_tube: (M,) which are points of the tube.
        line: the skeleton line.
        radius: of the object, metres.
        closed: which ends were seen to be closed by a face: the object ends there, however oblique that is.
    """
    findings = []
    for end, name, seen in ((0.0, "first", closed[0]), (1.0, "last", closed[1])):
        if seen:
            continue
        # Feet are clipped to the line; beyond its end the distance along its tangent counts.
        tip, tangent = line(end), line(end, 1)
        tangent = unit(tangent) * (1.0 if end == 1.0 else -1.0)
        near = on_tube & (np.abs(s - end) * line.length < _REACH * radius)
        if np.count_nonzero(near) < _FEWEST * _SECTORS:
            continue
        frame = minimal_rotation_frames(tangent[None])[0]
        clipped = np.abs(s[near] - end) * line.length
        offset = points[near] - line(s[near])
        along = np.where(clipped > 0.0, -clipped, (points[near] - tip) @ tangent)
        tilt, std = _tilt(along, offset @ frame[:, 1], offset @ frame[:, 2], radius)
        if tilt > _TILT and tilt > _SURE * std:
            angle = np.degrees(np.arctan(tilt))
            if _is_square_in_part(along, offset @ frame[:, 1], offset @ frame[:, 2], radius, tilt):
                message = f"around the {name} end, one side was seen less far than the other: it ends squarely there"
                findings.append(END_CUT_OFF.at(line, end, message, "note"))
                continue
            message = (
                f"the {name} end is cut off at {angle:.0f} degrees to the cross-section: the object may go on there"
            )
            findings.append(END_CUT_OFF.at(line, end, message, "doubtful"))
    return findings


def _is_square_in_part(along: Array, y: Array, z: Array, radius: float, tilt: float) -> bool:
    """Whether the outermost points of an end are those of a square edge, of which a part was not seen.

    Where a plane cuts a tube obliquely, only the points around one generatrix are near the outermost one: those within
    b of it span the angle 2 arccos(1 - b / (r tan tilt)). A pass of a scanner that ended earlier leaves a part of a
    square edge.

    Args:
        along, y, z, radius: as in `_tilt`.
        tilt: tangent of the angle of the edge's plane against the cross-section.
    """
    noise = 1.4826 * float(np.median(np.abs(np.hypot(y, z) - np.median(np.hypot(y, z)))))
    spacing = float(np.ptp(along)) / len(along)
    band = max(_BAND * radius, _BAND_DUE * spacing) + 2.0 * noise
    outer = along > np.sort(along)[-2] - band
    if np.count_nonzero(outer) < _BAND_FEWEST:
        return False
    angle = np.sort(np.degrees(np.arctan2(z[outer], y[outer])))
    gaps = np.append(np.diff(angle), angle[0] + 360.0 - angle[-1])
    wide = np.flatnonzero(gaps > _BAND_GAP)
    if len(wide) == 0:
        return True
    # The longest run of angles without a wide gap: from the end of one to the start of the next.
    starts = angle[(wide + 1) % len(angle)]
    ends = np.roll(angle[wide], -1)
    span = float(np.max((ends - starts) % 360.0))
    expected = 2.0 * float(np.degrees(np.arccos(max(1.0 - band / (radius * tilt), -1.0))))
    return span > expected + _MORE


def _tilt(along: Array, y: Array, z: Array, radius: float) -> tuple[float, float]:
    """Slope of the edge of an end across the tube, and its standard deviation.

    Args:
        along: (K,) places along the axis, growing towards the end, metres.
        y, z: (K,) places across it, metres.
        radius: metres.
    """
    sector = np.floor((np.arctan2(z, y) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
    rows, edges, spacings = [], [], []
    for k in range(_SECTORS):
        inside = np.flatnonzero(sector == k)
        if len(inside) < 4:
            continue
        last = inside[np.argmax(along[inside])]
        spacing = (along[last] - along[inside].min()) / len(inside)
        rows.append([1.0, y[last], z[last]])
        # The last of random points is a spacing short of the edge.
        edges.append(along[last] + spacing)
        spacings.append(max(spacing, 1e-3 * radius))
    if len(rows) < 4:
        return 0.0, np.inf
    weight = 1.0 / np.array(spacings)
    system = np.array(rows) * weight[:, None]
    solution = np.linalg.lstsq(system, np.array(edges) * weight, rcond=None)[0]
    covariance = np.linalg.pinv(system.T @ system)
    tilt = float(np.linalg.norm(solution[1:]))
    direction = solution[1:] / max(tilt, 1e-12)
    return tilt, float(np.sqrt(max(float(direction @ covariance[1:, 1:] @ direction), 0.0)))
