"""Groups of points that the line leaves out: a tip beyond an end, or something that is no part of the object."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import as_place
from dlogen.stages.quality.findings import LEFT_OVER
from dlogen.types import Array, Finding, Skeleton
from dlogen.types.texts import millimetres

#: Points that are looked at, and places of the line.
_LOOKED_AT, _PLACES = 20_000, 2000

#: Points so many radii from the line are left out, and belong together up to so many from one another.
_AWAY, _TOGETHER = 3.0, 1.5

#: A group is something if it is so many radii long, and its points are this share of as dense as those of the line.
_LONG, _DENSE = 4.0, 0.3

#: A strand that is seen along its length shows fewer points, but no wider apart than so many times those of the line;
#: its spread across its length is below so many radii, and it has such a share of all points at least.
_SPACED, _THIN, _SHARE = 2.0, 1.0, 0.005

#: A short piece of it is something if it is so many radii long, so many times as long as wide, has so many points and
#: such a share of all, no wider apart than that: flying pixels and specks are fewer.
_SHORT, _SLENDER, _SHORT_POINTS, _SHORT_SHARE, _SHORT_SPACED = 2.0, 1.5, 25, 0.015, 1.3


#: Fewest points that can lie along a line.
_FEWEST = 4


def check_left_over(points: Array, line: Skeleton, radius: float, scatter: float = 0.0) -> list[Finding]:
    """The largest group of points that the line leaves out, if there is one.

    Strays lie alone. What lies together, as dense as the points of the object, is part of it or of something else.

    Args:
        points: (M, 3) metres.
        line: the skeleton line.
        radius: of the object, metres.
        scatter: standard deviation of the points, metres.
    """
    some = points[spatial_sample(points, _LOOKED_AT)]
    distance = cKDTree(line(even_parameters(line, _PLACES))).query(some)[0]
    reach = _AWAY * radius + 4.0 * scatter
    away = some[distance > reach]
    if len(away) < 10:
        return []
    per_radius = (len(some) - len(away)) * radius / line.length
    pairs = cKDTree(away).query_pairs(_TOGETHER * radius, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(away), len(away)))
    groups = connected_components(links, directed=False)[1]
    largest = int(np.argmax(np.bincount(groups)))
    group = away[groups == largest]
    extent = float(np.linalg.norm(np.ptp(group, axis=0)))
    dense = extent >= _LONG * radius and len(group) >= max(10.0, _DENSE * per_radius * extent / radius)
    if not dense and not _is_strand(group, extent, some[distance <= reach], radius):
        return []
    share = 100.0 * len(group) / len(some)
    message = f"{share:.2g} % of the points lie together {millimetres(extent)} wide, and the line does not reach them"
    return [LEFT_OVER.found(message, position=as_place(group.mean(axis=0)))]


def _is_strand(group: Array, extent: float, line: Array, radius: float) -> bool:
    """Whether points (K, 3) lie along a line `extent` long, about as close together as those of the object (M, 3)."""
    if len(group) < _FEWEST:
        return False
    length, spread = np.linalg.svd(group - group.mean(axis=0), compute_uv=False)[:2] / np.sqrt(len(group))
    if spread > _THIN * radius or len(line) < 4:
        return False
    among, usual = (float(np.median(cKDTree(points).query(points, 4)[0][:, -1])) for points in (group, line))
    if extent >= _LONG * radius:
        return among < _SPACED * usual and len(group) >= _SHARE * (len(group) + len(line))
    slender = extent >= _SHORT * radius and length > _SLENDER * spread
    enough = len(group) >= max(_SHORT_POINTS, _SHORT_SHARE * (len(group) + len(line)))
    return bool(slender) and enough and among < _SHORT_SPACED * usual
