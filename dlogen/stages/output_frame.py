"""The frame that all output is in: by default the cloud's own, else one rigid transform of what a fit made.

The fit itself never sees it, so the same cloud has the same chain in every frame.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dlogen.config.defaults import CHAIN_FRAME
from dlogen.config.fields import AUTO
from dlogen.errors import ConfigError
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.rotations import from_quaternion, hinges
from dlogen.types import Array, Cloud, Finding, FitData, Frame, Intermediate, Quality, Segmentation

if TYPE_CHECKING:
    from dlogen.config.sections import FrameSettings

_Fit = TypeVar("_Fit", bound=FitData)

#: From an optical frame (z forward, x right, y down) to one of ROS (x forward, y left, z up), REP 103:
#: x_ros = z_optical, y_ros = -x_optical, z_ros = -y_optical.
OPTICAL_TO_ROS = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def output_frame(settings: FrameSettings, cloud: Cloud, scale: float = 1.0) -> Frame:
    """The frame that the settings ask for.

    Args:
        settings: section `frame` of the configuration.
        cloud: with the sensor's pose, if that is wanted.
        scale: metres in a unit of the cloud.

    Raises:
        ConfigError: the viewpoint is to be applied, but the cloud names none, or one without a direction.
    """
    transform = viewpoint_pose(cloud, scale) if settings.use_viewpoint else np.eye(4)
    if settings.convention == "optical-to-ros":
        transform = _pose(OPTICAL_TO_ROS) @ transform
    turn = hinges(("z", "y", "x"), np.array([settings.yaw, settings.pitch, settings.roll]))
    transform = _pose(turn, (settings.x, settings.y, settings.z)) @ transform
    return Frame(CHAIN_FRAME if settings.name == AUTO else settings.name, transform)


def viewpoint_pose(cloud: Cloud, scale: float = 1.0) -> Array:
    """(4, 4) pose of the sensor as the cloud's file has it, metres.

    PCL stores in VIEWPOINT the pose from which the points were acquired, but not whether they have been brought into
    the frame of that pose. This is for points that have not, and are in the sensor's frame: p = R p_sensor + t, as
    `pcl_transform_from_viewpoint` and PCL's viewer have it.

    Raises:
        ConfigError: the cloud names none, or its quaternion is zero.
    """
    hint = "leave frame.use_viewpoint away, or give the sensor's pose as frame.x, y, z, roll, pitch and yaw"
    if cloud.viewpoint is None or not np.isfinite(cloud.viewpoint).all():
        raise ConfigError("frame.use_viewpoint is true, but the cloud names no viewpoint", hint)
    if cloud.orientation is None:
        return _pose(np.eye(3), cloud.viewpoint * scale)
    if not np.isfinite(cloud.orientation).all() or not cloud.orientation.any():
        raise ConfigError("frame.use_viewpoint is true, but the quaternion of the cloud's viewpoint is none", hint)
    return _pose(from_quaternion(cloud.orientation), cloud.viewpoint * scale)


def in_frame(result: _Fit, frame: Frame, centre: Array) -> _Fit:
    """The result in that frame.

    Rotations are applied before anything is added, so that no digits are lost far from the origin. The frames of the
    segments begin anew, with the first one's z axis as near to the new z axis as it can be.

    Args:
        result: of a fit to points relative to `centre`.
        frame: the frame wanted.
        centre: (3,) place in the cloud's frame, metres.
    """
    rotation = frame.transform[:3, :3]
    offset = rotation @ centre + frame.transform[:3, 3]
    turned = not np.array_equal(rotation, np.eye(3))

    def there(points: Array) -> Array:
        return points @ rotation.T + offset if turned else points + offset

    def finding_there(finding: Finding) -> Finding:
        if finding.position is None:
            return finding
        x, y, z = (float(value) for value in there(np.array(finding.position)))
        return replace(finding, position=(x, y, z))

    def segmentation_there(made: Segmentation) -> Segmentation:
        joints = replace(made.joints, positions=there(made.joints.positions))
        return replace(made, joints=joints, alternatives=tuple(map(segmentation_there, made.alternatives)))

    def intermediate_there(made: Intermediate) -> Intermediate:
        columns = dict(made.columns)
        normal = ("nx", "ny", "nz")
        if turned and columns.keys() >= set(normal):
            vectors = np.stack([columns[name] for name in normal], axis=1) @ rotation.T
            columns.update(zip(normal, vectors.T, strict=True))
        return replace(made, points=there(made.points), columns=columns)

    line, segmentation = result.skeleton, segmentation_there(result.segmentation)
    transforms = result.chain.transforms.copy()
    transforms[:, :3, 3] = there(transforms[:, :3, 3])
    if turned:
        transforms[:, :3, :3] = minimal_rotation_frames(transforms[:, :3, 0] @ rotation.T)
    return replace(
        result,
        frame=frame,
        skeleton=replace(
            line,
            weights=line.weights @ rotation.T if turned else line.weights,
            offset=there(line.offset),
        ),
        skeleton_points=there(result.skeleton_points),
        segmentation=segmentation,
        joints=segmentation.joints,
        chain=replace(result.chain, joints=segmentation.joints.positions, transforms=transforms),
        quality=Quality(tuple(map(finding_there, result.quality.findings))),
        intermediates=tuple(map(intermediate_there, result.intermediates)),
    )


def _pose(rotation: Array, position: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose
