"""How a line is to be cut: what the configuration says of the segments, made definite."""

from __future__ import annotations

from dataclasses import dataclass

from dlogen.config.defaults import MIN_LAST, PLACEMENT, R_PER_E_MAX
from dlogen.config.fields import AUTO, given
from dlogen.config.schema import Config


@dataclass(frozen=True)
class SegmentationSpec:
    """How a line is to be cut.

    Attributes:
        criterion: "paper" or "fewest"; not looked at where a number of segments, a length or a radius is given.
        placement: "on-curve" or "minimax", for "fewest".
        segments: exactly so many, all equal.
        segment_length: so long but for the last, metres.
        bend_radius: smallest radius of curvature for Eq. 17, metres, instead of the line's own.
        min_last: what "fewest" tries to keep of the last segment, as a share of the others.
        alternatives: work out all three criteria.
    """

    criterion: str = "fewest"
    placement: str = PLACEMENT
    segments: int | None = None
    segment_length: float | None = None
    bend_radius: float | None = None
    min_last: float = MIN_LAST
    alternatives: bool = False

    @classmethod
    def of(cls, config: Config) -> SegmentationSpec:
        """What a configuration says; `criterion: auto` depends on the profile and on what is known beforehand."""
        wanted = config.segmentation
        curvature, radius = given(wanted.curvature_max), given(wanted.min_bend_radius)
        criterion = wanted.criterion
        if criterion == AUTO:
            a_priori = curvature is not None or radius is not None
            criterion = "paper" if a_priori or config.profile == "paper" else "fewest"
        return cls(
            criterion=criterion,
            placement=wanted.placement,
            segments=given(wanted.segments),
            segment_length=given(wanted.segment_length),
            bend_radius=radius if curvature is None else 1.0 / curvature,
            min_last=wanted.min_last,
            alternatives=config.report.alternatives,
        )


def allowed_deviation(config: Config, radius: float) -> float:
    """e_max, metres: as given, or the paper's ratio r / 2 (Table III: 10 mm for a diameter of 40 mm).

    Args:
        config: with `e_max`.
        radius: of the object, metres.
    """
    return radius / R_PER_E_MAX if config.e_max == AUTO else config.e_max
