"""SDFormat 1.7 of the multibody model, for Gazebo and Drake: universal joints (bend) or ball joints (bend and twist).

Links are at the zero pose of the settings; SDFormat models have no initial joint values. A universal joint is Ry(a)
Rz(b) as in the other formats, with limits, springs and damping. A ball joint has no axes in SDFormat, hence none of
them: use `joints.dof: 2` where stiffness matters. The base is fixed to the world, or free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dlogen.io.registry import ModelFormat
from dlogen.io.xml_text import HEADER, element, inertia, number, numbers, start

if TYPE_CHECKING:
    from dlogen.multibody.model import Body, Joint, MultibodyModel
    from dlogen.types import Array, FitData


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.sdf`."""
    from dlogen.multibody.build import multibody

    return {f"{stem}.sdf": sdf(multibody(result, stem)).encode()}


def sdf(model: MultibodyModel) -> str:
    """The text of the file."""
    first, last = model.bodies[0], model.bodies[-1]
    base = _pose(model.base_position, model.base_rotation)
    lines = [HEADER, start("sdf", version="1.7"), start("model", name=_name(model.name))]
    if model.root != "world":  # SDFormat has that one already
        lines.append(element("frame", element("pose", _ZERO), name=model.root))
    if not model.floating:
        lines.append(
            element("joint", "<parent>world</parent>" + element("child", first.name), name="base_joint", type="fixed")
        )
    lines += _link(first, base)
    for joint, body in zip(model.joints, model.bodies[1:], strict=True):
        lines += _joint(joint)
        lines += _link(body, element("pose", _ZERO, relative_to=joint.name))
    tip = element("pose", numbers((last.length, 0.0, 0.0, 0.0, 0.0, 0.0)))
    lines += [element("frame", tip, name=model.tip, attached_to=last.name), "</model>", "</sdf>\n"]
    return "\n".join(lines)


_ZERO = numbers([0.0] * 6)


def _name(text: str) -> str:
    """Reserved in SDFormat: "::" between scopes, two underscores at both ends."""
    text = text.replace("::", "_")
    return text.strip("_") or "model" if text.startswith("__") and text.endswith("__") else text


def _pose(position: Array | tuple[float, float, float], rotation: Array, relative_to: str | None = None) -> str:
    from dlogen.geometry.rotations import roll_pitch_yaw

    text = numbers((*position, *roll_pitch_yaw(rotation)))
    return element("pose", text) if relative_to is None else element("pose", text, relative_to=relative_to)


def _link(body: Body, pose: str) -> Iterator[str]:
    begin, end, radius = body.collision
    entries = inertia(body.axial_inertia, body.transverse_inertia)
    yield start("link", name=body.name)
    yield f"  {pose}"
    yield "  " + element(
        "inertial",
        element("pose", numbers((0.5 * body.length, 0.0, 0.0, 0.0, 0.0, 0.0)))
        + element("mass", number(body.mass))
        + element("inertia", "".join(element(name, number(value)) for name, value in entries.items())),
    )
    yield "  " + _cylinder("visual", 0.0, body.length, body.radius)
    yield "  " + _cylinder("collision", begin, end, radius)
    yield "</link>"


def _cylinder(tag: str, begin: float, end: float, radius: float) -> str:
    """From begin to end along x; those of SDFormat lie along z."""
    shape = element("radius", number(radius)) + element("length", number(end - begin))
    pose = element("pose", numbers((0.5 * (begin + end), 0.0, 0.0, 0.0, 0.5 * math.pi, 0.0)))
    return element(tag, pose + element("geometry", element("cylinder", shape)), name=tag)


def _joint(joint: Joint) -> Iterator[str]:
    from dlogen.geometry.rotations import AXES

    universal = len(joint.axes) == 2
    yield start("joint", name=joint.name, type="universal" if universal else "ball")
    yield "  " + _pose((joint.offset, 0.0, 0.0), joint.rotation, joint.parent)
    yield "  " + element("parent", joint.parent)
    yield "  " + element("child", joint.child)
    if universal:
        for k, tag in enumerate(("axis", "axis2")):
            limit = element("lower", number(joint.lower[k])) + element("upper", number(joint.upper[k]))
            # Nothing drives the joint; without this, Drake looks for an actuator.
            limit += element("effort", number(0.0))
            dynamics = element("damping", number(joint.damping[k]))
            if joint.stiffness is not None:
                dynamics += element("spring_reference", number(joint.rest[k]))
                dynamics += element("spring_stiffness", number(joint.stiffness[k]))
            yield "  " + element(
                tag,
                element("xyz", numbers(AXES[joint.axes[k]])) + element("limit", limit) + element("dynamics", dynamics),
            )
    yield "</joint>"


FORMAT = ModelFormat(
    name="sdf",
    suffixes=(".sdf",),
    description="SDFormat 1.7 (Gazebo, Drake): universal or ball joints, springs and damping",
    write=write,
)
