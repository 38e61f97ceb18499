"""Whether the cross-section is that of one round object."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import unit
from dlogen.stages.quality.findings import SIDE_BY_SIDE
from dlogen.types import Array, Finding, IntArray, Skeleton

#: Points, stretches of the line and sectors around it that show the shape of the cross-section; the points that a
#: sector needs, and the sectors that a stretch needs; frames along the line.
_SHAPED, _PROFILES, _SECTORS, _PER_SECTOR, _FEWEST_SECTORS, _FRAMES = 10_000, 8, 16, 10, 6, 400


#: A stretch is not round if its shape is more than this, in radii and in standard deviations of the noise; and the
#: object if so many of its stretches are not.
_ODD, _ODD_NOISE, _ODD_SHARE = 0.1, 0.4, 0.75


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
    frames = minimal_rotation_frames(unit(line((np.arange(_FRAMES) + 0.5) / _FRAMES, 1)))
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
    return [SIDE_BY_SIDE.found(message)]


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
