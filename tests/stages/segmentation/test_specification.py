"""How a line is to be cut, from what the configuration says."""

from __future__ import annotations

from typing import Any

import pytest

from dlogen.config.schema import Config
from dlogen.stages.segmentation.specification import SegmentationSpec, allowed_deviation


def spec(**chosen: Any) -> SegmentationSpec:
    return SegmentationSpec.of(Config().resolved(chosen))


def test_nothing_said_is_the_default() -> None:
    assert spec() == SegmentationSpec()


@pytest.mark.parametrize(
    ("chosen", "criterion"),
    [
        ({}, "fewest"),
        ({"profile": "paper"}, "paper"),
        ({"segmentation.min_bend_radius": 0.2}, "paper"),
        ({"segmentation.curvature_max": 5.0}, "paper"),
        ({"profile": "paper", "segmentation.criterion": "fewest"}, "fewest"),
        ({"segmentation.criterion": "paper"}, "paper"),
        ({"segmentation.criterion": "fewest", "segmentation.curvature_max": 5.0}, "fewest"),
    ],
)
def test_which_criterion_auto_is(chosen: dict[str, Any], criterion: str) -> None:
    assert spec(**chosen).criterion == criterion


def test_a_largest_curvature_is_one_over_the_smallest_radius() -> None:
    assert spec(**{"segmentation.curvature_max": 5.0}).bend_radius == pytest.approx(0.2)
    assert spec(**{"segmentation.min_bend_radius": 0.3}).bend_radius == 0.3
    assert spec().bend_radius is None


def test_each_setting_comes_to_its_own_place() -> None:
    made = spec(
        **{
            "segmentation.segments": 7,
            "segmentation.segment_length": 0.11,
            "segmentation.placement": "minimax",
            "segmentation.min_last": 0.25,
            "report.alternatives": True,
        }
    )
    assert (made.segments, made.segment_length, made.placement) == (7, 0.11, "minimax")
    assert (made.min_last, made.alternatives) == (0.25, True)


def test_e_max_is_half_the_radius_unless_given() -> None:
    # Table III: 10 mm for a diameter of 40 mm.
    assert allowed_deviation(Config(), 0.02) == pytest.approx(0.01)
    assert allowed_deviation(Config().resolved({"e_max": 0.003}), 0.02) == 0.003
