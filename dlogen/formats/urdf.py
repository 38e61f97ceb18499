"""URDF of the chain: cylinders between joints, two revolute joints at each inner joint, zero pose = scanned pose.

Names: `base_link` (the cloud's frame), `segment_01` .. `segment_n` (frames at the joint they start from, x axis along
the segment), `joint_01_y` and `joint_01_z` at the paper's x_1 .. x_(n-1) with a small link between them, `tip` at x_n.
"""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np

from dlogen.formats import ModelFormat

if TYPE_CHECKING:
    from dlogen.model import Array, Result

#: The link between two stacked revolute joints, and the tip. Massless links blow solvers up or are made 1 kg; this
#: much is neither felt nor singular.
_SMALL_MASS = 1e-5
_SMALL_INERTIA = 1e-9

#: Wide enough for any pose; URDF wants limits on revolute joints.
_LIMIT = '<limit lower="-3.141592653589793" upper="3.141592653589793" effort="1000" velocity="100"/>'


def write(result: Result, stem: str) -> dict[str, bytes]:
    """One file, `stem.urdf`."""
    chain = result.chain
    count = len(chain.lengths)
    digits = max(2, len(str(count)))
    density = result.settings["material"]["density"]
    name = [f"segment_{i + 1:0{digits}d}" for i in range(count)]
    out = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f'<robot name="{html.escape(stem)}">',
        "  <!-- MuJoCo would merge base_link and tip into their neighbours and write their frames off. -->",
        '  <mujoco><compiler fusestatic="false"/></mujoco>',
        '  <link name="base_link"/>',
        *_joint("base_joint", "fixed", "base_link", name[0], chain.joints[0], chain.transforms[0, :3, :3]),
    ]
    for i in range(count):
        length = float(chain.lengths[i])
        out += _segment(name[i], length, chain.radius, density)
        if i + 1 < count:
            joint = f"joint_{i + 1:0{digits}d}"
            relative = chain.transforms[i, :3, :3].T @ chain.transforms[i + 1, :3, :3]
            at = np.array([length, 0.0, 0.0])
            out += _joint(f"{joint}_y", "revolute", name[i], f"{joint}_link", at, relative, axis="0 1 0")
            out += _small_link(f"{joint}_link")
            out += _joint(
                f"{joint}_z", "revolute", f"{joint}_link", name[i + 1], np.zeros(3), np.eye(3), axis="0 0 1"
            )
    out += _joint("tip_joint", "fixed", name[-1], "tip", np.array([float(chain.lengths[-1]), 0, 0]), np.eye(3))
    out += [*_small_link("tip"), "</robot>", ""]
    return {f"{stem}.urdf": "\n".join(out).encode()}


def _segment(name: str, length: float, radius: float, density: float) -> list[str]:
    mass = density * math.pi * radius**2 * length
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    # The cylinders of neighbours would touch where they meet: the collision body leaves room for the bend.
    clear = length - 2.0 * min(radius, length / 4.0)
    pose = f'<origin xyz="{_number(length / 2)} 0 0" rpy="0 {_number(math.pi / 2)} 0"/>'
    body = '<geometry><cylinder radius="{}" length="{}"/></geometry>'
    return [
        f'  <link name="{name}">',
        "    <inertial>",
        f'      <origin xyz="{_number(length / 2)} 0 0" rpy="0 0 0"/>',
        f'      <mass value="{_number(mass)}"/>',
        f'      <inertia ixx="{_number(mass * radius**2 / 2)}" ixy="0" ixz="0" '
        f'iyy="{_number(across)}" iyz="0" izz="{_number(across)}"/>',
        "    </inertial>",
        f"    <visual>{pose}{body.format(_number(radius), _number(length))}</visual>",
        f"    <collision>{pose}{body.format(_number(radius), _number(clear))}</collision>",
        "  </link>",
    ]


def _small_link(name: str) -> list[str]:
    i = _number(_SMALL_INERTIA)
    return [
        f'  <link name="{name}">',
        f'    <inertial><mass value="{_number(_SMALL_MASS)}"/>'
        f'<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>',
        "  </link>",
    ]


def _joint(
    name: str, kind: str, parent: str, child: str, xyz: Array, rotation: Array, axis: str | None = None
) -> list[str]:
    origin = " ".join(_number(value) for value in xyz)
    rpy = " ".join(_number(value) for value in roll_pitch_yaw(rotation))
    lines = [
        f'  <joint name="{name}" type="{kind}">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{child}"/>',
        f'    <origin xyz="{origin}" rpy="{rpy}"/>',
    ]
    if axis is not None:
        lines += [f'    <axis xyz="{axis}"/>', f"    {_LIMIT}"]
    return [*lines, "  </joint>"]


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles about the fixed axes x, y, z, as URDF has them: R = Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        rotation: (3, 3) rotation matrix.
    """
    across = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], across)
    if across > 1e-9:
        return (
            math.atan2(rotation[2, 1], rotation[2, 2]),
            pitch,
            math.atan2(rotation[1, 0], rotation[0, 0]),
        )
    # Looking straight up or down only the sum of roll and yaw matters.
    return math.atan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0


def _number(value: float) -> str:
    """Shortest text that reads back as the same number; no minus before a zero."""
    return repr(float(value) + 0.0)


FORMAT = ModelFormat(
    name="urdf",
    suffixes=(".urdf",),
    description="URDF: cylinders, two revolute joints at each inner joint, zero pose = scanned pose",
    write=write,
)
