"""Pictures: valid, the same every time, showing what they should."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dlogen.errors import UsageError
from dlogen.evaluation.paper_tables import Figure
from dlogen.evaluation.plots import evaluation_pictures
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.plots import _draw_error, _draw_views, canvas, fit_picture
from dlogen.pipeline import fit
from dlogen.types import Finding, FitData, Quality

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module", params=["helical", "straight"])
def result(request: pytest.FixtureRequest) -> FitData:
    cloud = sample_tube(centre_line(request.param), 0.02, 1500, np.random.default_rng(5))
    return fit(cloud.points, {"profile": "paper", "r": 0.02, "e_max": 0.01}, name=request.param)


@pytest.mark.filterwarnings("error")
def test_a_fit_is_drawn_the_same_every_time(result: FitData) -> None:
    picture = fit_picture(result)
    assert picture.startswith(PNG)
    assert picture == fit_picture(result)


@pytest.mark.filterwarnings("error")
def test_the_refined_profile_and_its_findings_are_drawn() -> None:
    cloud = sample_tube(centre_line("bent"), 0.02, 3000, np.random.default_rng(5), gaps=[(0.4, 0.43)])
    result = fit(cloud.points)
    place = tuple(float(x) for x in result.skeleton(0.4))
    marked = Quality((Finding("gap", "a gap", "note", 0.4, place),))
    object.__setattr__(result, "quality", marked)
    axes = canvas(8, 6).add_subplot()
    _draw_views(axes, result)
    assert [text.get_text() for text in axes.texts] == ["gap"]


def test_points_that_were_left_out_are_drawn() -> None:
    cloud = sample_tube(centre_line("bent"), 0.02, 3000, np.random.default_rng(5))
    branch = np.array([0.9, 0.0, 0.0]) + np.random.default_rng(1).uniform(-0.01, 0.01, (200, 3)) + [[0.1, 0.0, 0.1]]
    far_away = np.array([[100.0, 0.0, 0.0]])
    axes = canvas(8, 6).add_subplot()
    _draw_views(axes, fit(np.concatenate([cloud.points, branch, far_away])))
    left_out = [line for line in axes.lines if line.get_label() == "points left out"]
    assert [len(line.get_xdata()) for line in left_out] == [200]


def test_the_views_show_all_joints_in_proportion(result: FitData) -> None:
    axes = canvas(8, 6).add_subplot()
    _draw_views(axes, result)
    chains = [line for line in axes.lines if line.get_marker() == "o"]
    assert [len(line.get_xdata()) for line in chains] == [len(result.chain.joints)] * 2
    assert axes.get_aspect() == 1.0
    # Both views of a chain keep its extent along the longest direction.
    spans = [np.ptp(line.get_xdata()) for line in chains]
    assert spans[0] == pytest.approx(spans[1])


def test_the_error_is_drawn_below_the_line_at_e_max(result: FitData) -> None:
    axes = canvas(8, 6).add_subplot()
    _draw_error(axes, result)
    curve, limit = axes.lines
    assert limit.get_ydata()[0] == pytest.approx(1e3 * result.e_max)
    assert np.max(curve.get_ydata()) == pytest.approx(1e3 * result.mdtw.max)


def test_evaluation_pictures() -> None:
    figures = [
        Figure("II", "bent, paper", "MDTW mean", "mm", 1.9, 2.42, high=3.0),
        Figure("II", "bent, paper", "MDTW std", "mm", 1.9, 2.42, high=3.0),
        Figure("robustness", "noise", "mean distance", "mm", 0.1, high=0.2),
        Figure("robustness", "noise", "largest distance", "mm", 0.5, high=0.8),
    ]
    pictures = evaluation_pictures(figures)
    assert set(pictures) == {"table_II.png", "robustness.png"}
    assert all(content.startswith(PNG) for content in pictures.values())


def test_without_matplotlib_the_hint_names_the_extra(monkeypatch: pytest.MonkeyPatch, result: FitData) -> None:
    real: Callable[..., Any] = builtins.__import__

    def refuse(name: str, *arguments: Any, **keywords: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(UsageError, match="matplotlib") as caught:
        fit_picture(result)
    assert "dlogen[plots]" in str(caught.value.hint)
