"""Clouds as a sensor gives them of a tube on a table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from dlogen.errors import UsageError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.models import SENSORS, Sensor
from dlogen.evaluation.sensors.noise import ExactView, holes, measured, smooth_noise
from dlogen.evaluation.sensors.rendering import tube_depth
from dlogen.geometry.rotations import quaternion
from dlogen.types import Array, BoolArray


@dataclass(frozen=True, eq=False)
class SensorCloud:
    """The object alone, cut out of what a sensor sees.

    Attributes:
        points: (M, 3) metres.
        viewpoint: (7,) pose of the sensor in the frame of the points: x y z qw qx qy qz.
        line: the true axis in the frame of the points.
        radius: of the object, metres.
        is_object: (M,) which points lie in directions in which the object is (others are the mask's).
    """

    points: Array
    viewpoint: Array
    line: CentreLine
    radius: float
    is_object: BoolArray


def sensor_cloud(
    curve: CentreLine | npt.ArrayLike,
    radius: float,
    sensor: Sensor | str,
    *,
    distance: float | None = None,
    tilt: float = 0.0,
    seed: int | np.random.Generator = 0,
    mask_grow: int = 0,
    lost: float = 0.0,
    frames: int = 1,
    world: bool = False,
) -> SensorCloud:
    """What a sensor sees of a tube on a table, cut out by a mask.

    Args:
        curve: the axis, z upwards, or (K, 3) points on it; it is moved so that the tube rests on the table in the
            middle of the view.
        radius: of the tube, metres.
        sensor: or its name.
        distance: from the sensor to the table along the view, metres; None for what is usual.
        tilt: of the view from straight down, degrees.
        seed: of everything random, or a generator.
        mask_grow: pixels by which the mask is wider than the object; negative: narrower.
        lost: share of the object's pixels that are lost in patches.
        frames: number of frames that are averaged.
        world: points in a frame with z upwards and the table at z = 0, instead of the sensor's.

    Raises:
        UsageError: the sensor does not see the whole object from there.
    """
    from scipy import ndimage

    if isinstance(sensor, str):
        sensor = SENSORS[sensor]
    line = curve if isinstance(curve, CentreLine) else from_points(np.asarray(curve, dtype=float))
    rng = np.random.default_rng(seed)
    distance = sensor.usual if distance is None else distance
    rotation, position = _pose(distance, tilt)
    on_table = _on_table(line, radius)
    seen = on_table.moved(rotation.T, -rotation.T @ position)
    sensor = _fitted(sensor, seen, radius, distance)
    view = _view(seen, radius, sensor, rotation, position)
    shape = view.tube.shape
    fixed = smooth_noise(shape, sensor.correlation, rng) if sensor.fixed else 0.0
    fields = [
        np.sqrt(1.0 - sensor.fixed) * smooth_noise(shape, sensor.correlation, rng) + np.sqrt(sensor.fixed) * fixed
        for _ in range(frames)
    ]
    depth = measured(view, sensor, fields)
    size = 2.0 * sensor.focal[0] * radius / distance
    depth[holes(view, lost, 2.0 * size, rng)] = np.nan
    colour = sensor.colour_grid()
    rays = colour.rays()
    if colour is not sensor:
        view = _view(seen, radius, colour, rotation, position)
        depth = _aligned(depth, sensor, colour)
    mask = shown = view.is_object
    if mask_grow:
        change = ndimage.binary_dilation if mask_grow > 0 else ndimage.binary_erosion
        mask = change(shown, iterations=abs(mask_grow))
    kept = mask & np.isfinite(depth)
    points = rays[kept] * depth[kept][:, None]
    viewpoint = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if world:
        points = points @ rotation.T + position
        viewpoint = np.concatenate([position, quaternion(rotation)])
        seen = on_table
    return SensorCloud(points, viewpoint, seen, radius, shown[kept])


def _pose(distance: float, tilt: float, azimuth: float = 0.0) -> tuple[Array, Array]:
    """Axes (as columns) and place of a sensor that looks at the origin of a world whose z is up; angles in degrees."""
    lean, turn = np.radians([tilt, azimuth])
    view = np.array([-np.sin(turn) * np.sin(lean), np.cos(turn) * np.sin(lean), -np.cos(lean)])
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    return np.stack([right, np.cross(view, right), view], axis=1), -distance * view


def _on_table(line: CentreLine, radius: float) -> CentreLine:
    """The line where the tube rests on the plane z = 0, the middle of its bounding box above the origin."""
    points = line.points(2000)
    low, high = points.min(axis=0), points.max(axis=0)
    return line.moved(np.eye(3), np.array([*(-0.5 * (low + high)[:2]), radius - low[2]]))


def _view(line: CentreLine, radius: float, sensor: Sensor, rotation: Array, position: Array) -> ExactView:
    rays = sensor.rays()
    tube, cosine = tube_depth(line, radius, rays, sensor.focal)
    with np.errstate(divide="ignore"):
        table = -position[2] / (rays @ rotation[2])
    table[table <= 0.0] = np.inf
    return ExactView(tube, table, cosine)


def _fitted(sensor: Sensor, line: CentreLine, radius: float, distance: float) -> Sensor:
    """The sensor with its image as large as a scanner needs; `UsageError` where the object is not in view."""
    if sensor.pitch is not None:
        sensor = replace(sensor, focal=(distance / sensor.pitch[0], distance / sensor.pitch[1]))
    axis = line.points(2000)
    near = axis[:, 2] - radius
    if near.min() < sensor.nearest or axis[:, 2].max() > sensor.farthest:
        raise UsageError(
            f"from {distance:g} m the object is not within the depths that {sensor.name} measures",
            f"these are {sensor.nearest:g} to {sensor.farthest:g} m: change the distance",
        )
    grid = sensor.colour_grid()
    half = ((np.abs(axis[:, :2]) + radius) / near[:, None]).max(axis=0) * grid.focal
    if sensor.scans:
        width, height = (2 * int(np.ceil(h)) + 11 for h in half)
        return replace(sensor, width=width, height=height)
    if half[0] > 0.5 * (sensor.width - 1) or half[1] > 0.5 * (sensor.height - 1):
        least = distance * max(half[0] / (0.5 * (sensor.width - 1)), half[1] / (0.5 * (sensor.height - 1)))
        raise UsageError(
            f"from {distance:g} m {sensor.name} does not see the whole object",
            f"give a distance of about {np.ceil(100.0 * least) / 100.0:.2f} m, or a smaller object",
        )
    return sensor


def _aligned(depth: Array, sensor: Sensor, colour: Sensor) -> Array:
    """Depth in the pixels of the colour image: that of the nearest depth pixel."""
    index = []
    for count, own, other in zip(depth.shape, sensor.focal[::-1], colour.focal[::-1], strict=True):
        middle = 0.5 * (count - 1)
        index.append(np.round((np.arange(count) - middle) * own / other + middle).astype(int))
    aligned: Array = depth[np.ix_(*index)]
    return aligned
