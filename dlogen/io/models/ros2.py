"""A ROS 2 description package: the URDF with what it takes to look at it, to be dropped into a workspace.

colcon build --packages-select cloud_description && source install/setup.bash
ros2 launch cloud_description display.launch.py
"""

from __future__ import annotations

import hashlib
import re
import unicodedata
from typing import TYPE_CHECKING

from dlogen.io.models.urdf import urdf
from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.multibody.model import MultibodyModel
    from dlogen.types import Chain, FitData

#: Categories of Unicode that names differ by: letters, numbers, symbols, and what is no character at all.
_TELLING = "LNSC"


def package_name(stem: str) -> str:
    """The package's name for a stem of file names, by the rules of REP 144.

    Small letters, digits and single underscores, a letter first; what else there is in the stem becomes underscores.
    Letters without a Latin counterpart are lost: there eight digits of a hash of the stem keep names apart.
    """
    plain = unicodedata.normalize("NFKD", stem.casefold())
    name = re.sub(r"[^a-z0-9]+", "_", plain.encode("ascii", "ignore").decode()).strip("_")
    if not name or not name[0].isalpha():
        name = f"dlo_{name}".strip("_")
    if any(not sign.isascii() and unicodedata.category(sign)[0] in _TELLING for sign in plain):
        # Composed or not, as file systems have it, a name is the same; undecodable bytes are lone surrogates.
        whole = unicodedata.normalize("NFC", stem).encode("utf-8", "surrogatepass")
        name = f"{name}_{hashlib.sha256(whole).hexdigest()[:8]}"
    return f"{name.removesuffix('_description')}_description"


def files(stem: str) -> tuple[str, ...]:
    """Names of the files in the package, with its folder before them."""
    package = package_name(stem)
    return tuple(
        f"{package}/{name}"
        for name in (
            "package.xml",
            "CMakeLists.txt",
            "launch/display.launch.py",
            "config/scanned_pose.yaml",
            "rviz/display.rviz",
            f"urdf/{package.removesuffix('_description')}.urdf",
        )
    )


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """A folder `stem_description`. Its URDF is the one that the format `urdf` writes."""
    from dlogen._version import __version__
    from dlogen.multibody.build import multibody

    package = package_name(stem)
    model = multibody(result, stem)
    contents = (
        _PACKAGE.format(
            package=package,
            segments=len(model.bodies),
            version=__version__,
            tf2_ros="\n  <exec_depend>tf2_ros</exec_depend>" if model.floating else "",
        ),
        _CMAKE.format(package=package),
        _LAUNCH.format(
            package=package,
            name=package.removesuffix("_description"),
            base=_base_publisher(model) if model.floating else "",
        ),
        _scanned_pose(model),
        _rviz(model, result.chain),
        urdf(model),
    )
    return {name: text.encode() for name, text in zip(files(stem), contents, strict=True)}


def _base_publisher(model: MultibodyModel) -> str:
    """A node that holds a floating base where it was scanned: robot_state_publisher leaves out floating joints."""
    from dlogen.geometry.rotations import quaternion
    from dlogen.io.xml_text import number

    values = [*model.scan.base_position, *quaternion(model.scan.base_rotation)]
    names = ("x", "y", "z", "qw", "qx", "qy", "qz")
    pairs = [(f"--{name}", number(value)) for name, value in zip(names, values, strict=True)]
    pairs += [("--frame-id", model.root), ("--child-frame-id", model.bodies[0].name)]
    lines = "".join(f'                    "{name}", {value!r},\n' for name, value in pairs)
    return _BASE.format(arguments=lines)


def _scanned_pose(model: MultibodyModel) -> str:
    """Parameters of joint_state_publisher: joint values that it starts from."""
    from dlogen.io.xml_text import number

    head = "# Joint values of the scanned pose, radians: where joint_state_publisher(_gui) starts.\n"
    values = [
        f"      {name}: {number(value)}" for name, value in zip(model.hinge_names, model.scanned.flat, strict=True)
    ]
    if not values:  # an empty map is no parameter
        return f"{head}/**:\n  ros__parameters: {{rate: 10}}\n"
    return "\n".join([f"{head}/**:", "  ros__parameters:", "    zeros:", *values, ""])


