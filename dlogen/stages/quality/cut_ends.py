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


def cut_ends(points: Array, s: Array, on_tube: BoolArray, line: Skeleton, radius: float) -> list[Finding]:
    """Findings about ends whose edge runs obliquely around the tube.

    The edge of a square end is at the same s all around. For each sector of the circumference the last point is taken,
    and a plane is fitted to the edge that they make.

    Args:
        points: (M, 3) metres.
        s: (M,) their coordinates on the line.
        on_tube: (M,) which are points of the tube.
        line: the skeleton line.
        radius: of the object, metres.
    """
    findings = []
    for end, name in ((0.0, "first"), (1.0, "last")):
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
            message = (
                f"the {name} end is cut off at {angle:.0f} degrees to the cross-section: the object may go on there"
            )
            findings.append(END_CUT_OFF.at(line, end, message))
    return findings


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
