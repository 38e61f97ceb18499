"""What a fit makes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from dlogen.config.schema import Config
from dlogen.types.arrays import Array
from dlogen.types.chain import Chain, Frame, Joints, Pose, Segmentation
from dlogen.types.intermediate import Intermediate
from dlogen.types.line import Skeleton
from dlogen.types.quality import Mdtw, Quality, Residual, Uncertainty
from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class FitData(ShortRepr):
    """Everything that a fit made. `dlogen.Result` is the same, and can write itself.

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
        config: the resolved configuration; "auto" is left only for what this profile does not use.
        provenance: version, input, its hash and size.
        timings: seconds per stage.
        intermediates: what the stages made of the points, in their order.
        frame: the frame that all of this is in.
        regime: what of the object the points show: "surface", "strand" (its width, but no depth) or "thread".
        uncertainty: how well the skeleton line is known along it; None where the profile does not tell.
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
    config: Config
    provenance: dict[str, Any]
    timings: dict[str, float]
    intermediates: tuple[Intermediate, ...]
    frame: Frame = field(default_factory=Frame)
    regime: str = "surface"
    uncertainty: Uncertainty | None = None
    recorded: tuple[Pose, ...] = ()

    @property
    def settings(self) -> dict[str, Any]:
        """The resolved configuration as nested plain data, as the JSON files have it."""
        return self.config.to_dict()
