"""What a sensor gives of a tube on a table: the object cut out by a mask, or the whole scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from dlogen.errors import UsageError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.models import SENSORS, Sensor
from dlogen.evaluation.sensors.noise import ExactView, grown_mask, hole_pattern, measured
from dlogen.evaluation.sensors.rendering import exact_depth
from dlogen.geometry.rotations import quaternion
from dlogen.types import Array, BoolArray, RawCloud


@dataclass(frozen=True, eq=False)
class SensorCloud:
    """The object alone, cut out of what a sensor sees.

    Attributes:
        points: (M, 3) metres.
        viewpoint: (7,) pose of the sensor in the frame of the points: x y z qw qx qy qz.
        line: the true axis in the frame of the points.
        radius: of the object, metres.
        is_object: (M,) which points lie in directions in which the object is; the others are there by the mask.
    """

    points: Array
    viewpoint: Array
    line: CentreLine
    radius: float
    is_object: BoolArray


@dataclass(frozen=True, eq=False)
class SensorScene:
    """All that a sensor sees, with and without the object.

    Attributes:
        scene: organised cloud with the object, NaN where the sensor sees nothing, metres.
        background: the same place without the object, with its own noise.
        is_object: (width * height,) which pixels of `scene` show the object.
        line: the true axis in the frame of the points.
        radius: of the object, metres.
    """

    scene: RawCloud
    background: RawCloud
    is_object: BoolArray
    line: CentreLine
    radius: float


@dataclass(frozen=True, eq=False)
class Look:
    """A sensor in its place before a tube on a table.

    Attributes:
        sensor: with the size of its image.
        rotation: (3, 3) axes of the sensor as columns, in a world whose z is up and whose table is z = 0.
        position: (3,) of the sensor there, metres.
        line: the axis there.
        radius: of the tube, metres.
        distance: from the sensor to the table along the view, metres.
    """

    sensor: Sensor
    rotation: Array
    position: Array
    line: CentreLine
    radius: float
    distance: float

    @property
    def seen_line(self) -> CentreLine:
        """The axis in the sensor's frame."""
        return self.line.moved(self.rotation.T, -self.rotation.T @ self.position)

    def exact(self, grid: Sensor) -> ExactView:
        """What the rays of the sensor, or of the colour image beside it, meet."""
        rays = grid.rays()
        tube, cosine = exact_depth(self.seen_line, self.radius, rays, grid.focal)
        downward = rays @ self.rotation[2]
        table = np.full(tube.shape, np.inf)
        np.divide(-self.position[2], downward, out=table, where=downward < 0.0)
        return ExactView(tube, table, cosine)

    def depth(self, view: ExactView, rng: np.random.Generator, holes: float, frames: int) -> Array:
        """Depth image in the pixels that the cloud has, of what the sensor's own rays meet."""
        depth = measured(view, self.sensor, rng, frames)
        size = 2.0 * self.sensor.focal[0] * self.radius / self.distance
        depth[hole_pattern(view, holes, 2.0 * size, rng, self.sensor.window)] = np.nan
        grid = self.sensor.colour_grid()
        return depth if grid is self.sensor else _aligned(depth, self.sensor, grid)

    def cloud(self, directions: Array, depth: Array, world: bool) -> Array:
        """(M, 3) points at the depths (M,) along the rays (M, 3)."""
        points = directions * depth[:, None]
        return points @ self.rotation.T + self.position if world else points

    def viewpoint(self, world: bool) -> Array:
        """(7,) pose of the sensor in the frame of the points."""
        if world:
            # Adding zero turns -0.0 into 0.0.
            return np.concatenate([self.position, quaternion(self.rotation)]) + 0.0
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def sensor_cloud(
    curve: CentreLine | npt.ArrayLike,
    radius: float,
    sensor: Sensor | str,
    *,
    distance: float | None = None,
    tilt: float = 0.0,
    azimuth: float = 0.0,
    seed: int | np.random.Generator = 0,
    mask_grow: float = 0.0,
    holes: float = 0.0,
    frames: int = 1,
    world: bool = False,
) -> SensorCloud:
    """What a sensor sees of a tube on a table, cut out by a mask.

    Args:
        curve: the axis, z upwards, or (K, 3) points on it; it is moved so that the tube rests on the table in the
            middle of the view.
        radius: of the tube, metres.
        sensor: or its name, a key of `SENSORS`.
        distance: from the sensor to the table along the view, metres; None for what is usual.
        tilt: of the view from straight down, degrees.
        azimuth: direction from which a tilted view comes, degrees about the world's z.
        seed: of everything random, or a generator.
        mask_grow: pixels by which the mask is wider than the object; negative: narrower.
        holes: share of the object's pixels that are lost in patches.
        frames: number of frames whose depths are averaged.
        world: points in a frame with z upwards and the table at z = 0, instead of the sensor's.

    Raises:
        UsageError: the sensor does not see the whole object from there, or nothing of it, or an argument is out of
            range.

    >>> cloud = sensor_cloud([[0, 0, 0], [0.1, 0.05, 0], [0.2, 0, 0]], 0.005, "realsense-d435", mask_grow=2)
    >>> cloud.points.shape[1], bool(cloud.is_object.all())
    (3, False)
    """
    rng = np.random.default_rng(seed)
    look = look_at(curve, radius, sensor, distance, tilt, azimuth, holes, frames)
    view = look.exact(look.sensor)
    depth = look.depth(view, rng, holes, frames)
    grid = look.sensor.colour_grid()
    shown = view.is_object if grid is look.sensor else look.exact(grid).is_object
    kept = grown_mask(shown, mask_grow, look.sensor.mask_edge, rng) & np.isfinite(depth)
    if not kept.any():
        raise UsageError(
            f"{look.sensor.name} sees nothing of the object from {look.distance:g} m",
            "give a larger diameter, a smaller distance or fewer holes",
        )
    points = look.cloud(grid.rays()[kept], depth[kept], world)
    line = look.line if world else look.seen_line
    return SensorCloud(points, look.viewpoint(world), line, radius, shown[kept])


