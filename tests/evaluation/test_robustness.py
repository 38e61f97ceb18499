"""How far a fit is from the truth, on lines whose error is known; and the cases that are measured."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation import robustness as module
from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.robustness import CASES, Accuracy, Case, accuracy, robustness
from dlogen.evaluation.shapes import centre_line


def test_a_line_that_is_beside_the_truth(exact_line, make_result) -> None:
    truth = centre_line("bent")
    aside = truth.moved(np.eye(3), np.array([0.0, 0.0, 0.003]))
    found = accuracy(make_result(exact_line(aside), 0.021), truth, 0.02)
    assert (found.mean, found.max) == pytest.approx((0.003, 0.003))
    assert found.radius == pytest.approx(0.05)
    assert found.length == pytest.approx(0.0, abs=1e-6)
    assert found.curvature == pytest.approx(0.0, abs=1e-6)


def test_a_line_that_is_too_short_and_bends_too_much(circle, make_result) -> None:
    def curve(t: np.ndarray, derivative: int) -> np.ndarray:
        return circle(0.5, 2.0)(t, derivative)

    found = accuracy(make_result(circle(0.4, 2.0), 0.02), CentreLine("arc", curve), 0.02)
    assert found.length == pytest.approx(-0.2)
    assert found.curvature == pytest.approx(0.25)
    assert found.mean == pytest.approx(0.1, rel=1e-6)


def test_a_straight_line_has_no_curvature_to_compare(exact_line, make_result) -> None:
    truth = centre_line("straight")
    assert np.isnan(accuracy(make_result(exact_line(truth), 0.02), truth, 0.02).curvature)


def test_figures_are_medians_in_their_units(monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case("a", lambda rng: centre_line("straight"), 0.02, (0.1, 0.2, 0.3), count=50)
    seen = iter([Accuracy(1e-3, 5e-3, -0.02, 0, 0), Accuracy(3e-3, 4e-3, 0.01, 0, 0), Accuracy(2e-3, 9e-3, 0.05, 0, 0)])
    monkeypatch.setattr(module, "CASES", (case,))
    monkeypatch.setattr(module, "fit", lambda points: len(points))
    monkeypatch.setattr(module, "accuracy", lambda result, line, radius: next(seen))
    figures = list(robustness(3, 5))
    assert [(item.row, item.quantity, item.unit) for item in figures] == [
        ("a", "mean distance", "mm"),
        ("a", "largest distance", "mm"),
        ("a", "length error", "%"),
    ]
    # Without their signs, and each against its own bound.
    assert [item.measured for item in figures] == pytest.approx([2.0, 5.0, 2.0])
    assert [item.high for item in figures] == [0.1, 0.2, 0.3]


def test_a_seed_gives_the_same_cloud_and_names_are_different() -> None:
    case = next(case for case in CASES if case.name == "noise 1 mm")
    (first, line), (again, _), (other, _) = (module._cloud(case, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    off = np.abs(line.nearest(first)[1] - case.radius)
    assert np.median(off) == pytest.approx(0.67e-3, rel=0.15)
    assert len({case.name for case in CASES}) == len(CASES) == 15
