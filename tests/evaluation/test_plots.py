"""Pictures of the evaluation: which there are, and what their bars and marks show."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from dlogen.evaluation import plots
from dlogen.evaluation.paper_tables import Figure
from dlogen.evaluation.plots import evaluation_pictures

TABLE_2 = [
    Figure("II", "bent, paper", "MDTW mean", "mm", 1.9, 2.42, high=3.0),
    Figure("II", "bent, paper", "MDTW std", "mm", 7.0, 8.0, high=9.0),
    Figure("II", "bent, refined", "MDTW mean", "mm", 0.02, high=0.05),
]
CASES = [
    Figure("robustness", "noise", "mean distance", "mm", 0.1, high=0.2),
    Figure("robustness", "noise", "largest distance", "mm", 0.5, high=0.8),
    Figure("robustness", "noise", "length error", "%", 0.3, high=0.4),
    Figure("robustness", "two gaps", "mean distance", "mm", 0.3, high=0.4),
    Figure("robustness", "two gaps", "largest distance", "mm", 0.7, high=0.9),
]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """The axes that pictures are made of, in their order."""
    found: list[Any] = []
    png = plots.png

    def kept(figure: Any) -> bytes:
        found.extend(figure.axes)
        return png(figure)

    monkeypatch.setattr(plots, "png", kept)
    yield found


@pytest.mark.parametrize(
    ("figures", "names"),
    [
        ([], []),
        (TABLE_2, ["table_II.png"]),
        (CASES, ["robustness.png"]),
        ([*CASES, *TABLE_2], ["table_II.png", "robustness.png"]),
        ([TABLE_2[1], CASES[2]], []),
        ([Figure("III", "chain", "number of segments n", "", 16)], []),
    ],
)
def test_a_picture_for_each_table_that_has_rows(figures: list[Figure], names: list[str]) -> None:
    pictures = evaluation_pictures(figures)
    assert list(pictures) == names
    for content in pictures.values():
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
    assert evaluation_pictures(figures) == pictures, "not the same bytes again"


def test_bars_are_as_long_as_what_was_measured(drawn: list[Any]) -> None:
    evaluation_pictures(CASES)
    (axes,) = drawn
    widths = [[bar.get_width() for bar in bars] for bars in axes.containers]
    assert widths == [[0.1, 0.3], [0.5, 0.7]]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["noise", "two gaps"]
    # Bars of one row beside each other, around the place of its name.
    places = np.array([[bar.get_y() + 0.5 * bar.get_height() for bar in bars] for bars in axes.containers])
    np.testing.assert_allclose(places.mean(axis=0), [0.0, 1.0], atol=1e-12)
    assert (places[0] < places[1]).all()
    assert {text.get_text() for text in axes.texts} == {"0.1", "0.3", "0.5", "0.7"}


def test_the_paper_and_the_bounds_are_marked(drawn: list[Any]) -> None:
    evaluation_pictures(TABLE_2)
    (axes,) = drawn
    marks = {line.get_label(): line.get_xdata() for line in axes.lines}
    np.testing.assert_array_equal(marks["bound"], [3.0, 0.05])
    np.testing.assert_array_equal(marks["the paper"], [2.42, np.nan])
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(shown) == ["MDTW mean", "bound", "the paper"]


def test_without_figures_of_the_paper_none_is_named(drawn: list[Any]) -> None:
    evaluation_pictures(CASES)
    shown = [text.get_text() for text in drawn[0].get_legend().get_texts()]
    assert sorted(shown) == ["bound", "largest distance", "mean distance"]


def test_on_a_logarithmic_scale_in_the_unit_of_the_table(drawn: list[Any]) -> None:
    evaluation_pictures(TABLE_2)
    (axes,) = drawn
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "[mm]"
    assert axes.get_xlim()[0] == pytest.approx(0.002)
    # The first row on top.
    bottom, top = axes.get_ylim()
    assert bottom > top
