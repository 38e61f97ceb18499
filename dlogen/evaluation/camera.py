"""A simulated depth camera: what a structured-light sensor sees of a tube on a table.

The Kinect v1 is modelled after Khoshelham and Elberink (2012), "Accuracy and Resolution of Kinect Depth Data for Indoor
Mapping Applications", Sensors 12(2): depth comes from a disparity in whole steps, 1 / Z = m d' / (f b) + n with
m / (f b) = 2.85e-3 1/m, so that depths are 2.85e-3 Z^2 apart (1.8 mm at 0.8 m); the disparity has a standard deviation
of half a step, so that depth has 1.425e-3 Z^2 (0.9 mm at 0.8 m). Depth is given from 0.5 m to 5 m. The focal length is
585 pixels of a 640 x 480 image. Not modelled: the shadow of the projector beside the object, lens distortion,
correlation between neighbouring pixels; `dlogen.evaluation.sensors` has the first and the last, and other sensors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dlogen.errors import UsageError
from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.sensors.rendering import tube_depth
from dlogen.evaluation.shapes import hose_centre_line
from dlogen.types import Array, BoolArray, RawCloud
from dlogen.types.texts import millimetres


@dataclass(frozen=True)
class Camera:
    """A pinhole depth camera; x right, y down, z forward (the optical frame of REP 103).

    Attributes:
        name: what the user calls it.
        width, height: of the image, pixels.
        focal: focal length, pixels.
        inverse_depth_step: difference of 1 / Z between neighbouring disparities, 1/m; 0 for continuous depth.
        disparity_std: standard deviation of the disparity, in steps, rounding to whole steps included.
        grazing: smallest cosine between ray and surface normal that still gives a depth.
        nearest, farthest: depths that the sensor measures, metres.
    """

    name: str
    width: int
    height: int
    focal: float
    inverse_depth_step: float
    disparity_std: float
    grazing: float
    nearest: float
    farthest: float

    @property
    def rays(self) -> Array:
        """(height, width, 3) directions of the pixels with z = 1."""
        x = (np.arange(self.width) - 0.5 * (self.width - 1)) / self.focal
        y = (np.arange(self.height) - 0.5 * (self.height - 1)) / self.focal
        grid = np.meshgrid(x, y)
        return np.stack([*grid, np.ones_like(grid[0])], axis=-1)


KINECT_V1 = Camera("kinect-v1", 640, 480, 585.0, 2.85e-3, 0.5, 0.2, 0.5, 5.0)

CAMERAS = {camera.name: camera for camera in (KINECT_V1,)}


@dataclass(frozen=True, eq=False)
class Capture:
    """A scene seen twice, with and without the object.

    Attributes:
        scene: organised cloud with the object, NaN where the sensor sees nothing; camera frame, metres.
        background: the same place without the object, with its own noise.
        is_object: (width * height,) which pixels of `scene` show the object.
        line: the true axis in the camera frame.
        radius: of the object, metres.
    """

    scene: RawCloud
    background: RawCloud
    is_object: BoolArray
    line: CentreLine
    radius: float


def capture(
    line: CentreLine, radius: float, rng: np.random.Generator, camera: Camera = KINECT_V1, distance: float = 0.8
) -> Capture:
    """Look straight down on a tube that lies on a table.

    Args:
        line: the axis, z upwards; it is moved so that the tube rests on the table in the middle of the image.
        radius: of the tube, metres.
        rng: generator of the sensor's noise.
        camera: the sensor.
        distance: from the camera to the table, metres.

    Raises:
        UsageError: the object does not fit into the image, the sensor does not measure at that distance, or the object
            is thinner than a pixel.
    """
    seen = _before_camera(line, radius, distance)
    _refuse_bad_view(seen, radius, camera, distance)
    object_depth, cosine = tube_depth(seen, radius, camera.rays, (camera.focal, camera.focal))
    is_object = object_depth < distance
    table = np.full(object_depth.shape, distance)
    scene = _sense(np.minimum(object_depth, table), rng, camera)
    scene[is_object & (cosine < camera.grazing)] = np.nan
    return Capture(
        _cloud(scene, camera),
        _cloud(_sense(table, rng, camera), camera),
        is_object.ravel(),
        seen,
        radius,
    )


def hose_capture(seed: int) -> Capture:
    """The paper's experiment (IV.C, Table III): a hose of 1.7 m and 40 mm on a table, a Kinect v1 80 cm above it."""
    return capture(hose_centre_line(), 0.02, np.random.default_rng(seed))


def _refuse_bad_view(line: CentreLine, radius: float, camera: Camera, distance: float) -> None:
    """Raise `UsageError` unless the camera sees the whole object, given in its frame."""
    pixel = distance / camera.focal
    if 2.0 * radius < pixel:
        raise UsageError(
            f"the object is thinner than a pixel, which is {millimetres(pixel)} wide on the table",
            "give a larger diameter, or a smaller distance",
        )
    axis = line.points(2000)
    # Wherever in its bounding box the object is, it is in view if the box's upper side is.
    upper = float(axis[:, 2].min()) - radius
    half = 0.5 * np.array([camera.width - 1, camera.height - 1]) / camera.focal
    needed = max(float(((np.abs(axis[:, :2]) + radius) / half).max()), camera.nearest)
    if camera.nearest <= distance <= camera.farthest and upper >= needed - 1e-9:
        return
    least = math.ceil(100.0 * (needed + distance - upper)) / 100.0
    between = f"{camera.name} measures depths from {camera.nearest:g} to {camera.farthest:g} m"
    if least > camera.farthest:
        raise UsageError(
            f"the object is too large for the camera's view: it needs a distance of {least:.2f} m",
            f"{between}: take a smaller object",
        )
    unseen = "the table" if distance > camera.farthest else "the whole object"
    raise UsageError(
        f"from {distance:g} m the camera does not see {unseen}",
        f"give a distance of {least:.2f} m or more; {between}",
    )


def _before_camera(line: CentreLine, radius: float, distance: float) -> CentreLine:
    """The line in the camera frame: seen from above, resting on the table, centred."""
    # World z upwards becomes camera z downwards; y follows to keep the frame right-handed.
    turn = np.diag([1.0, -1.0, -1.0])
    points = line.points(2000) @ turn.T
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return line.moved(turn, np.array([-middle[0], -middle[1], distance - radius - points[:, 2].max()]))


def _sense(depth: Array, rng: np.random.Generator, camera: Camera) -> Array:
    """Depth as the sensor gives it: noise on the disparity, then whole steps."""
    if camera.inverse_depth_step == 0.0:
        exact: Array = depth.copy()
        return exact
    # Rounding adds a twelfth of a step squared to the variance: the sum is what was measured of the sensor.
    noise = np.sqrt(max(camera.disparity_std**2 - 1.0 / 12.0, 0.0))
    disparity = np.round(1.0 / (depth * camera.inverse_depth_step) + rng.normal(scale=noise, size=depth.shape))
    return 1.0 / (disparity * camera.inverse_depth_step)


def _cloud(depth: Array, camera: Camera) -> RawCloud:
    """An organised cloud from a depth image."""
    points = (camera.rays * depth[..., None]).reshape(-1, 3)
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return RawCloud(points, viewpoint=pose, width=camera.width, height=camera.height)
