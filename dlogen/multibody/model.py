"""The multibody model: the chain as bodies and joints with mass, stiffness and limits. Every format writes this.

n segments are n bodies in a row with n - 1 joints between them. The first and the last of the paper's n + 1 joints are
frames: the base, in which the first segment is held or floats, and the tip. The frame of a body is at the joint that it
starts from, its x axis along the segment.

Each joint is a row of hinges in one place: about y, then z, and with three degrees of freedom then about x. Two hinges
turn a segment into any direction. Unlike a ball joint they exist in every format, their values are the same in all
of them, bending and twist have springs of their own, and limits and rest shape do not depend on the zero pose. What
they cost: at a bend of 90 degrees in one joint about z the other two are parallel (gimbal lock).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dlogen.geometry.rotations import hinges
from dlogen.multibody.materials import Properties
from dlogen.types import Array, Pose
from dlogen.types.short_repr import ShortRepr

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Body:
    """A segment: a cylinder from its frame's origin along x.

    Attributes:
        name: `segment_01` ...
        length, radius: metres.
        mass: kg; its centre is in the middle.
        axial_inertia, transverse_inertia: about x, and about y or z through the centre, kg m^2.
        collision: (start, end, radius) of the cylinder that does not touch those of the neighbours, metres.
    """

    name: str
    length: float
    radius: float
    mass: float
    axial_inertia: float
    transverse_inertia: float
    collision: tuple[float, float, float]


@dataclass(frozen=True, eq=False, repr=False)
class Joint(ShortRepr):
    """A joint between two segments: hinges in one place, one after another. D is their number.

    Attributes:
        name: `joint_01` ..., at the paper's x_1 ...
        parent, child: names of the bodies.
        offset: distance from the parent's frame along its x axis, metres.
        rotation: (3, 3) of the child's frame in the parent's when all values are zero.
        axes: of the hinges, "y", "z", "x".
        scanned, straight, rest: (D,) values in the scanned pose, when straight, and without load, radians.
        lower, upper: (D,) limits, radians; +-pi where none are known.
        bend_limit: largest angle between the two segments, radians; None where it is not known.
        stiffness: (D,) N m/rad; None where no modulus is known.
        damping: (D,) N m s/rad.
    """

    name: str
    parent: str
    child: str
    offset: float
    rotation: Array
    axes: tuple[str, ...]
    scanned: Array
    straight: Array
    rest: Array
    lower: Array
    upper: Array
    bend_limit: float | None
    stiffness: Array | None
    damping: Array

    @property
    def hinge_names(self) -> tuple[str, ...]:
        """`joint_01_y`, ..."""
        return tuple(f"{self.name}_{axis}" for axis in self.axes)


@dataclass(frozen=True, eq=False, repr=False)
class MultibodyModel(ShortRepr):
    """Bodies and joints in a row.

    Attributes:
        name: of the model.
        root: name of the frame that the base is placed in (`frame.name`).
        tip: name of the frame at the end of the last body.
        floating: whether the first body moves freely in the root frame.
        base_position, base_rotation: (3,) metres, (3, 3): pose of the first body in the root frame. Of a model that
            was seen in several poses, the root frame itself: there the values of a floating base are the pose.
        bodies: n.
        joints: n - 1.
        dof: hinges in a joint.
        zero, rest: what the settings say: "scan" or "straight".
        material: properties of the whole object.
        poses: those of a recording, then "scanned" and "straight".

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> model = result.model
    >>> len(model.bodies), len(model.joints), model.hinge_names[:2]
    (10, 9, ('joint_01_y', 'joint_01_z'))
    >>> model.frames(model.straight).shape
    (10, 4, 4)
    """

    name: str
    root: str
    tip: str
    floating: bool
    base_position: Array
    base_rotation: Array
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    dof: int
    zero: str
    rest: str
    material: Properties
    poses: tuple[Pose, ...]

    @property
    def hinge_names(self) -> tuple[str, ...]:
        """Of all joints in a row, in the order of the values."""
        return tuple(name for joint in self.joints for name in joint.hinge_names)

    @property
    def scan(self) -> Pose:
        """The scanned pose."""
        return self.poses[-2]

    @property
    def scanned(self) -> Array:
        """(n - 1, dof) joint values of the scanned pose."""
        return self._values([joint.scanned for joint in self.joints])

    @property
    def straight(self) -> Array:
        """(n - 1, dof) joint values of the straight pose."""
        return self._values([joint.straight for joint in self.joints])

    def _values(self, rows: list[Array]) -> Array:
        return np.array(rows, dtype=float).reshape(len(rows), self.dof)

    def frames(self, values: Array | None = None) -> Array:
        """Forward kinematics.

        Args:
            values: (n - 1, dof) joint values, radians; zero if left out.

        Returns:
            (n, 4, 4) frames of the bodies in the root frame.
        """
        values = np.zeros((len(self.joints), self.dof)) if values is None else values
        out = np.zeros((len(self.bodies), 4, 4))
        out[:, 3, 3] = 1.0
        rotation, position = self.base_rotation, self.base_position
        for i in range(len(self.bodies)):
            if i:
                joint = self.joints[i - 1]
                position = position + joint.offset * rotation[:, 0]
                rotation = rotation @ joint.rotation @ hinges(joint.axes, values[i - 1])
            out[i, :3, :3], out[i, :3, 3] = rotation, position
        return out

    def joint_positions(self, values: Array | None = None) -> Array:
        """(n + 1, 3) the paper's x_0 .. x_n at these joint values, metres in the root frame."""
        frames = self.frames(values)
        end = frames[-1, :3, 3] + self.bodies[-1].length * frames[-1, :3, 0]
        return np.vstack([frames[:, :3, 3], end])

    def close_pairs(self) -> list[tuple[int, int]]:
        """Bodies that belong to the same bend: neighbours, and those less than pi r apart along the object.

        A tube cannot touch itself within half a turn of its tightest bend, of radius r. What simulators would take for
        contact there is the overlap of the segments at the inside of a bend.
        """
        ends = np.cumsum([body.length for body in self.bodies])
        last = np.searchsorted(ends, ends + math.pi * self.material.radius, side="right")
        last = np.maximum(last, np.arange(len(ends)) + 1)
        return [(i, j) for i in range(len(ends)) for j in range(i + 1, min(int(last[i]), len(ends) - 1) + 1)]


def forward_kinematics(model: MultibodyModel, values: npt.ArrayLike | None = None) -> Array:
    """Positions of the joints at given joint values.

    Args:
        model: of a result or a loaded chain (`result.model`).
        values: (n - 1, dof) joint values, radians; zero if left out, which is the scanned pose unless `joints.zero`
            says otherwise.

    Returns:
        (n + 1, 3) the paper's x_0 .. x_n, metres, in the root frame. `MultibodyModel.frames` gives the bodies' poses.

    Raises:
        ValueError: another number of values.

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> joints = dlogen.forward_kinematics(result.model)
    >>> bool(abs(joints - result.chain.joints).max() < 1e-9)
    True
    """
    shape = (len(model.joints), model.dof)
    if values is None:
        return model.joint_positions()
    given = np.asarray(values, dtype=float)
    if given.shape != shape:
        raise ValueError(f"joint values of the shape {given.shape}, where {shape} are due")
    return model.joint_positions(given)
