"""Pictures of the tables: which there are, and what is drawn in them."""

from __future__ import annotations

from typing import Any

import pytest

from dlogen.evaluation import plots
from dlogen.evaluation.paper_tables import Figure
from dlogen.evaluation.plots import evaluation_pictures

pytest.importorskip("matplotlib")

TWO = [
    Figure("II", "bent", "MDTW mean", "mm", 1.2, paper=1.5, high=2.0),
    Figure("II", "bent", "MDTW max", "mm", 5.0),
    Figure("II", "straight", "MDTW mean", "mm", 0.4, high=0.5),
]
ROBUST = [
    Figure("robustness", "noise", "mean distance", "mm", 0.1, high=0.15),
    Figure("robustness", "noise", "largest distance", "mm", 0.6, high=0.8),
    Figure("robustness", "noise", "length error", "%", 0.1, high=0.2),
]


def test_a_picture_for_each_table_that_is_there() -> None:
    assert evaluation_pictures([]) == {}
    assert evaluation_pictures([Figure("III", "hose", "n", "", 16)]) == {}
    assert list(evaluation_pictures(TWO)) == ["table_II.png"]
    pictures = evaluation_pictures([*TWO, *ROBUST])
    assert list(pictures) == ["table_II.png", "robustness.png"]
    assert all(data.startswith(b"\x89PNG") for data in pictures.values())
    # The same bytes for the same figures.
    assert evaluation_pictures([*TWO, *ROBUST]) == pictures


def test_what_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []

    def keep(figure: Any) -> bytes:
        drawn.append(figure)
        return b""

    monkeypatch.setattr(plots, "png", keep)
    evaluation_pictures([*TWO, *ROBUST])
    two, robust = (figure.axes[0] for figure in drawn)
    # Bars as long as the figures, in the rows' order from the top; the other quantity has none.
    assert [bar.get_width() for bar in two.patches] == [1.2, 0.4]
    assert [label.get_text() for label in two.get_yticklabels()] == ["bent", "straight"]
    assert two.yaxis_inverted() and two.get_xscale() == "log"
    marks = {line.get_label(): line for line in two.lines}
    assert marks["bound"].get_xdata().tolist() == [2.0, 0.5]
    assert marks["the paper"].get_xdata()[0] == 1.5
    # Two bars side by side for the two quantities.
    assert [bar.get_width() for bar in robust.patches] == [0.1, 0.6]
    low, high = (bar.get_y() + bar.get_height() / 2 for bar in robust.patches)
    assert (low, high) == pytest.approx((-0.2, 0.2))
