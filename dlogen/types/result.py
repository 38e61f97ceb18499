"""What a fit makes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from dlogen.types.arrays import Array
from dlogen.types.chain import Chain, Frame, Joints, Pose, Segmentation
from dlogen.types.line import Skeleton
from dlogen.types.quality import Mdtw, Quality, Residual


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
