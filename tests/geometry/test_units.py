from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import hose_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.units import METRES, guess_units


def test_factors() -> None:
    assert METRES == {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


@pytest.mark.parametrize("line", [hose_centre_line(), random_centre_line(1)], ids=["hose", "random"])
def test_scans_of_cables(line) -> None:
    points = sample_tube(line, 0.015, 500, 0).points
    assert guess_units(points) == "m"
    assert guess_units(1000 * points) == "mm"
    assert guess_units(points + np.array([5e6, 4e6, 0])) == "m"  # survey coordinates: the extent counts
    assert guess_units(1000 * (points + np.array([5e3, 4e3, 0]))) == "mm"


@pytest.mark.parametrize(
    ("extent", "units"), [(0.1, "m"), (19.9, "m"), (20.1, "cm"), (99.0, "cm"), (101.0, "mm"), (5e4, "mm")]
)
@pytest.mark.parametrize("axis", range(3))
def test_bands_of_the_longest_side(extent: float, units: str, axis: int) -> None:
    points = np.zeros((2, 3))
    points[1, axis] = extent
    assert guess_units(points - 7.0) == units


def test_the_order_of_the_points_does_not_matter() -> None:
    points = np.random.default_rng(0).normal(size=(100, 3)) * 10
    assert guess_units(points) == guess_units(points[::-1])