def sensor_scene(
    curve: CentreLine | npt.ArrayLike,
    radius: float,
    sensor: Sensor | str,
    *,
    distance: float | None = None,
    tilt: float = 0.0,
    azimuth: float = 0.0,
    seed: int | np.random.Generator = 0,
    holes: float = 0.0,
    frames: int = 1,
    world: bool = False,
) -> SensorScene:
    """All that a sensor sees of a tube on a table, and of the table without it; arguments as of `sensor_cloud`."""
    rng = np.random.default_rng(seed)
    look = look_at(curve, radius, sensor, distance, tilt, azimuth, holes, frames)
    view = look.exact(look.sensor)
    depth = look.depth(view, rng, holes, frames)
    behind = look.depth(view.without_object(), rng, 0.0, frames)
    grid = look.sensor.colour_grid()
    shown = view.is_object if grid is look.sensor else look.exact(grid).is_object
    rays = grid.rays().reshape(-1, 3)
    scene, background = (
        RawCloud(look.cloud(rays, z.ravel(), world), viewpoint=look.viewpoint(world), width=z.shape[1], height=len(z))
        for z in (depth, behind)
    )
    return SensorScene(scene, background, shown.ravel(), look.line if world else look.seen_line, radius)


def look_at(
    curve: CentreLine | npt.ArrayLike,
    radius: float,
    sensor: Sensor | str,
    distance: float | None,
    tilt: float,
    azimuth: float,
    holes: float,
    frames: int,
) -> Look:
    """The sensor in its place; arguments as of `sensor_cloud`.

    Raises:
        UsageError: as `sensor_cloud`.
    """
    if isinstance(sensor, str):
        if sensor not in SENSORS:
            raise UsageError(f"there is no sensor {sensor!r}", f"known: {', '.join(SENSORS)}")
        sensor = SENSORS[sensor]
    distance = sensor.usual if distance is None else distance
    if not (radius > 0.0 and distance > 0.0 and 0.0 <= tilt < 80.0 and 0.0 <= holes < 1.0 and frames >= 1):
        raise UsageError(
            "an argument of the sensor is out of range",
            "radius, distance and frames are positive, the tilt is below 80 degrees, the share of holes below 1",
        )
    line = curve if isinstance(curve, CentreLine) else from_points(np.asarray(curve, dtype=float))
    rotation, position = _pose(distance, tilt, azimuth)
    look = Look(sensor, rotation, position, _on_table(line, radius), radius, distance)
    return replace(look, sensor=_fitted(look))


def _pose(distance: float, tilt: float, azimuth: float) -> tuple[Array, Array]:
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


def _fitted(look: Look) -> Sensor:
    """The sensor with its image as large as a scanner needs.

    Raises:
        UsageError: the object is not in view.
    """
    sensor, distance = look.sensor, look.distance
    if sensor.pitch is not None:
        sensor = replace(sensor, focal=(distance / sensor.pitch[0], distance / sensor.pitch[1]))
    axis = look.seen_line.points(2000)
    near = axis[:, 2] - look.radius
    if near.min() < sensor.nearest or axis[:, 2].max() > sensor.farthest:
        raise UsageError(
            f"from {distance:g} m the object is not within the depths that {sensor.name} measures",
            f"these are {sensor.nearest:g} to {sensor.farthest:g} m: change the distance",
        )
    half = ((np.abs(axis[:, :2]) + look.radius) / near[:, None]).max(axis=0) * sensor.colour_grid().focal
    if sensor.scans:
        width, height = (2 * int(np.ceil(h)) + 2 * sensor.window + 9 for h in half)
        return replace(sensor, width=width, height=height)
    excess = (half / (0.5 * np.array([sensor.width - 1, sensor.height - 1]))).max()
    if excess > 1.0:
        raise UsageError(
            f"from {distance:g} m {sensor.name} does not see the whole object",
            f"give a distance of about {np.ceil(100.0 * excess * distance) / 100.0:.2f} m, or a smaller object",
        )
    return sensor


def _aligned(depth: Array, sensor: Sensor, grid: Sensor) -> Array:
    """Depth in the pixels of the colour image: that of the nearest depth pixel."""
    places = []
    for count, own, other in zip(depth.shape, sensor.focal[::-1], grid.focal[::-1], strict=True):
        middle = 0.5 * (count - 1)
        places.append(np.round((np.arange(count) - middle) * own / other + middle).astype(int))
    aligned: Array = depth[np.ix_(*places)]
    return aligned
