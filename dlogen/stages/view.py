"""Where a cloud was seen from: what its file says, or what its points show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.sampling import spatial_sample
from dlogen.geometry.vectors import column_dots, dots, normals_to, unit
from dlogen.types import Array

#: Points of the cloud that are looked at, and the decimals (relative) to which their ratios agree.
_LOOKED_AT, _DECIMALS = 4000, 6

#: On a pixel grid the points have far fewer distinct columns and rows than there are points.
_FEWER = 0.5

#: Unit vectors along which places are seen: (3, K) -> (3, K).
View = Callable[[Array], Array]

#: A cloud is one-sided if its strip is so many times as wide as deep.
ONE_SIDED = 1.4

#: Vertices of a line whose points are looked at together: each is a radius from the next.
_TOGETHER = 4


def camera_at_origin(points: Array) -> bool:
    """Whether the points are pixels of a pinhole camera at the origin of their frame, which looks along one axis.

    Rays through the pixels have few distinct x / z and y / z, since there are only so many columns and rows; points of
    anything else have as many as there are points.

    Args:
        points: (M, 3) as the file has them, any units.
    """
    some = points[:: -(-len(points) // _LOOKED_AT)]
    if len(some) < 100:
        return False
    for axis in range(3):
        depth = some[:, axis]
        if not ((depth > 0.0).all() or (depth < 0.0).all()):
            continue
        others = np.delete(some, axis, axis=1) / depth[:, None]
        distinct = [len(np.unique(np.round(column, _DECIMALS))) for column in others.T]
        # Along a straight object all but one of the columns may be met by one point only.
        if min(distinct) < _FEWER * len(some) and _on_grid(others):
            return True
    return False


def _on_grid(ratios: Array) -> bool:
    """Whether both ratios are multiples of one step, from some place on: (M, 2)."""
    for column in ratios.T:
        values = np.unique(np.round(column, _DECIMALS + 1))
        steps = np.diff(values)
        steps = steps[steps > 0.5 * 10.0**-_DECIMALS]
        if len(steps) < 8:
            return False
        pixel = float(np.quantile(steps, 0.1))
        place = (values - values[0]) / pixel
        # The step itself is known to a part in so many only: neighbours tell better than places far apart.
        apart = steps / pixel
        if pixel < 1e-5 or np.mean(np.abs(apart - np.round(apart)) < 0.1) < 0.9 or len(place) < 8:
            return False
    return True


def thin_direction(points: Array, line: Array) -> tuple[Array, float]:
    """The direction in which a strip around a line is thinnest, and by how much: the view, up to its sign.

    Args:
        points: (M, 3) metres.
        line: (K, 3) vertices in order through the middle of the strip, metres.

    Returns:
        A unit vector, and the ratio of the spread across it to that along it: 1 where all directions are alike.
    """
    points = points[spatial_sample(points, _LOOKED_AT)]
    index = cKDTree(line).query(points)[1]
    tangent = unit(np.gradient(line, axis=0))[index]
    offset = points - line[index]
    offset -= dots(offset, tangent)[:, None] * tangent
    # The line may be the axis, beside the strip.
    group = index // _TOGETHER
    count = np.maximum(np.bincount(group), 1)
    offset -= np.stack([np.bincount(group, column) / count for column in offset.T], axis=1)[group]
    # What is across the tangent counts; along it nothing is known, and takes part as the mean of the others.
    squares = dots(offset, offset)
    within = squares <= np.quantile(squares, 0.95)
    offset, tangent, squares = offset[within], tangent[within], squares[within]
    moment = offset.T @ offset
    weight = np.eye(3) * len(offset) - tangent.T @ tangent
    # The direction v of least v M v / v W v: the mean square of the offsets along v, where v is across the line.
    values, vectors = np.linalg.eig(np.linalg.solve(weight + 1e-9 * len(offset) * np.eye(3), moment))
    values, vectors = values.real, vectors.real
    thinnest = int(np.argmin(values))
    direction = vectors[:, thinnest] / np.linalg.norm(vectors[:, thinnest])
    rest = (float(squares.sum()) - float(values[thinnest]) * float(direction @ weight @ direction)) / len(offset)
    return direction, float(np.sqrt(max(rest, 0.0) / max(float(values[thinnest]), 1e-300)))


def rays(viewpoint: Array | None, direction: Array) -> View:
    """The view from a place, or along a direction where there is none."""

    def from_place(places: Array) -> Array:
        away = places - np.asarray(viewpoint)[:, None]
        result: Array = away / np.maximum(np.sqrt(column_dots(away, away)), 1e-300)
        return result

    def along(places: Array) -> Array:
        return np.repeat(direction[:, None], places.shape[1], axis=1)

    return along if viewpoint is None else from_place


@dataclass(frozen=True, eq=False)
class FlatView:
    """A cloud as it is seen: two coordinates across the view, and a depth that counts for little.

    In a camera's image a strip has sharp edges, whatever its depth. Coordinates across the view are those in the image
    times the distance of the middle of the cloud, so that they are metres there.

    Attributes:
        axes: (3, 3) rows: two unit vectors across the view, and one along it.
        viewpoint: (3,) metres; None for a view along one direction.
        distance: of the middle of the cloud along the view, metres.
        depth_share: factor of the depth.
    """

    axes: Array
    viewpoint: Array | None
    distance: float
    depth_share: float = 0.2

    @staticmethod
    def of(points: Array, viewpoint: Array | None, direction: Array | None) -> FlatView:
        """The view of a cloud (M, 3) from a place or along a direction."""
        middle = points.mean(axis=0)
        along = unit(middle - viewpoint) if viewpoint is not None else direction
        assert along is not None
        across = normals_to(along[None])[0]
        axes = np.stack([across, np.cross(along, across), along])
        distance = float(along @ (middle - viewpoint)) if viewpoint is not None else float(along @ middle)
        return FlatView(axes, viewpoint, distance)

    def flat(self, points: Array) -> Array:
        """Points (M, 3) as they are seen."""
        x, y, depth = self.axes @ (points - (self.viewpoint if self.viewpoint is not None else 0.0)).T
        scale = self.distance / np.maximum(depth, 1e-3 * self.distance) if self.viewpoint is not None else 1.0
        return np.stack([x * scale, y * scale, (depth - self.distance) * self.depth_share], axis=1)

    def back(self, flat: Array) -> Array:
        """Points (..., 3) that are seen like that."""
        depth = flat[..., 2] / self.depth_share + self.distance
        scale = depth / self.distance if self.viewpoint is not None else 1.0
        seen = np.stack([flat[..., 0] * scale, flat[..., 1] * scale, depth], axis=-1) @ self.axes
        return seen + self.viewpoint if self.viewpoint is not None else seen
