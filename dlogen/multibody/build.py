"""From a chain to its multibody model: bodies, joints, springs, limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dlogen.config.defaults import ROOT_LINK
from dlogen.config.fields import AUTO
from dlogen.config.sections import JointSettings, Material
from dlogen.errors import ConfigError
from dlogen.geometry.rotations import bend_and_twist_angles, bend_angles, hinges
from dlogen.geometry.vectors import dots
from dlogen.multibody.materials import Properties, properties
from dlogen.multibody.model import Body, Joint, MultibodyModel
from dlogen.types import Array, Chain, Pose

if TYPE_CHECKING:
    from dlogen.types import FitData


def multibody(result: FitData, name: str | None = None) -> MultibodyModel:
    """The model of what a fit made, with the settings that it was made with.

    Args:
        result: of a fit.
        name: of the model; that of the result by default.

    Raises:
        ConfigError: the settings do not fit the chain.
    """
    config = result.config
    return build_model(
        result.chain,
        config.joints,
        config.material,
        name=name or result.name,
        recorded=result.recorded,
        root=ROOT_LINK if config.frame.name == AUTO else result.frame.name,
    )


def build_model(
    chain: Chain,
    joints: JointSettings,
    material: Material,
    *,
    name: str = "cable",
    root: str = ROOT_LINK,
    recorded: tuple[Pose, ...] = (),
) -> MultibodyModel:
    """Bodies and joints of a chain (paper Eq. 1-2).

    Mass and inertia are those of cylinders. The stiffness of a joint is E I / l and G J / l (Linn et al. 2013, Discrete
    Cosserat rods; as in Bergou et al. 2008, Discrete elastic rods), where l is the length whose bending it stands for:
    half of each adjoining segment, and of the first and the last segment all, as they have no other joint. So the
    lengths add up to that of the object, and under a constant moment both turn by the same angle.

    The sag of a cantilever then falls short by about 4.5 / n^2 for small loads, since the joint that stands for the
    first 1.5 l is at l: 1.2 % with 20 segments, 2.5 % for soft ones that hang down (against the elastica). With l alone
    it would be 2 / n, the half segment at the clamp that bends most left out. The zero pose matters to the same order:
    straightened from a scan that is bent by an angle b at a joint, its first hinge is stiffer by 1 / cos^2(b).

    A minimum bending radius R allows asin(l_i / 2R) + asin(l_(i+1) / 2R) between two segments: the angle between two
    chords of a circle.

    Args:
        chain: the kinematic chain.
        joints: what the joints are like.
        material: what the object is made of.
        name: of the model.
        root: name of the frame that the chain is given in.
        recorded: poses of a recording; the limits of the joints allow them.

    Raises:
        ConfigError: the settings do not fit the chain.
    """
    props = properties(material, chain.radius, chain.length)
    count = len(chain.lengths)
    lengths = [float(length) for length in chain.lengths]
    digits = max(2, len(str(count)))
    names = [f"segment_{i + 1:0{digits}d}" for i in range(count)]
    rotations = chain.transforms[:, :3, :3]
    tangents = rotations[:, :, 0]
    axes = ("y", "z", "x")[: joints.dof]
    stiffness = _stiffness_times_length(props, joints.dof)
    damping = np.array([props.bending_damping, props.bending_damping, props.torsional_damping][: joints.dof])
    bends = np.arctan2(
        np.linalg.norm(np.cross(tangents[:-1], tangents[1:]), axis=1),
        dots(tangents[:-1], tangents[1:]),
    )
    bend_limits = _bend_limits(joints.min_bend_radius, lengths, bends)

    made = []
    # Frame of the segment before the joint in the scanned pose. It differs from the chain's by a turn about the
    # segment where two hinges have to reach a straight zero pose: they choose the twist.
    frame = rotations[0]
    for i in range(count - 1):
        if joints.zero == "scan":
            rotation, scanned = rotations[i].T @ rotations[i + 1], np.zeros(joints.dof)
            straight = _values(rotation.T, joints.dof)
        else:
            rotation, straight = np.eye(3), np.zeros(joints.dof)
            scanned = _values(frame.T @ rotations[i + 1], joints.dof)
            frame = frame @ hinges(axes, scanned)
        joint_name = f"joint_{i + 1:0{digits}d}"
        bend_limit = bend_limits[i]
        reach, middle = np.full(joints.dof, math.pi), np.zeros(joints.dof)
        if bend_limit is not None and bend_limit < 0.5 * math.pi:
            # Beyond, the hinge about y may turn by more than the bend.
            reach[:2], middle[:2] = bend_limit, straight[:2]
        # Neither rounding nor a recording must put a pose outside that was seen.
        seen = np.array([scanned, *(pose.values[i] for pose in recorded)])
        lower, upper = np.minimum(middle - reach, seen.min(axis=0)), np.maximum(middle + reach, seen.max(axis=0))
        span = _span(lengths, i)
        made.append(
            Joint(
                name=joint_name,
                parent=names[i],
                child=names[i + 1],
                offset=lengths[i],
                rotation=rotation,
                axes=axes,
                scanned=scanned,
                straight=straight,
                rest=straight if joints.rest == "straight" else scanned,
                lower=lower,
                upper=upper,
                bend_limit=bend_limit,
                stiffness=None if stiffness is None else stiffness / span,
                damping=damping / span,
            )
        )
    half = np.concatenate([[0.0], 0.5 * bends, [0.0]])
    bodies = [_body(names[i], lengths[i], props, float(half[i]), float(half[i + 1])) for i in range(count)]
    base = chain.joints[0], rotations[0]
    own = [
        Pose(pose, *base, np.array([getattr(joint, pose) for joint in made]).reshape(len(made), joints.dof))
        for pose in ("scanned", "straight")
    ]
    return MultibodyModel(
        name=name,
        root=root,
        tip="tip",
        floating=joints.base == "floating",
        base_position=np.zeros(3) if recorded else base[0],
        base_rotation=np.eye(3) if recorded else base[1],
        bodies=tuple(bodies),
        joints=tuple(made),
        dof=joints.dof,
        zero=joints.zero,
        rest=joints.rest,
        material=props,
        poses=(*recorded, *own),
    )


def _values(rotation: Array, dof: int) -> Array:
    """Hinge values that turn x as the rotation does; with three hinges, that are the rotation."""
    return np.array(bend_angles(rotation[:, 0]) if dof == 2 else bend_and_twist_angles(rotation))


def _span(lengths: list[float], i: int) -> float:
    """Length whose bending the joint behind segment i stands for, metres."""
    before = lengths[i] if i == 0 else 0.5 * lengths[i]
    after = lengths[i + 1] if i + 2 == len(lengths) else 0.5 * lengths[i + 1]
    return before + after


def _stiffness_times_length(props: Properties, dof: int) -> Array | None:
    """(dof,) E I, E I, G J in N m^2; None unless all that are needed are known."""
    bending, torsion = props.bending_stiffness, props.torsional_stiffness
    if bending is None or (dof == 3 and torsion is None):
        return None
    return np.array([bending, bending, torsion or 0.0][:dof])


def _bend_limits(radius: float | str, lengths: list[float], bends: Array) -> list[float | None]:
    """Largest angle at each joint, by the chords of a circle of the smallest radius; None where that is not known."""
    if isinstance(radius, str):
        return [None] * len(bends)
    half = np.arcsin(np.minimum(1.0, np.array(lengths) / (2.0 * radius)))
    limits = half[:-1] + half[1:]
    if np.any(bends > limits * (1.0 + 1e-9)):
        radii = 0.25 * np.add(lengths[:-1], lengths[1:]) / np.sin(0.5 * np.maximum(bends, 1e-12))
        worst = int(np.argmin(radii))
        raise ConfigError(
            f"joints.min_bend_radius = {radius:g} m, but the scan is bent to {radii[worst]:.4g} m at joint {worst + 1}",
            f"set it to {0.95 * radii[worst]:.2g} or less, or leave it at auto",
        )
    return [float(limit) for limit in limits]


def _body(name: str, length: float, props: Properties, half_before: float, half_after: float) -> Body:
    """A segment between two joints that are bent by these half angles in the scan."""
    mass = props.mass_per_length * length
    squares = props.radius**2 + props.inner_radius**2
    return Body(
        name=name,
        length=length,
        radius=props.radius,
        mass=mass,
        axial_inertia=0.5 * mass * squares,
        transverse_inertia=mass * (3.0 * squares + length**2) / 12.0,
        collision=_collision(length, props.radius, half_before, half_after),
    )


def _collision(length: float, radius: float, half_before: float, half_after: float) -> tuple[float, float, float]:
    """A cylinder clear of its neighbours: between the planes that halve the bends at its ends, and some.

    It stays behind by as much as the plane cuts into it, r tan(bend / 2), or by r or a quarter of the segment if that
    is more. Where bends are too tight for that it gets thinner: it stays on its side of their centre.
    """
    cuts = [math.tan(min(half, 1.5)) for half in (half_before, half_after)]
    sharper = max(cuts)
    radius = min(radius, 0.4 * length / sharper) if sharper > 0.0 else radius
    room = min(radius, 0.25 * length)
    before, after = (max(room, 1.05 * radius * cut) for cut in cuts)
    if before + after > 0.9 * length:
        before, after = (1.05 * radius * cut + 0.01 * length for cut in cuts)
    return before, length - after, radius
