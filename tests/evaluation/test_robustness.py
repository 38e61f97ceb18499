"""Kinds of clouds and how the accuracy on them is measured. That it is kept: `test_paper_tables.py`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlogen.evaluation import robustness as module
from dlogen.evaluation.paper_tables import Figure
from dlogen.evaluation.robustness import CASES, Accuracy, Case, accuracy, robustness, run
from dlogen.evaluation.shapes import centre_line
from dlogen.types import FitData, Skeleton


class TestCases:
    def test_each_is_another_kind_with_bounds(self) -> None:
        assert len({case.name for case in CASES}) == len(CASES)
        for case in CASES:
            mean, largest, length = case.limits
            assert 0.0 < mean < largest and 0.0 < length <= 1.0, case.name
            assert case.radius > 0.0

    @pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
    def test_the_cloud_is_what_its_name_says(self, case: Case) -> None:
        points, line = module._cloud(case, 5)
        strays = case.sampling.get("stray_fraction", 0.0)
        if said := re.search(r"(\d+) % strays", case.name):
            assert strays == int(said[1]) / 100
        assert len(points) == case.count
        distance = line.nearest(points)[1]
        noise = case.sampling.get("noise", 0.0)
        if said := re.search(r"noise (\d+) mm", case.name):
            assert noise == int(said[1]) / 1000
        elif "no noise" in case.name:
            assert noise == 0.0
        off = np.abs(distance - case.radius) > 6.0 * noise + 1e-6
        assert off.mean() == pytest.approx(strays, abs=0.02)
        s = line.nearest(points[~off])[0]
        for start, end in case.sampling.get("gaps", ()):
            assert not ((s > start + 0.01) & (s < end - 0.01)).any()

    def test_a_seed_is_one_cloud(self) -> None:
        case = next(case for case in CASES if case.name == "noise 1 mm")
        one, same, other = (module._cloud(case, seed)[0] for seed in (3, 3, 4))
        np.testing.assert_array_equal(one, same)
        assert not np.array_equal(one, other)


class TestAccuracy:
    @pytest.fixture
    def exact(self, make_result: Callable[..., FitData], exact_line: Callable[..., Skeleton]) -> FitData:
        return make_result(exact_line(centre_line("helical")), 0.02)

    def test_of_the_truth_there_is_no_error(self, exact: FitData) -> None:
        found = accuracy(exact, centre_line("helical"), 0.02)
        assert found.mean < 1e-6 and found.max < 1e-5
        assert [found.length, found.radius] == pytest.approx([0.0, 0.0], abs=1e-6)
        assert found.curvature == pytest.approx(0.0, abs=1e-3)

    def test_each_error_is_relative_to_the_truth(self, exact: FitData) -> None:
        """A line that is a tenth too large, and moved."""
        line = exact.skeleton
        large = replace(exact, skeleton=Skeleton(line.basis, 1.1 * line.weights, line.offset, 1.1 * line.length))
        found = accuracy(large, centre_line("helical"), 0.025)
        assert found.length == pytest.approx(0.1, abs=1e-6)
        assert found.radius == pytest.approx(-0.2)
        assert found.curvature == pytest.approx(1 / 1.1 - 1.0, abs=1e-3)

    def test_distances_of_a_line_that_is_moved_across(self, make_result: Any, straight: Any) -> None:
        truth = centre_line("straight")
        start, end = truth(np.array([0.0, 1.0]))
        across = np.cross(end - start, [1.0, 2.0, 3.0])
        across *= 0.003 / np.linalg.norm(across)
        found = accuracy(make_result(straight(start + across, end - 0.2 * across), 0.02), truth, 0.02)
        # From 3 mm on one side to 0.6 mm on the other; the median would be 1.2 mm.
        assert found.max == pytest.approx(0.003, rel=1e-6)
        assert found.mean == pytest.approx((3.0**2 + 0.6**2) / (2 * 3.6) * 1e-3, rel=1e-2)
        assert np.isnan(found.curvature), "of a straight line there is no relative error"


def test_run_fits_the_cloud_of_a_case() -> None:
    case = replace(CASES[1], count=600)
    points, line = module._cloud(case, 2)
    result = run(case, 2)
    assert result.provenance["points"] == len(points) == 600
    assert result.skeleton.length == pytest.approx(line.length, rel=0.01)


def test_the_table_holds_medians_over_seeds_beside_their_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """In millimetres and percent; errors of either sign count the same."""
    seen: list[tuple[str, int]] = []
    found = {7: (1e-3, 9e-3, -0.04), 8: (2e-3, 5e-3, 0.01), 9: (9e-3, 6e-3, -0.02)}

    def cloud(case: Case, seed: int) -> tuple[Any, Any]:
        seen.append((case.name, seed))
        return seed, None

    monkeypatch.setattr(module, "_cloud", cloud)
    monkeypatch.setattr(module, "fit", lambda points: points)
    monkeypatch.setattr(module, "accuracy", lambda seed, line, radius: Accuracy(*found[seed], 0.0, 0.0))
    figures = list(robustness(seeds=3, first_seed=7))
    assert seen == [(case.name, seed) for case in CASES for seed in (7, 8, 9)]
    assert [item.row for item in figures] == [case.name for case in CASES for _ in range(3)]
    for case, start in zip(CASES, range(0, len(figures), 3), strict=True):
        for item, (quantity, unit, value), high in zip(
            figures[start : start + 3],
            (("mean distance", "mm", 2.0), ("largest distance", "mm", 6.0), ("length error", "%", 2.0)),
            case.limits,
            strict=True,
        ):
            expected = Figure("robustness", case.name, quantity, unit, item.measured, high=high)
            assert item == expected
            assert item.measured == pytest.approx(value)
