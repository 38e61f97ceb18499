"""A chain over time as a model has it: the orientation of its base, and the values of its hinges."""

from __future__ import annotations

import math

import numpy as np

from dlogen.geometry.rotations import smallest_rotations
from dlogen.geometry.vectors import unit
from dlogen.types import Array


def base_rotations(directions: Array, first: Array, reference: int) -> Array:
    """Orientations of the first link that turn from capture to capture without twist, by the smallest rotation.

    Args:
        directions: (F, 3) of the first link, unit vectors.
        first: (3, 3) orientation in the reference capture, x along the link.
        reference: capture to start from, in both directions of time.

    Returns:
        (F, 3, 3)
    """
    out = np.empty((len(directions), 3, 3))
    out[reference] = first
    turns = smallest_rotations(directions[:-1], directions[1:])
    for k in range(reference + 1, len(directions)):
        out[k] = _with_axis(turns[k - 1] @ out[k - 1], directions[k])
    for k in range(reference - 1, -1, -1):
        out[k] = _with_axis(turns[k].T @ out[k + 1], directions[k])
    return out


def _with_axis(rotation: Array, x: Array) -> Array:
    """Rounding must not add up over long recordings."""
    y = rotation[:, 1] - (rotation[:, 1] @ x) * x
    y = unit(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def hinge_values(directions: Array, base: Array, zero: Array, dof: int, reference: int) -> Array:
    """Values of the hinges that pose a chain, continuous in time.

    Joint i turns link i + 1 by zero_i Ry(a) Rz(b), and with three degrees of freedom Rx(c), in the frame of link i
    (`dlogen.multibody.model`). Two hinges choose the twist; with three there is none along the chain (smallest rotation
    from link to link). Of the two pairs of angles that are the same direction, (a, b) and (a + pi, pi - b), and of
    their multiples, the one nearest to the capture before is taken; in the reference capture the one with
    |b| <= pi / 2.

    Args:
        directions: (F, n, 3) of the links, unit vectors.
        base: (F, 3, 3) orientation of the first link.
        zero: (n - 1, 3, 3) orientation of each link in that of the one before when all values are zero.
        dof: 2 or 3.
        reference: capture to start from, in both directions of time.

    Returns:
        (F, n - 1, dof) radians.
    """
    captures, count = directions.shape[:2]
    out = np.zeros((captures, count - 1, dof))
    rotation = base
    for i in range(count - 1):
        x = np.einsum("fyx,fy->fx", rotation @ zero[i], directions[:, i + 1])
        a, b = np.arctan2(-x[:, 2], x[:, 0]), np.arctan2(x[:, 1], np.hypot(x[:, 0], x[:, 2]))
        bent = _hinges(a, b)
        values = np.stack([a, b], axis=1)
        if dof == 3:
            after = smallest_rotations(directions[:, i], directions[:, i + 1]) @ rotation
            twist = np.swapaxes(rotation @ zero[i] @ bent, 1, 2) @ after
            values = np.column_stack([values, np.arctan2(twist[:, 2, 1], twist[:, 1, 1])])
        out[:, i] = _continuous(values, reference)
        # Which of the two pairs it is decides how the next link is turned about itself.
        rotation = after if dof == 3 else rotation @ zero[i] @ _hinges(out[:, i, 0], out[:, i, 1])
    return out


def _hinges(a: Array, b: Array) -> Array:
    """Ry(a) Rz(b): (F,), (F,) -> (F, 3, 3)."""
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    zero = np.zeros_like(a)
    return np.stack([ca * cb, -ca * sb, sa, sb, cb, zero, -sa * cb, sa * sb, ca], axis=1).reshape(-1, 3, 3)


def _continuous(values: Array, reference: int) -> Array:
    """The representatives nearest to those before, from the reference capture onward and backward: (F, D) -> (F, D)."""
    if len(values) < 2 or np.abs(np.diff(values, axis=0)).max() < 0.5 * math.pi:
        return values
    other = values + math.pi
    other[:, 1] = math.pi - values[:, 1]
    out: Array = values.copy()
    for captures in (range(reference + 1, len(values)), range(reference - 1, -1, -1)):
        last = values[reference]
        for k in captures:
            near = [kind[k] - 2.0 * math.pi * np.round((kind[k] - last) / (2.0 * math.pi)) for kind in (values, other)]
            last = out[k] = min(near, key=lambda candidate: float(np.abs(candidate - last).max()))
    return out