def _rviz(model: MultibodyModel, chain: Chain) -> str:
    """RViz on the model as scanned, from a little above."""
    import json

    low, high = chain.joints.min(axis=0), chain.joints.max(axis=0)
    x, y, z = (float(value) for value in 0.5 * (low + high))
    distance = 1.5 * float(((high - low) ** 2).sum() ** 0.5)
    return _RVIZ.format(
        root=json.dumps(model.root, ensure_ascii=False), x=x, y=y, z=z, distance=distance, cell=0.1 * distance
    )


_PACKAGE = """\
<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>A deformable linear object in {segments} segments, made from a scan by dlogen {version}</description>
  <!-- Put in who looks after it, and the licence that you give it. -->
  <maintainer email="maintainer@example.com">maintainer</maintainer>
  <license>Proprietary</license>

  <buildtool_depend>ament_cmake</buildtool_depend>

  <exec_depend>ament_index_python</exec_depend>
  <exec_depend>joint_state_publisher</exec_depend>
  <exec_depend>joint_state_publisher_gui</exec_depend>
  <exec_depend>launch</exec_depend>
  <exec_depend>launch_ros</exec_depend>
  <exec_depend>robot_state_publisher</exec_depend>
  <exec_depend>rviz2</exec_depend>{tf2_ros}

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({package} NONE)

find_package(ament_cmake REQUIRED)

install(DIRECTORY config launch rviz urdf DESTINATION share/${{PROJECT_NAME}})

ament_package()
"""

_LAUNCH = '''\
"""Show the model in RViz: ros2 launch {package} display.launch.py [gui:=false] [rviz:=false]."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description():
    share = Path(get_package_share_directory("{package}"))
    description = (share / "urdf" / "{name}.urdf").read_text(encoding="utf-8")
    scanned_pose = str(share / "config" / "scanned_pose.yaml")
    gui = LaunchConfiguration("gui")
    return LaunchDescription(
        [
            DeclareLaunchArgument("gui", default_value="true", description="sliders for the joints"),
            DeclareLaunchArgument("rviz", default_value="true", description="open RViz"),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{{"robot_description": ParameterValue(description, value_type=str)}}],
            ),
            Node(
                package="joint_state_publisher_gui",
                executable="joint_state_publisher_gui",
                parameters=[scanned_pose],
                condition=IfCondition(gui),
            ),
            Node(
                package="joint_state_publisher",
                executable="joint_state_publisher",
                parameters=[scanned_pose],
                condition=UnlessCondition(gui),
            ),
{base}            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", str(share / "rviz" / "display.rviz")],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
'''

_BASE = """\
            Node(
                package="tf2_ros",
                executable="static_transform_publisher",
                arguments=[
{arguments}                ],
            ),
"""

_RVIZ = """\
Panels:
  - Class: rviz_common/Displays
    Name: Displays
  - Class: rviz_common/Views
    Name: Views
Visualization Manager:
  Class: ""
  Displays:
    - Class: rviz_default_plugins/Grid
      Name: Grid
      Cell Size: {cell:.3g}
      Value: true
    - Class: rviz_default_plugins/RobotModel
      Name: RobotModel
      Description Source: Topic
      Description Topic:
        Depth: 5
        Durability Policy: Transient Local
        History Policy: Keep Last
        Reliability Policy: Reliable
        Value: /robot_description
      Visual Enabled: true
      Collision Enabled: false
      Value: true
    - Class: rviz_default_plugins/TF
      Name: TF
      Show Names: false
      Marker Scale: {cell:.3g}
      Enabled: false
      Value: false
  Global Options:
    Background Color: 48; 48; 48
    Fixed Frame: {root}
    Frame Rate: 30
  Tools:
    - Class: rviz_default_plugins/MoveCamera
    - Class: rviz_default_plugins/Measure
  Value: true
  Views:
    Current:
      Class: rviz_default_plugins/Orbit
      Name: Current View
      Distance: {distance:.4g}
      Focal Point:
        X: {x:.6g}
        Y: {y:.6g}
        Z: {z:.6g}
      Pitch: 0.6
      Yaw: 5.5
      Target Frame: <Fixed Frame>
      Value: Orbit (rviz)
Window Geometry:
  Height: 800
  Width: 1200
"""

FORMAT = ModelFormat(
    name="ros2",
    suffixes=("_description/",),
    description="ROS 2 package: the URDF with a launch file for robot_state_publisher and RViz",
    write=write,
    named=files,
)
