"""URDF of the multibody model: cylinders between joints, each joint a row of revolute joints in one place.

Names: `base_link` (the cloud's frame, without a body as KDL and ROS want it), `segment_01` .. `segment_n` (frames at
the joint they start from, x axis along the segment), `joint_01_y`, `joint_01_z` and with three degrees of freedom
`joint_01_x` with small links between them, `tip` at the end. The base is a fixed or a floating joint.

URDF has no springs. Stiffness and rest shape are in `<gazebo>` elements, which Gazebo's converter reads and others
pass over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dlogen.io.registry import ModelFormat
from dlogen.io.xml_text import HEADER, element, inertia, number, start

if TYPE_CHECKING:
    from dlogen.multibody.model import Body, Joint, MultibodyModel
    from dlogen.types import Array, FitData

#: Wide enough not to matter; URDF wants limits on revolute joints.
_EFFORT, _VELOCITY = 1000.0, 100.0

#: MuJoCo merges links behind fixed joints into their parents by default. A floating joint it accepts only so.
_KEEP_FRAMES = ('<mujoco><compiler fusestatic="false"/></mujoco>',)


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.urdf`."""
    from dlogen.multibody.build import multibody

    return {f"{stem}.urdf": urdf(multibody(result, stem)).encode()}


def urdf(model: MultibodyModel) -> str:
    """The text of the file."""
    small = _small_inertial(model)
    lines = [
        HEADER,
        start("robot", name=model.name),
        *([] if model.floating else _KEEP_FRAMES),
        element("link", name=model.root),
        *_joint(
            "base_joint",
            "floating" if model.floating else "fixed",
            model.root,
            model.bodies[0].name,
            model.base_position,
            model.base_rotation,
        ),
        *_segment(model.bodies[0]),
    ]
    for joint, body in zip(model.joints, model.bodies[1:], strict=True):
        lines += [*_hinges(joint, small), *_segment(body)]
    last = model.bodies[-1]
    lines += [*_joint("tip_joint", "fixed", last.name, model.tip, (last.length, 0.0, 0.0)), *_small(model.tip, small)]
    return "\n".join([*lines, "</robot>\n"])


def _segment(body: Body) -> Iterator[str]:
    begin, end, radius = body.collision
    yield start("link", name=body.name)
    yield "  " + element(
        "inertial",
        element("origin", xyz=(0.5 * body.length, 0.0, 0.0), rpy=(0.0, 0.0, 0.0))
        + element("mass", value=body.mass)
        + element("inertia", **inertia(body.axial_inertia, body.transverse_inertia)),
    )
    yield "  " + _cylinder("visual", 0.0, body.length, body.radius)
    yield "  " + _cylinder("collision", begin, end, radius)
    yield "</link>"


def _cylinder(tag: str, begin: float, end: float, radius: float) -> str:
    """From begin to end along x; those of URDF lie along z."""
    origin = element("origin", xyz=(0.5 * (begin + end), 0.0, 0.0), rpy=(0.0, 0.5 * math.pi, 0.0))
    return element(tag, origin + element("geometry", element("cylinder", radius=radius, length=end - begin)))


def _small_inertial(model: MultibodyModel) -> str:
    """Body of the links between stacked joints: a thousandth of the lightest segment, within bounds.

    Massless links blow solvers up, or are made 1 kg (PyBullet).
    """
    mass = min(max(1e-3 * min(body.mass for body in model.bodies), 1e-6), 1e-4)
    least = min(max(1e-3 * min(body.axial_inertia for body in model.bodies), 1e-12), 1e-8)
    return element("inertial", element("mass", value=mass) + element("inertia", **inertia(least, least)))


def _small(name: str, inertial: str) -> list[str]:
    return [start("link", name=name), f"  {inertial}", "</link>"]


def _hinges(joint: Joint, small: str) -> Iterator[str]:
    """The revolute joints of a joint, and the small links between them."""
    from dlogen.geometry.rotations import AXES

    parent, rotation = joint.parent, joint.rotation
    offset = (joint.offset, 0.0, 0.0)
    for k, (axis, name) in enumerate(zip(joint.axes, joint.hinge_names, strict=True)):
        last = k + 1 == len(joint.axes)
        child = joint.child if last else f"{name}_link"
        yield from _joint(
            name,
            "revolute",
            parent,
            child,
            offset if k == 0 else (0.0, 0.0, 0.0),
            rotation if k == 0 else None,
            element("axis", xyz=AXES[axis]),
            element("limit", lower=joint.lower[k], upper=joint.upper[k], effort=_EFFORT, velocity=_VELOCITY),
            element("dynamics", damping=joint.damping[k], friction=0.0),
        )
        if joint.stiffness is not None:
            spring = f"<springStiffness>{number(joint.stiffness[k])}</springStiffness>"
            spring += f"<springReference>{number(joint.rest[k])}</springReference>"
            yield element("gazebo", spring, reference=name)
        if not last:
            yield from _small(child, small)
        parent = child


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Array | tuple[float, float, float],
    rotation: Array | None = None,
    *more: str,
) -> list[str]:
    from dlogen.geometry.rotations import roll_pitch_yaw

    rpy = (0.0, 0.0, 0.0) if rotation is None else roll_pitch_yaw(rotation)
    parts = [
        element("parent", link=parent),
        element("child", link=child),
        element("origin", xyz=xyz, rpy=rpy),
        *more,
    ]
    return [start("joint", name=name, type=kind), *(f"  {part}" for part in parts), "</joint>"]


FORMAT = ModelFormat(
    name="urdf",
    suffixes=(".urdf",),
    description="URDF: cylinders, two or three revolute joints at each inner joint",
    write=write,
)
