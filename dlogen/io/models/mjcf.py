"""MJCF of the multibody model for MuJoCo: nested bodies, hinges with springs, capsules, a keyframe for each pose.

Joints are hinges, not ball joints: a ball joint of MuJoCo has one stiffness for bending and twist, its spring is
relaxed at the zero pose whatever the rest shape is, and it cannot be limited about another pose.

The last segment may be very short. MuJoCo stops at accelerations beyond 1e10 rad/s^2, and when a stiff object is let go
in a bent pose, a tip of a millimetre is faster than that. So the hinges of the last segment have an armature where it
is needed to make it as inert as half of the segment before. Poses and forces at rest stay as they are.

Keyframes are the frames of a recording, if there is one, then `scanned` and `straight`. Without one, MuJoCo starts in
the zero pose of the settings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dlogen.errors import FitError
from dlogen.io.registry import ModelFormat
from dlogen.io.xml_text import HEADER, element, numbers, start

if TYPE_CHECKING:
    from dlogen.multibody.model import Body, Joint, MultibodyModel
    from dlogen.types import FitData, Pose

#: A chain nests bodies, and the XML reader of MuJoCo stops at 500 levels (measured with 4.0).
MOST_SEGMENTS = 496

#: MuJoCo's default time step, seconds.
_TIME_STEP = 0.002

#: Length of the segment that the last one is at least as inert as, over that of the segment before.
_LEAST_INERT = 0.5

#: Longest step over the relaxation time of the joints; 2 is where oscillations begin to grow.
_OF_DAMPING = 1.4


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.xml`."""
    from dlogen.multibody.build import multibody

    return {f"{stem}.xml": mjcf(multibody(result, stem)).encode()}


def mjcf(model: MultibodyModel) -> str:
    """The text of the file.

    Raises:
        FitError: it has more segments than MuJoCo can read.
    """
    if len(model.bodies) > MOST_SEGMENTS:
        raise FitError(
            f"{len(model.bodies)} segments: MuJoCo reads bodies that are nested {MOST_SEGMENTS} deep at most",
            "a larger e_max makes fewer segments; URDF and SDF have no such bound",
            stage="mjcf",
        )
    joints = (None, *model.joints)
    return "\n".join(
        [
            HEADER,
            start("mujoco", model=model.name),
            '  <compiler angle="radian" autolimits="true"/>',
            *_option(model),
            "  <worldbody>",
            "    " + element("site", name=model.root, size=(0.5 * model.material.radius,), group="4"),
            *(line for body, joint in zip(model.bodies, joints, strict=True) for line in _body(model, body, joint)),
            "    "
            + element(
                "site",
                name=model.tip,
                pos=(model.bodies[-1].length, 0.0, 0.0),
                size=(0.5 * model.material.radius,),
                group="4",
            ),
            "    " + "</body>" * len(model.bodies),
            "  </worldbody>",
            "  <contact>",
            *(
                "    " + element("exclude", body1=model.bodies[i].name, body2=model.bodies[j].name)
                for i, j in model.close_pairs()
            ),
            "  </contact>",
            "  <keyframe>",
            *("    " + _key(model, pose) for pose in model.poses),
            "  </keyframe>",
            "</mujoco>\n",
        ]
    )


def _option(model: MultibodyModel) -> list[str]:
    """The time step, where MuJoCo's default of 2 ms is too long for the springs.

    MuJoCo's Euler integrators treat damping implicitly and springs explicitly. With the stiffness k, the damping beta k
    and the inertia I of one oscillator they are stable for h^2 k / I < 4 + 2 h beta k / I, so certainly for h < 2 beta,
    and without damping for h < 2 / omega. The frequency of every mode is at most 2 sqrt(k / I), with the inertia of a
    single segment about its centre: the other segments only add to it.
    """
    if not model.joints or model.joints[0].stiffness is None:
        return []
    stiffest = max(float(joint.stiffness[0]) for joint in model.joints if joint.stiffness is not None)
    omega = 2.0 * math.sqrt(stiffest / min(body.transverse_inertia for body in model.bodies))
    if model.dof == 3:
        twist = max(float(joint.stiffness[2]) for joint in model.joints if joint.stiffness is not None)
        omega = max(omega, 2.0 * math.sqrt(twist / min(body.axial_inertia for body in model.bodies)))
    beta = float(model.joints[0].damping[0] / model.joints[0].stiffness[0])
    longest = max(_OF_DAMPING * beta, 1.0 / omega)
    return [] if longest >= _TIME_STEP else ["  " + element("option", timestep=longest)]


def _body(model: MultibodyModel, body: Body, joint: Joint | None) -> Iterator[str]:
    """A segment, left open for the next one inside it; indented alike, since MJCF nests them."""
    from dlogen.geometry.rotations import AXES, quaternion

    position = model.base_position if joint is None else (joint.offset, 0.0, 0.0)
    rotation = model.base_rotation if joint is None else joint.rotation
    yield "    " + start("body", name=body.name, pos=position, quat=quaternion(rotation))
    if joint is None and model.floating:
        yield "      " + element("freejoint", name="base_joint")
    if joint is not None:
        for k, (axis, name) in enumerate(zip(joint.axes, joint.hinge_names, strict=True)):
            more: dict[str, float | tuple[float, float]] = {}
            if joint.bend_limit is not None and axis != "x":
                more["range"] = (joint.lower[k], joint.upper[k])
            if joint.stiffness is not None:
                more |= {"stiffness": joint.stiffness[k], "springref": joint.rest[k]}
            more["damping"] = joint.damping[k]
            if joint is model.joints[-1] and (armature := _armature(model)[axis == "x"]) > 0.0:
                more["armature"] = armature
            yield "      " + element("joint", name=name, type="hinge", axis=AXES[axis], **more)
    yield "      " + element(
        "inertial",
        pos=(0.5 * body.length, 0.0, 0.0),
        mass=body.mass,
        diaginertia=(body.axial_inertia, body.transverse_inertia, body.transverse_inertia),
    )
    # A capsule as long as the segment; where that is shorter than thick, about a ball.
    inset = min(body.radius, 0.49 * body.length)
    yield "      " + element(
        "geom", type="capsule", size=(body.radius,), fromto=(inset, 0.0, 0.0, body.length - inset, 0.0, 0.0)
    )


def _armature(model: MultibodyModel) -> tuple[float, float]:
    """What the last segment lacks in inertia about the axes across and along its joint, kg m^2."""
    if model.joints[-1].stiffness is None:
        return 0.0, 0.0
    before, last = model.bodies[-2:]
    mass, length = _LEAST_INERT * before.mass, _LEAST_INERT * before.length
    # About the joint, which is at the segment's end: m (r^2 + r_i^2) / 4 + m l^2 / 3.
    across = 0.5 * _LEAST_INERT * before.axial_inertia + mass * length**2 / 3.0
    own = 0.5 * last.axial_inertia + last.mass * last.length**2 / 3.0
    return max(0.0, across - own), max(0.0, _LEAST_INERT * before.axial_inertia - last.axial_inertia)


def _key(model: MultibodyModel, pose: Pose) -> str:
    from dlogen.geometry.rotations import quaternion

    base = (*pose.base_position, *quaternion(pose.base_rotation)) if model.floating else ()
    time = {} if pose.time is None else {"time": pose.time}
    return element("key", name=pose.name, **time, qpos=numbers((*base, *pose.values.ravel())))


FORMAT = ModelFormat(
    name="mjcf",
    suffixes=(".xml",),
    description="MJCF (MuJoCo): capsules, hinges with springs and damping, keyframes scanned and straight",
    write=write,
)
