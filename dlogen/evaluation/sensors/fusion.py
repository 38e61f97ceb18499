"""Several views in one cloud: where registration leaves them apart, the surface is there twice (a ghost)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.errors import UsageError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.capture import SensorCloud, sensor_cloud
from dlogen.evaluation.sensors.models import Sensor
from dlogen.geometry.rotations import from_quaternion
from dlogen.types import Array, BoolArray


def fused_cloud(
    curve: CentreLine | npt.ArrayLike,
    radius: float,
    sensor: Sensor | str,
    *,
    views: int = 1,
    registration: float = 0.0,
    voxel: float = 0.0,
    voxel_point: str = "centroid",
    tilt: float | None = None,
    seed: int | np.random.Generator = 0,
    world: bool = False,
    **options: Any,
) -> SensorCloud:
    """What a sensor sees of a tube on a table from several sides, in one cloud and thinned out.

    Args:
        curve, radius, sensor, seed, world: as of `sensor_cloud`.
        views: number of views, from directions even around the object; the first is exactly registered.
        registration: standard deviation by which each of the others is displaced along each axis, metres; each is
            also turned, so that the ends of the object are displaced by as much again.
        voxel: side of the cubes of which each keeps one point, metres; 0 for all points.
        voxel_point: "centroid" of the points in a cube, or the cube's "centre".
        tilt: of each view from straight down, degrees; None for 0 of one view and 30 of several.
        options: further arguments of `sensor_cloud`.

    Returns:
        The cloud; its viewpoint is that of the first view.

    Raises:
        UsageError: as `sensor_cloud`.
    """
    if views < 1 or registration < 0.0 or voxel < 0.0 or voxel_point not in ("centroid", "centre"):
        raise UsageError(
            "an argument of the views is out of range",
            "there is at least one view, lengths are not negative, a voxel's point is its centroid or centre",
        )
    rng = np.random.default_rng(seed)
    line = curve if isinstance(curve, CentreLine) else from_points(np.asarray(curve, dtype=float))
    tilt = (30.0 if views > 1 else 0.0) if tilt is None else tilt
    extent = 0.5 * float(np.ptp(line.points(200), axis=0).max())
    clouds = []
    for number in range(views):
        azimuth = 360.0 * number / views
        seen = sensor_cloud(line, radius, sensor, tilt=tilt, azimuth=azimuth, seed=rng, world=True, **options)
        points = seen.points
        if number > 0 and registration > 0.0:
            points = _displaced(points, registration, extent, rng)
        clouds.append((points, seen))
    first = clouds[0][1]
    points = np.concatenate([points for points, _ in clouds])
    is_object = np.concatenate([seen.is_object for _, seen in clouds])
    if voxel > 0.0:
        points, is_object = thinned(points, is_object, voxel, voxel_point)
    if world:
        return SensorCloud(points, first.viewpoint, first.line, radius, is_object)
    rotation, position = from_quaternion(first.viewpoint[3:]), first.viewpoint[:3]
    return SensorCloud(
        (points - position) @ rotation,
        np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        first.line.moved(rotation.T, -rotation.T @ position),
        radius,
        is_object,
    )


def thinned(points: Array, is_object: BoolArray, voxel: float, voxel_point: str) -> tuple[Array, BoolArray]:
    """One point for each cube of a grid that has any; it is the object's if most of the cube's points are."""
    cubes, owner, count = np.unique(
        np.floor(points / voxel).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    owner = owner.ravel()
    mostly: BoolArray = 2 * np.bincount(owner, is_object) >= count
    if voxel_point == "centre":
        centres = np.asarray((cubes + 0.5) * voxel, dtype=float)
        return centres, mostly
    centroids: Array = np.stack([np.bincount(owner, axis) for axis in points.T], axis=1) / count[:, None]
    return centroids, mostly


def _displaced(points: Array, registration: float, extent: float, rng: np.random.Generator) -> Array:
    """Points moved and turned a little about the origin, as by a registration that is not exact."""
    shift, turn = rng.normal(scale=registration, size=(2, 3))
    # Turns this small add up as vectors.
    moved: Array = points + shift + np.cross(turn / max(extent, registration), points)
    return moved
