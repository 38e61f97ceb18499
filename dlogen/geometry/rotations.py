"""Rotations: hinges about the axes of a segment, angles and quaternions as the formats write them, smallest ones.

By hand, not by `scipy.spatial.transform.Rotation`: that takes 3 to 25 times as long for one rotation (60 microseconds
for roll, pitch and yaw, 14 for a hinge; here 2 and 2), and models have thousands. It rounds in another order, too: a
third of the quaternions and nearly all angles differ in their last digits, which the files have. The tests compare the
two.
"""

from __future__ import annotations

import math

import numpy as np

from dlogen.geometry.vectors import dots, normals_to
from dlogen.types import Array

#: Unit vectors of the hinge axes, in the frame that a joint turns.
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def hinge(axis: str, angle: float) -> Array:
    """Rotation about one of the axes x, y, z: (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = c
    rotation[k, j], rotation[j, k] = s, -s
    return rotation


def hinges(axes: tuple[str, ...], angles: Array) -> Array:
    """Rotation by hinges one after another, each about an axis that the ones before have turned: (3, 3)."""
    rotation = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        rotation = rotation @ hinge(axis, float(angle))
    return rotation


def bend_angles(direction: Array) -> tuple[float, float]:
    """Angles a, b for which Ry(a) Rz(b) turns the x axis into a unit vector (3,), with b in [-pi/2, pi/2].

    Ry(a) Rz(b) x = (cos a cos b, sin b, -sin a cos b).
    """
    x, y, z = (float(value) for value in direction)
    return math.atan2(-z, x), math.atan2(y, math.hypot(x, z))


def bend_and_twist_angles(rotation: Array) -> tuple[float, float, float]:
    """Angles a, b, c for which Ry(a) Rz(b) Rx(c) is the rotation (3, 3)."""
    a, b = bend_angles(rotation[:, 0])
    twist = (hinge("y", a) @ hinge("z", b)).T @ rotation
    return a, b, math.atan2(twist[2, 1], twist[1, 1])


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles about the fixed axes x, y, z, as URDF and SDF have them: R = Rz(yaw) Ry(pitch) Rx(roll).

    Exact at a pitch of 90 degrees as well, where only the sum of roll and yaw matters.

    Args:
        rotation: (3, 3) rotation matrix.
    """
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    c, s = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(s * rotation[0, 2] - c * rotation[1, 2], c * rotation[1, 1] - s * rotation[0, 1])
    return roll, pitch, yaw


def from_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Array:
    """The rotation of these angles, radians: R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def smallest_rotations(start: Array, end: Array) -> Array:
    """Rotations about a common normal that take unit vectors to others: (K, 3), (K, 3) -> (K, 3, 3).

    Rodrigues' formula, I + [v] + [v]^2 / (1 + c) with v = a x b and c = a . b. Of opposite vectors, half a turn about
    any normal.
    """
    v, c = np.cross(start, end), dots(start, end)
    cross = np.zeros((len(start), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = v
    cross[:, [1, 2, 0], [2, 0, 1]] = -v
    out = np.eye(3) + cross + cross @ cross / np.maximum(1.0 + c, 1e-12)[:, None, None]
    opposite = np.flatnonzero(c < -1.0 + 1e-9)
    normals = normals_to(start[opposite])
    out[opposite] = 2.0 * normals[:, :, None] * normals[:, None, :] - np.eye(3)
    return out


def quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """Unit quaternion w, x, y, z of a rotation matrix (3, 3), w >= 0 (Shepperd 1978: the largest part first)."""
    trace = float(np.trace(rotation))
    parts = np.array([trace, *np.diag(rotation)])
    k = int(np.argmax(parts))
    q = np.empty(4)
    if k == 0:
        q[0] = 1.0 + trace
        q[1:] = [rotation[(i + 2) % 3, (i + 1) % 3] - rotation[(i + 1) % 3, (i + 2) % 3] for i in range(3)]
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        q[0] = rotation[m, j] - rotation[j, m]
        q[1 + i] = 1.0 + 2.0 * rotation[i, i] - trace
        q[1 + j] = rotation[j, i] + rotation[i, j]
        q[1 + m] = rotation[m, i] + rotation[i, m]
    q /= np.linalg.norm(q) * (-1.0 if q[0] < 0.0 else 1.0)
    w, x, y, z = (float(value) for value in q)
    return w, x, y, z


def from_quaternion(values: Array) -> Array:
    """(3, 3) rotation matrix of a quaternion w, x, y, z; its length does not matter unless it is zero."""
    w, x, y, z = values / (np.linalg.norm(values) or 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
