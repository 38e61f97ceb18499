"""The kinematic chain: a pose for every segment (paper III.A, Eq. 1-2) and its distance to the skeleton line."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.polyline import resample
from dlogen.geometry.poses import pose
from dlogen.geometry.segments import places
from dlogen.types import Array, Chain, Joints, Mdtw, Skeleton


def build_chain(joints: Joints, radius: float) -> Chain:
    """Homogeneous transforms of the segments (Eq. 1), origins in their centres (Eq. 2).

    The x axis runs along the segment. The other two are carried from segment to segment by the smallest rotation
    (rotation-minimising, discrete parallel transport; Bishop 1975): the Frenet frame of the paper's III.A is undefined
    where the line is straight and flips at inflections.

    Args:
        joints: n + 1 joints.
        radius: radius of the object, metres.

    Returns:
        n segments.
    """
    start, end = joints.positions[:-1], joints.positions[1:]
    lengths = np.linalg.norm(end - start, axis=1)
    tangents = (end - start) / lengths[:, None]
    transforms = pose(minimal_rotation_frames(tangents), start + 0.5 * (end - start))
    return Chain(joints.positions, joints.s, transforms, lengths, radius)


def deviation(line: Skeleton, joints: Joints, samples: int = 33) -> tuple[float, float]:
    """The largest distance between the skeleton line and its chain, each piece against its own segment.

    Eq. 15 with the correspondence that the joints give: the piece of the line between s_i and s_{i+1} belongs to
    segment i. The larger of

    - the distance of a point of the line to the segment of its piece, and
    - the distance of a joint x_i to f(s_i), which is zero for joints on the line.

    No point of the chain is farther than that from its piece either: feet of a piece's points cover its segment, but
    for what is left at the ends, and there f(s_i) is no farther than it is from the joint. So this is at least the
    Hausdorff distance, and more where a piece is nearer to another's segment.

    Samples each piece, then looks closer at the peaks of those that come near the largest.

    Args:
        line: the skeleton line.
        joints: on it or beside it.
        samples: points a segment.

    Returns:
        (distance in metres, s).
    """
    start, end = joints.positions[:-1], joints.positions[1:]
    s = joints.s[:-1, None] + np.diff(joints.s)[:, None] * np.linspace(0.0, 1.0, samples)
    distance = _to_segments(line, s, start, end)
    # Between two samples a distance can rise by some hundredths of the height that it has over its piece.
    pieces = np.flatnonzero(distance.max(axis=1) >= 0.95 * distance.max())
    width = (joints.s[pieces + 1] - joints.s[pieces]) / (samples - 1)
    peak = s[pieces, np.argmax(distance[pieces], axis=1)]
    for narrower in (1.0, 1.0 / 16.0, 1.0 / 256.0):
        around = peak[:, None] + width[:, None] * np.linspace(-narrower, narrower, 33)
        around = np.clip(around, joints.s[pieces, None], joints.s[pieces + 1, None])
        close = _to_segments(line, around, start[pieces], end[pieces])
        highest = np.argmax(close, axis=1)
        peak = around[np.arange(len(pieces)), highest]
    largest = close.max(axis=1)
    worst = int(np.argmax(largest))
    apart = np.linalg.norm(joints.positions - line(joints.s), axis=1)
    farthest = int(np.argmax(apart))
    if apart[farthest] > largest[worst]:
        return float(apart[farthest]), float(joints.s[farthest])
    return float(largest[worst]), float(peak[worst])


def _to_segments(line: Skeleton, s: Array, start: Array, end: Array) -> Array:
    """Distances of f(s[i, :]) to segment i."""
    points, start = line(s.ravel()).reshape(*s.shape, 3), start[:, None]
    axis = end[:, None] - start
    # By way of the foot: `segments.distances` rounds in another order, and files have max_deviation to its last digit.
    foot = start + places(points - start, axis)[..., None] * axis
    distance: Array = np.linalg.norm(points - foot, axis=2)
    return distance


def chain_error(line: Skeleton, chain: Chain, samples: int) -> Mdtw:
    """MDTW between skeleton line and chain (paper IV.A, Eq. 21-22), both sampled evenly in arc length (Fig. 9).

    Args:
        line: the skeleton line.
        chain: made from it.
        samples: points on each.
    """
    return mdtw(line(even_parameters(line, samples)), resample(chain.joints, samples))
