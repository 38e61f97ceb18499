"""Poses of a chain over time: the base's orientation, the values of the hinges, and what lies between two frames."""

from __future__ import annotations

import math

import numpy as np

from dlogen.geometry.rotations import smallest_rotations
from dlogen.geometry.vectors import unit
from dlogen.sequence.rigid_links import centre, from_directions
from dlogen.types import Array, BoolArray

#: A gap in time of more than so many usual distances of frames is crossed on the straight way. On smooth motions the
#: cubic is better by a factor of ten at 7 distances; what it makes of longer gaps is more and more its own invention.
_SHORT = 10.0


def filled_in(joints: Array, links: Array, times: Array, good: BoolArray) -> Array:
    """Chains for the frames that are not good, from the good ones around them.

    Between two good frames the centre of mass and the directions of the links follow a cubic through their velocities
    (Catmull and Rom 1974, for uneven times); across long gaps, and where velocities are not known, the straight way.
    Before the first good frame and after the last one the chain rests.

    Args:
        joints: (F, n + 1, 3) metres; those of frames that are not good are not looked at.
        links: (n,) lengths.
        times: (F,) seconds, increasing.
        good: (F,), one at least.

    Returns:
        (F, n + 1, 3), the good ones untouched.
    """
    known = np.flatnonzero(good)
    edges = np.diff(joints, axis=1) / links[:, None]
    path = np.concatenate([centre(joints, links)[:, None], edges], axis=1)
    usual = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    out = joints.copy()
    for k in np.flatnonzero(~good):
        after = int(np.searchsorted(known, k))
        if after == 0 or after == len(known):
            out[k] = joints[known[min(after, len(known) - 1)]]
            continue
        i, j = known[after - 1], known[after]
        h = times[j] - times[i]
        t = (times[k] - times[i]) / h
        place = (1.0 - t) * path[i] + t * path[j]
        if 2 <= after < len(known) - 1 and h <= _SHORT * usual:
            straight = (path[j] - path[i]) / h
            for near, far, weight in (
                (i, known[after - 2], t * (1.0 - t) ** 2),
                (j, known[after + 1], -(t**2) * (1.0 - t)),
            ):
                gap = abs(times[near] - times[far])
                outside = (path[near] - path[far]) / (times[near] - times[far])
                # The parabola through three frames has this velocity at the middle one.
                place = place + weight * h * ((outside * h + straight * gap) / (h + gap) - straight)
        norms = np.linalg.norm(place[1:], axis=1, keepdims=True)
        # Links that turn right round have no direction half way.
        directions = np.where(norms > 1e-9, place[1:] / np.maximum(norms, 1e-9), path[i, 1:])
        out[k] = from_directions(place[None, 0], directions[None], links)[0]
    return out


def smoothed(joints: Array, links: Array, times: Array, most: float) -> Array:
    """Chains with less noise from frame to frame.

    Centres of mass and directions of the links are evened out by the parabola through five frames around each (Savitzky
    and Golay 1964, for uneven times), which does not lag. The first two and the last two frames stay, as do those at
    long gaps and those that it would change by more than noise can explain.

    Args:
        joints: (F, n + 1, 3) metres.
        links: (n,) lengths.
        times: (F,) seconds, increasing.
        most: how far noise may move a joint, metres.
    """
    if len(joints) < 5:
        return joints
    centres, directions = centre(joints, links), np.diff(joints, axis=1) / links[:, None]
    path = np.concatenate([centres[:, None], directions], axis=1)
    around = np.arange(5) + np.arange(len(joints) - 4)[:, None]
    t = times[around] - times[2:-2, None]
    spread = np.abs(t).max(axis=1, keepdims=True)
    powers = (t / spread)[..., None] ** np.arange(3)
    weights = np.linalg.pinv(powers)[:, 0]
    even = np.einsum("fk,fkcx->fcx", weights, path[around])
    even[:, 1:] = unit(even[:, 1:], 1e-9)
    new = from_directions(even[:, 0], even[:, 1:], links)
    change = np.linalg.norm(new - joints[2:-2], axis=2).max(axis=1)
    usual = float(np.median(np.diff(times)))
    noise = (change <= most) & (spread[:, 0] <= _SHORT * usual)
    out = joints.copy()
    out[2:-2][noise] = new[noise]
    return out


def base_rotations(directions: Array, first: Array, reference: int) -> Array:
    """Orientations of the first link that turn from frame to frame without twist, by the smallest rotation.

    Args:
        directions: (F, 3) of the first link, unit vectors.
        first: (3, 3) orientation in the reference frame, x along the link.
        reference: frame to start from, in both directions of time.

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
    y = unit(rotation[:, 1] - (rotation[:, 1] @ x) * x)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def hinge_values(directions: Array, base: Array, zero: Array, dof: int, reference: int) -> Array:
    """Values of the hinges that pose a chain, continuous in time.

    Joint i turns link i + 1 by zero_i Ry(a) Rz(b), and with three degrees of freedom Rx(c), in the frame of link i
    (`dlogen.multibody.model`). Two hinges choose the twist; with three there is none along the chain (smallest rotation
    from link to link). Of the two pairs of angles that are the same direction, (a, b) and (a + pi, pi - b), and of
    their multiples, the one nearest to the frame before is taken; in the reference frame the one with |b| <= pi / 2.

    Args:
        directions: (F, n, 3) of the links, unit vectors.
        base: (F, 3, 3) orientation of the first link.
        zero: (n - 1, 3, 3) orientation of each link in that of the one before when all values are zero.
        dof: 2 or 3.
        reference: frame to start from, in both directions of time.

    Returns:
        (F, n - 1, dof) radians.
    """
    frames, count = directions.shape[:2]
    out = np.zeros((frames, count - 1, dof))
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
    """The representatives nearest to those before, from the reference frame onward and backward: (F, D) -> (F, D)."""
    if len(values) < 2 or np.abs(np.diff(values, axis=0)).max() < 0.5 * math.pi:
        return values
    other = values + math.pi
    other[:, 1] = math.pi - values[:, 1]
    out = values.copy()
    for frames in (range(reference + 1, len(values)), range(reference - 1, -1, -1)):
        last = values[reference]
        for k in frames:
            near = [kind[k] - 2.0 * math.pi * np.round((kind[k] - last) / (2.0 * math.pi)) for kind in (values, other)]
            last = out[k] = min(near, key=lambda candidate: float(np.abs(candidate - last).max()))
    return out
