"""The frozen data types that the stages pass to one another. Metres, radians, right-handed frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.geometry.basis import Basis

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RawCloud:
    """A cloud as its file has it: file order, NaN points kept, the file's own units.

    Attributes:
        points: (M, 3) float64.
        normals: (M, 3) float64, if the file stores any.
        viewpoint: (7,) sensor pose tx ty tz qw qx qy qz, if the file stores one.
        width, height: height > 1 for organised clouds (row-major, width * height = M).
        fields: names of all per-point fields of the file, in file order.
        format: registered name of the format ("ply", "pcd").
        encoding: how the points are stored ("ascii", "binary_little_endian", "binary_compressed", ...).
        comments: comment lines of the header, without the keyword.
        sha256: of the file, if there is one.
    """

    points: Array
    normals: Array | None = None
    viewpoint: Array | None = None
    width: int = 0
    height: int = 1
    fields: tuple[str, ...] = ("x", "y", "z")
    format: str = ""
    encoding: str = ""
    comments: tuple[str, ...] = ()
    sha256: str = ""

    @property
    def organised(self) -> bool:
        """Whether the points are the pixels of an image."""
        return self.height > 1


@dataclass(frozen=True)
class Dropped:
    """How many points were left out on reading, by reason."""

    non_finite: int = 0
    duplicates: int = 0


@dataclass(frozen=True)
class Source:
    """Where a cloud came from."""

    name: str
    format: str
    encoding: str
    fields: tuple[str, ...]
    declared_points: int
    width: int
    height: int
    sha256: str


@dataclass(frozen=True, eq=False)
class Cloud:
    """A clean cloud: finite, free of exact duplicates.

    Attributes:
        points: (M, 3) float64.
        normals: (M, 3) as stored in the file but of unit length (zero for the few that are not usable), or None.
        viewpoint: (3,) position of the sensor in the frame of the points, or None.
        dropped: counts of what was left out on reading.
        source: file that it was read from; None for arrays.
        orientation: (4,) quaternion qw qx qy qz of the sensor, if the file stores one.
    """

    points: Array
    normals: Array | None = None
    viewpoint: Array | None = None
    dropped: Dropped = field(default_factory=Dropped)
    source: Source | None = None
    orientation: Array | None = None

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class SortedPoints:
    """Projected points in their order along the object (the paper's P_s and s_s).

    Attributes:
        index: (K,) indices into the stage's input, in order along the object; K <= M.
        s: (K,) material coordinate in [0, 1], non-decreasing.
        length: length of the walk, metres.
        unreached: (M - K,) indices of points that the walk did not reach.
    """

    index: IntArray
    s: Array
    length: float
    unreached: IntArray


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The skeleton line f(s) = sum_j W_j phi_j(s) + offset, s in [0, 1] (paper III.C, Eq. 7).

    Attributes:
        basis: the basis functions phi_j.
        weights: (N, 3) the paper's W, metres.
        offset: (3,) a constant added to the sum, metres. It keeps the sum accurate far from the origin.
        length: arc length, metres.
    """

    basis: Basis
    weights: Array
    offset: Array
    length: float

    def __call__(self, s: npt.ArrayLike, derivative: int = 0) -> Array:
        """f(s) or its derivative with respect to s: (K,) -> (K, 3)."""
        value = self.basis.combine(np.atleast_1d(np.asarray(s, dtype=float)), self.weights, derivative)
        return value + self.offset if derivative == 0 else value


@dataclass(frozen=True, eq=False)
class Joints:
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


@dataclass(frozen=True, eq=False)
class Segmentation:
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


@dataclass(frozen=True, eq=False)
class Chain:
    """The kinematic chain (paper Eq. 1-2): n rigid segments between n + 1 joints.

    Attributes:
        joints: (n + 1, 3) joint positions, metres.
        s: (n + 1,) their material coordinates on the skeleton line.
        transforms: (n, 4, 4) pose of each segment, frame in the segment's centre, x axis along the segment,
            rotation-minimising from one segment to the next.
        lengths: (n,) segment lengths, metres.
        radius: radius of the object, metres.
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


@dataclass(frozen=True, eq=False)
class Mdtw:
    """The modified dynamic time warping error between two sampled curves (paper IV.A, Eq. 21-22).

    Attributes:
        error: (K,) distance of each pair of the warping path, metres.
        path: (K, 2) indices of the pairs, from (0, 0) to (H - 1, G - 1).
        s: (K,) coordinate of the pair's point on the first curve, in [0, 1].
        mean, std, max: of the error, metres; std with K - 1.
    """

    error: Array
    path: IntArray
    s: Array
    mean: float
    std: float
    max: float


@dataclass(frozen=True)
class Finding:
    """Something about the cloud or the chain that a user should know.

    Attributes:
        code: stable identifier, for scripts ("gap", "closed-ring", ...).
        message: one sentence.
        severity: "note" leaves the verdict alone, "doubtful" and "bad" lower it.
        s: material coordinate that it is at, if any.
        position: place in space, metres, if any.
    """

    code: str
    message: str
    severity: str = "doubtful"
    s: float | None = None
    position: tuple[float, float, float] | None = None

    def to_dict(self) -> dict[str, Any]:
        """As it stands in the JSON files; absent places are left out."""
        out: dict[str, Any] = {"code": self.code, "message": self.message, "severity": self.severity}
        if self.s is not None:
            out["s"] = self.s
        if self.position is not None:
            out["position"] = list(self.position)
        return out


@dataclass(frozen=True)
class Quality:
    """How far the chain can be trusted: the worst severity among the findings."""

    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """ "good", "doubtful" or "bad"."""
        severities = {finding.severity for finding in self.findings}
        return "bad" if "bad" in severities else "doubtful" if "doubtful" in severities else "good"


@dataclass(frozen=True)
class Residual:
    """Distance of the cloud's points to the surface of the tube around the skeleton line, metres."""

    rms: float
    median: float
    radius: float


@dataclass(frozen=True, eq=False)
class Intermediate:
    """What a stage made of the points, for dumps and pictures.

    Attributes:
        name: of the stage.
        points: (K, 3) metres.
        columns: further numbers for each point, (K,) each.
        colour: name of the column in [0, 1] that a picture should show as colour, if any.
    """

    name: str
    points: Array
    columns: dict[str, Array] = field(default_factory=dict)
    colour: str | None = None


@dataclass(frozen=True, eq=False)
class Frame:
    """The frame that a result is in.

    Attributes:
        name: of the frame.
        transform: (4, 4) that takes the cloud's points, in metres, into it.
    """

    name: str = "cloud"
    transform: Array = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False)
