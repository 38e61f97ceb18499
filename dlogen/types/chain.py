"""The kinematic chain, and how the skeleton line was cut into it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dlogen.config.defaults import CHAIN_FRAME
from dlogen.types.arrays import Array
from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class Joints(ShortRepr):
    """Joints on the skeleton line (paper III.E), or beside it.

    Attributes:
        s: (n + 1,) material coordinates; of joints beside the line those of the nearest places on it, in order.
        positions: (n + 1, 3) the paper's x_0 .. x_n, metres. The first and the last are the ends of the line.
        segment_length: length of every segment but the last, metres.
        last_segment_length: length of the last one, metres.
    """

    s: Array
    positions: Array
    segment_length: float
    last_segment_length: float


@dataclass(frozen=True)
class FewerSegments:
    """Why a chain does not have fewer segments.

    Attributes:
        count: one segment less.
        deviation: the smallest that was found for so many, metres: more than e_max.
        segment_length: with which it was found, metres; None where the joints may leave the line.
        resolution: the search went through all lengths but for intervals that are narrower than this share of them;
            None where it was a local one, which proves nothing.
    """

    count: int
    deviation: float
    segment_length: float | None
    resolution: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Segmentation(ShortRepr):
    """The skeleton line cut into segments (paper III.D, III.E).

    Attributes:
        criterion: "paper" (Eq. 17), "fewest", or what was given: "segments", "segment_length" or "bend_radius".
        placement: "on-curve" (Eq. 18) or "minimax".
        joints: of the chain.
        deviation: the largest distance between skeleton line and chain, measured, metres (`dlogen.stages.chain`).
        deviation_s: where on the line that is.
        fewer: why there are not fewer segments, if that was looked into.
        alternatives: what other criteria give.
    """

    criterion: str
    placement: str
    joints: Joints
    deviation: float
    deviation_s: float
    fewer: FewerSegments | None = None
    alternatives: tuple[Segmentation, ...] = ()

    @property
    def count(self) -> int:
        """Number of segments n."""
        return len(self.joints.s) - 1


@dataclass(frozen=True, eq=False, repr=False)
class Chain(ShortRepr):
    """The kinematic chain (paper Eq. 1-2): n rigid segments between n + 1 joints.

    Attributes:
        joints: (n + 1, 3) joint positions, metres.
        s: (n + 1,) their material coordinates on the skeleton line.
        transforms: (n, 4, 4) pose of each segment, frame in the segment's centre, x axis along the segment,
            rotation-minimising from one segment to the next.
        lengths: (n,) segment lengths, metres.
        radius: radius of the object, metres.

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> chain = result.chain
    >>> chain.joints.shape, chain.transforms.shape
    ((11, 3), (10, 4, 4))
    >>> bool(abs(chain.transforms[:, :3, 3] - 0.5 * (chain.joints[1:] + chain.joints[:-1])).max() < 1e-12)  # Eq. 2
    True
    """

    joints: Array
    s: Array
    transforms: Array
    lengths: Array
    radius: float

    @property
    def length(self) -> float:
        """Sum of the segments' lengths, metres."""
        return float(self.lengths.sum())


@dataclass(frozen=True, eq=False, repr=False)
class Frame(ShortRepr):
    """The frame that a result is in.

    Attributes:
        name: of the frame.
        transform: (4, 4) that takes the cloud's points, in metres, into it.
    """

    name: str = CHAIN_FRAME
    transform: Array = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False, repr=False)
class Pose(ShortRepr):
    """A pose of the multibody model.

    Attributes:
        name: of the pose.
        base_position, base_rotation: (3,) metres, (3, 3): of the first segment's frame in the root frame.
        values: (n - 1, D) joint values, radians.
        time: seconds; None outside of recordings.
    """

    name: str
    base_position: Array
    base_rotation: Array
    values: Array
    time: float | None = None
