"""Options about a simulated sensor, and the clouds that it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from dlogen.cli.types import Number

if TYPE_CHECKING:
    import numpy as np

    from dlogen.evaluation.centre_line import CentreLine
    from dlogen.types import RawCloud

_Function = Callable[..., Any]

#: Names of `dlogen.evaluation.sensors.models.SENSORS`, which would take long to load.
SENSOR_NAMES = (
    "kinect-v1",
    "kinect-v2",
    "azure-kinect",
    "realsense-d435",
    "realsense-l515",
    "zed2",
    "structured-light",
    "line-laser",
    "terrestrial",
)

#: Options that ask for the object alone.
_CUT_OUT = ("mask_grow", "views", "registration", "voxel", "voxel_centre")

_OPTIONS = (
    click.option(
        "--camera",
        type=click.Choice(SENSOR_NAMES),
        help="Look down on the object on a table with the noise and the failures of this sensor: an organised cloud, "
        "and NAME.background without the object.",
    ),
    click.option(
        "--distance",
        type=Number(0.0, min_open=True),
        metavar="METRES",
        help="From the camera to the table; the sensor's usual one by default (0.8 of kinect-v1).",
    ),
    click.option(
        "--tilt",
        type=Number(0.0, 80.0, max_open=True),
        metavar="DEGREES",
        help="Of the view from straight down; 0 by default, 30 of several views.",
    ),
    click.option(
        "--mask-grow",
        type=Number(-100.0, 100.0),
        metavar="PX",
        help="Instead of the scene and its background only the object, cut out by a mask this many pixels wider "
        "than it at each side; negative: narrower.",
    ),
    click.option(
        "--holes",
        type=Number(0.0, 1.0, max_open=True),
        metavar="SHARE",
        help="Share of the object that is lost in patches, steep parts first.",
    ),
    click.option("--frames", type=click.IntRange(1, 1000), help="Number of frames that are averaged."),
    click.option(
        "--views",
        type=click.IntRange(1, 100),
        help="Number of views from around the object that are put together; the object alone, as with --mask-grow.",
    ),
    click.option(
        "--registration",
        type=Number(0.0),
        metavar="METRES",
        help="Standard deviation by which the further views are displaced: a ghost of the surface.",
    ),
    click.option(
        "--voxel",
        type=Number(0.0, min_open=True),
        metavar="METRES",
        help="Keep the centroid of the points in each cube of this size; the object alone.",
    ),
    click.option("--voxel-centre", is_flag=True, help="Keep the cube's centre instead of the centroid."),
    click.option(
        "--world", is_flag=True, help="Points in a frame with z upwards from the table; the file has the camera's pose."
    ),
)

_NAMES = ("distance", "tilt", "mask_grow", "holes", "frames", "views", "registration", "voxel", "voxel_centre", "world")


def sensor_options(function: _Function) -> _Function:
    """What looks at the object, and how: the command gets `camera` and `sensing`, the options that were given."""

    @wraps(function)
    def wrapped(*args: Any, **rest: Any) -> Any:
        context = click.get_current_context()
        values = {name: rest.pop(name) for name in _NAMES}
        sensing = {
            name: value
            for name, value in values.items()
            if context.get_parameter_source(name) is not ParameterSource.DEFAULT
        }
        return function(*args, sensing=sensing, **rest)

    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return wrapped


def refuse_contradictions(camera: str | None, sensing: Mapping[str, Any]) -> None:
    """Raise `UsageError` for options about a sensor that do not go together."""
    from dlogen.errors import UsageError

    names = ["--" + name.replace("_", "-") for name in sensing]
    if camera is None and sensing:
        raise UsageError(f"{' and '.join(names)} {'are' if len(names) > 1 else 'is'} the camera's", "add --camera NAME")
    if "registration" in sensing and sensing.get("views", 1) == 1:
        raise UsageError("--registration is about several views", "add --views 2 or more")
    if "voxel_centre" in sensing and "voxel" not in sensing:
        raise UsageError("--voxel-centre needs the size of the cubes", "add --voxel METRES")


def cuts_out(sensing: Mapping[str, Any]) -> bool:
    """Whether the object alone is asked for, and no background."""
    return any(name in sensing for name in _CUT_OUT)


def seen(
    camera: str, line: CentreLine, radius: float, rng: np.random.Generator, sensing: Mapping[str, Any]
) -> tuple[RawCloud, RawCloud | None, CentreLine]:
    """The cloud, the background unless the object is cut out, and the axis in the frame of the cloud.

    Args:
        camera: name of the sensor.
        line: the axis, metres.
        radius: of the object, metres.
        rng: of the sensor's noise.
        sensing: options that were given, by their names.

    Raises:
        UsageError: the sensor does not see the object.
    """
    from dlogen.types import RawCloud

    if camera == "kinect-v1" and set(sensing) <= {"distance"}:
        # The camera of the paper's experiment: its pixels know nothing of each other.
        from dlogen.evaluation.camera import KINECT_V1, capture

        plain = capture(line, radius, rng, KINECT_V1, **sensing)
        return plain.scene, plain.background, plain.line
    options = dict(sensing)
    if not cuts_out(options):
        from dlogen.evaluation.sensors.capture import sensor_scene

        whole = sensor_scene(line, radius, camera, seed=rng, **options)
        return whole.scene, whole.background, whole.line
    from dlogen.evaluation.sensors.fusion import fused_cloud

    if options.pop("voxel_centre", False):
        options["voxel_point"] = "centre"
    alone = fused_cloud(line, radius, camera, seed=rng, **options)
    return RawCloud(alone.points, viewpoint=alone.viewpoint), None, alone.line
