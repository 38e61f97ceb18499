"""The order of a thread: points along a line, too few for its width and scattered by as much as they are apart.

A wire in a laser scan from the air is a string of points that are centimetres apart, with a noise of the same size. No
neighbourhood shows a cross-section, and the radius that the scatter suggests is shorter than the steps from point to
point. So such a cloud is followed in steps that hold a few points each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dlogen.errors import FitError
from dlogen.geometry.eigen3 import eigenvalues
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.quality.findings import TOO_FEW_POINTS
from dlogen.stages.refined.bridging import Bridging
from dlogen.stages.refined.ordering import Ordering, follow, order
from dlogen.stages.scale import Scale
from dlogen.types import Array

#: Points that are looked at, and the sizes of their neighbourhoods.
_LOOKED_AT, _SIZES = 400, (6, 9, 14, 20, 32, 48, 72)

#: A neighbourhood is a stretch of a line if its variance along it is so many times that across.
_ELONGATION = 12.0

#: The step in which a thread is followed: points in each, and widths of the scatter.
_POINTS, _WIDTHS = (3.0, 6.0), 4.0

#: Points for each radius of length from which on a cloud is no thread.
_DENSE = 2.0

#: Points that scatter by less than this, in distances from point to point, are on the axis.
_EXACT = 0.03

#: Half the width of the scatter, in standard deviations, and at least, in distances from point to point.
_HALF, _LEAST = 2.0, 0.1


@dataclass(frozen=True)
class Thread:
    """How a thread is sampled.

    Attributes:
        per_metre: points for each metre of length.
        scatter: standard deviation of the points across the line, in each direction, metres.
    """

    per_metre: float
    scatter: float

    @property
    def half_width(self) -> float:
        """Half the width of the strip that the points cover, metres."""
        return max(_HALF * self.scatter, _LEAST / self.per_metre)


def thread_of(points: Array) -> Thread | None:
    """How points lie along a line; None where neighbourhoods of no size are longer than wide: (M, 3) metres."""
    tree = cKDTree(points)
    places = points[spatial_sample(points, _LOOKED_AT)]
    for size in _SIZES:
        if size >= len(points):
            break
        patch = points[tree.query(places, size)[1]]
        patch = patch - patch.mean(axis=1, keepdims=True)
        moments = np.einsum("pki,pkj->ijp", patch, patch)[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]] / size
        least, middle, largest = (np.maximum(values, 0.0) for values in eigenvalues(moments))
        if float(np.median(largest / np.maximum(middle, 1e-300))) > _ELONGATION:
            along = float(np.median(np.sqrt(largest)))
            scatter = float(np.sqrt(np.median(0.5 * (least + middle)) * size / (size - 2.0)))
            return Thread(size / (2.0 * np.sqrt(3.0) * along), scatter)
    return None


def order_any(
    points: Array, radius: float | None, scale: Scale, viewpoint: Array | None, bridging: Bridging | None = None
) -> Ordering:
    """The order of a cloud, as `order` finds it; that of a thread where this one is better.

    Args:
        points, radius, scale, viewpoint, bridging: as in `order`.

    Raises:
        FitError: as `order` does, and the cloud is no thread.
    """
    found: Ordering | None = None
    failed: FitError | None = None
    beads = False
    try:
        found = order(points, radius, scale, viewpoint, bridging)
        beads = not scale.resolved and radius is None
        if not _is_sparse(scale) or not (beads or _bad(found)):
            return found
    except FitError as reason:
        failed = reason
    # Where a string of beads is zigzag, in their noise, its middle is followed instead.
    thread = thread_of(points) if _is_sparse(scale) else None
    # What does not scatter are nodes on the axis.
    if thread is not None and thread.scatter * thread.per_metre > _EXACT:
        for count in _POINTS:
            try:
                other = _followed(points, thread, count, scale, bridging)
            except FitError:
                continue
            if found is None or _bad(other) < _bad(found) + (not found.thread and beads):
                found = other
            if found.thread and not _bad(found):
                break
    if found is None:
        assert failed is not None
        raise failed
    return found


def _bad(ordering: Ordering) -> int:
    return sum(item.is_bad for item in ordering.findings)


def _is_sparse(scale: Scale) -> bool:
    """Whether the points are too few for the width that they suggest."""
    return not scale.per_radius >= _DENSE


def _followed(points: Array, thread: Thread, count: float, scale: Scale, bridging: Bridging | None) -> Ordering:
    """The order of a thread, with so many points to a step."""
    step = max(count / thread.per_metre, _WIDTHS * thread.scatter)
    found = follow(points, step, thread.per_metre * step, scale, bridging)
    # There are as many as it takes: the step was chosen so.
    findings = tuple(item for item in found.findings if not TOO_FEW_POINTS.matches(item))
    half = thread.half_width
    return replace(found, radius=half, half_width=half, findings=findings, noisy=True, thread=True)