class Pose:
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


@dataclass(frozen=True, eq=False)
class Result:
    """Everything that a fit made.

    Attributes:
        name: stem of the output files.
        profile: "refined" or "paper".
        skeleton: the skeleton line f(s).
        skeleton_points: (1000, 3) the same, even in arc length, metres.
        segmentation: how the line was cut into segments, and what other criteria give.
        joints: the joints of the chain.
        chain: the kinematic chain.
        e_max: the allowed deviation, metres.
        max_deviation: the largest distance between skeleton line and chain, measured, metres.
        mdtw: skeleton line against chain.
        residual: points against the tube.
        quality: verdict and findings.
        settings: the resolved configuration; "auto" is left only for what this profile does not use.
        provenance: version, input, its hash and size.
        timings: seconds per stage.
        intermediates: what the stages made of the points, in their order.
        frame: the frame that all of this is in.
        recorded: poses that the model was seen in, in the order of time, if there are any.
    """

    name: str
    profile: str
    skeleton: Skeleton
    skeleton_points: Array
    segmentation: Segmentation
    joints: Joints
    chain: Chain
    e_max: float
    max_deviation: float
    mdtw: Mdtw
    residual: Residual
    quality: Quality
    settings: dict[str, Any]
    provenance: dict[str, Any]
    timings: dict[str, float]
    intermediates: tuple[Intermediate, ...]
    frame: Frame = field(default_factory=Frame)
    recorded: tuple[Pose, ...] = ()
