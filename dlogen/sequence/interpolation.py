"""Chains over time: those of captures that have none, from their neighbours, and the same with less noise."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.vectors import unit
from dlogen.sequence.rigid_links import centre, from_directions
from dlogen.types import Array, BoolArray

#: A gap in time of more than so many usual distances of captures is crossed on the straight way. On smooth motions the
#: cubic is better by a factor of ten at 7 distances; what it makes of longer gaps is more and more its own invention.
_SHORT = 10.0


def filled_in(joints: Array, links: Array, times: Array, good: BoolArray) -> Array:
    """Chains for the captures that are not good, from the good ones around them.

    Between two good captures the centre of mass and the directions of the links follow a cubic through their velocities
    (Catmull and Rom 1974, for uneven times); across long gaps, and where velocities are not known, the straight way.
    Before the first good capture and after the last one the chain rests.

    Args:
        joints: (F, n + 1, 3) metres; those of captures that are not good are not looked at.
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
    out: Array = joints.copy()
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
                # The parabola through three captures has this velocity at the middle one.
                place = place + weight * h * ((outside * h + straight * gap) / (h + gap) - straight)
        norms = np.linalg.norm(place[1:], axis=1, keepdims=True)
        # Links that turn right round have no direction half way.
        directions = np.where(norms > 1e-9, place[1:] / np.maximum(norms, 1e-9), path[i, 1:])
        out[k] = from_directions(place[None, 0], directions[None], links)[0]
    return out


def smoothed(joints: Array, links: Array, times: Array, most: float) -> Array:
    """Chains with less noise from capture to capture.

    Centres of mass and directions of the links are evened out by the parabola through five captures around each
    (Savitzky and Golay 1964, for uneven times), which does not lag. The first two and the last two captures stay, as
    do those at long gaps and those that it would change by more than noise can explain.

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
    out: Array = joints.copy()
    out[2:-2][noise] = new[noise]
    return out
