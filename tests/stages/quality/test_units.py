"""Numbers that can hardly be in the units that they were taken for."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from places import ROOT

import dlogen
from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.stages.quality.units import check_units


def codes(points: np.ndarray, **options: object) -> dict[str, str]:
    return {finding.code: finding.severity for finding in dlogen.fit(points, options).quality.findings}


@pytest.mark.parametrize("radius", [0.0005, 0.005, 0.02, 0.05])
@pytest.mark.parametrize("length", [0.05, 1.0, 15.0])
def test_cables_in_metres_pass(radius: float, length: float) -> None:
    assert check_units(length, radius, "m", "m", radius_given=False) == []


@pytest.mark.parametrize(
    ("length", "radius", "severity", "named"),
    [
        (32.4, 0.25, "bad", "cm"),  # 324 mm of a cable in centimetres
        (12.8, 0.0985, "doubtful", "cm"),  # in inches
        (130.0, 1.0, "bad", "cm"),
        (1300.0, 10.0, "bad", "mm"),
        (600.0, 2.0, "bad", "mm"),
        (25.0, 0.01, "doubtful", ""),
    ],
)
def test_what_can_hardly_be_metres(length: float, radius: float, severity: str, named: str) -> None:
    (finding,) = check_units(length, radius, "m", "m", radius_given=False)
    assert (finding.code, finding.severity) == ("units", severity)
    assert "can hardly be m" in finding.message
    assert named == "" or f"in {named}" in finding.message
    assert "--set units=" in finding.message or "convert it to metres" in finding.message


def test_a_given_radius_says_that_the_units_are_right() -> None:
    assert check_units(30.0, 0.1, "m", "m", radius_given=True) == []


def test_a_guess_is_always_said_and_doubtful_where_others_fit() -> None:
    (finding,) = check_units(1.3, 0.01, "auto", "m", radius_given=False)
    assert finding.severity == "note" and "were taken for m" in finding.message
    (finding,) = check_units(0.13, 0.001, "auto", "mm", radius_given=False)
    assert finding.severity == "doubtful" and "1.3 m in cm" in finding.message
    (finding,) = check_units(0.13, 0.001, "auto", "mm", radius_given=True)
    assert finding.severity == "note"


@pytest.mark.parametrize(("scale", "severity"), [(1.0, None), (100.0, "bad"), (1000.0, "bad"), (1 / 0.0254, "bad")])
def test_a_fit_asks(tube: SyntheticCloud, scale: float, severity: str | None) -> None:
    """The tube has a radius of 15 mm."""
    assert codes(tube.points * scale).get("units") == severity
    assert codes(tube.points * scale, units="auto").get("units") in ("note", "doubtful")


def test_the_units_that_were_set_are_not_doubted(tube: SyntheticCloud) -> None:
    for units, scale in (("cm", 100.0), ("mm", 1000.0)):
        assert "units" not in codes(tube.points * scale, units=units)


def test_no_cloud_in_other_units_is_longer_than_it_is_in_silence() -> None:
    """The figures of tests/tools/units_figures.py: nothing said of 500 clouds in m, of few others."""
    sys.path.insert(0, str(ROOT / "tests" / "tools"))
    from units_figures import CLOUDS, figures

    found = figures()
    assert found["m"]["silent"] == CLOUDS
    assert found["mm"]["silent"] == 0
    assert found["cm"]["silent"] == 0 and found["inch"]["silent"] < 0.15 * CLOUDS
    # A guess from the numbers is not right for all: this is why metres are the default.
    assert min(row["extent"] for row in found.values()) < CLOUDS
