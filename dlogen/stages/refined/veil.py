"""Veils: flying pixels that a depth camera puts between the edges of an object and what is behind it.

They hang from the object as thin curtains of points, far sparser than its surface. The order of a cloud takes them for
branches and for other objects, so they are left out before it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.geometry.eigen3 import eigenvalues
from dlogen.geometry.polyline import arc_lengths
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.quality.findings import STRAY_POINTS
from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.ordering import Ordering, order
from dlogen.stages.scale import estimate_scale
from dlogen.types import Array, BoolArray, Cloud, Finding

#: Points that are looked at, neighbours that tell how densely they lie, and the share of the usual density below which
#: they may be a veil.
_SAMPLE, _NEIGHBOURS, _SPARSE = 8000, 8, 0.25

#: Sparse points around one of them, within so many radii, are a curtain if they are spread so many radii across their
#: direction; those of a strand are spread 0.7. So many of them are needed.
_AROUND, _SPREAD, _COMPANY = 5.0, 1.1, 8

#: A share of the points that is worth a second look, and beyond which leaving them out is doubtful.
_WORTH, _MUCH = 0.02, 0.25

#: An order that had nothing bad may not become shorter or longer by more than this, relative to its length.
_SAME = 0.05


def veil(points: Array, radius: float) -> BoolArray:
    """(M,) which points belong to sparse curtains.

    Args:
        points: (M, 3) metres.
        radius: of the object, metres.
    """
    index = np.arange(len(points)) if len(points) <= _SAMPLE else spatial_sample(points, _SAMPLE)
    chosen = points[index]
    tree = cKDTree(chosen)
    distance = tree.query(chosen, min(_NEIGHBOURS + 1, len(chosen)))[0][:, -1]
    # On a surface the density goes with the inverse square of the distance.
    sparse = np.flatnonzero(distance > float(np.median(distance)) / np.sqrt(_SPARSE))
    curtain = np.zeros(len(chosen), dtype=bool)
    if len(sparse) > _COMPANY:
        curtain[sparse[_is_spread(chosen[sparse], radius)]] = True
    if len(chosen) == len(points):
        return curtain
    belongs: BoolArray = curtain[tree.query(points)[1]]
    return belongs


def _is_spread(points: Array, radius: float) -> BoolArray:
    """(K,) whether the points around each of them are spread as wide as no strand is."""
    pairs = cKDTree(points).query_pairs(_AROUND * radius, output_type="ndarray")
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    count = np.bincount(first, minlength=len(points)) + 1.0
    x = points - points.mean(axis=0)
    mean = np.stack([np.bincount(first, x[second, c], len(x)) + x[:, c] for c in range(3)]) / count
    rows, columns = [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]
    products = np.stack([x[:, i] * x[:, j] for i, j in zip(rows, columns, strict=True)])
    second_moments = np.stack([np.bincount(first, p[second], len(x)) + p for p in products]) / count
    covariance = second_moments - mean[rows] * mean[columns]
    middle = np.sqrt(np.maximum(eigenvalues(covariance)[1], 0.0))
    spread: BoolArray = (middle > _SPREAD * radius) & (count > _COMPANY)
    return spread


def without_veil(
    cloud: Cloud, known: float | None, ordering: Ordering, bridging: Bridging | None = None
) -> tuple[Cloud, Ordering]:
    """The cloud and its order without a veil, if it has one that matters; otherwise as they are.

    Args:
        cloud: near the origin, metres.
        known: the radius, if one was given, metres.
        ordering: of the whole cloud.
        bridging: which gaps belong to the object, as far as its user says so.
    """
    bad = sum(item.is_bad for item in ordering.findings)
    if not bad and not any(STRAY_POINTS.matches(item) for item in ordering.findings):
        return cloud, ordering
    out = veil(cloud.points, ordering.radius)
    share = float(out.mean())
    if not _WORTH < share < 0.5:
        return cloud, ordering
    rest = cloud.points[~out]
    try:
        again = order(rest, known, estimate_scale(rest, radius=known), cloud.viewpoint, bridging)
    except FitError:
        return cloud, ordering
    still = sum(item.is_bad for item in again.findings)
    ratio = float(arc_lengths(again.backbone)[-1] / arc_lengths(ordering.backbone)[-1])
    if still > bad or (still == bad and abs(ratio - 1.0) > _SAME):
        return cloud, ordering
    findings = [item for item in again.findings if not STRAY_POINTS.matches(item)]
    normals = None if cloud.normals is None else cloud.normals[~out]
    kept = replace(cloud, points=rest, normals=normals)
    return kept, replace(again, findings=(*findings, _left_out(share)))


def _left_out(share: float) -> Finding:
    message = f"{share:.1%} of the points lie thinly beside the object, as flying pixels do, and were left out"
    return STRAY_POINTS.found(message, "note" if share < _MUCH else "doubtful")
