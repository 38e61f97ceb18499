"""Pictures of the evaluation, with matplotlib (extra `plots`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dlogen.io.plots import BLUE, ORANGE, RED, canvas, png

if TYPE_CHECKING:
    from dlogen.evaluation.paper_tables import Figure


def evaluation_pictures(figures: Sequence[Figure]) -> dict[str, bytes]:
    """PNGs of the evaluation's tables that are among the figures: {file name: content}.

    Raises:
        UsageError: matplotlib is not installed.
    """
    pictures = {}
    for table, quantities in (
        ("II", ("MDTW mean",)),
        ("robustness", ("mean distance", "largest distance")),
    ):
        rows = [item for item in figures if item.table == table and item.quantity in quantities]
        if rows:
            pictures[f"table_{table}.png" if table == "II" else f"{table}.png"] = _bars(rows, quantities)
    return pictures


def _bars(rows: Sequence[Figure], quantities: Sequence[str]) -> bytes:
    """Measured figures as bars, the paper's and the bounds as marks, on a logarithmic scale."""
    names = list(dict.fromkeys(item.row for item in rows))
    figure = canvas(9.0, 1.2 + 0.34 * len(names) * max(1, len(quantities)))
    axes = figure.add_subplot()
    height = 0.8 / len(quantities)
    for j, (quantity, colour, hatch) in enumerate(zip(quantities, (BLUE, ORANGE), ("", "//"), strict=False)):
        at = {item.row: item for item in rows if item.quantity == quantity}
        y = np.array([names.index(name) for name in at]) + (j - 0.5 * (len(quantities) - 1)) * height
        values = np.array([item.measured for item in at.values()])
        axes.barh(y, values, height, color=colour, hatch=hatch, edgecolor="white", label=quantity)
        limits = np.array([item.high if item.high is not None else np.nan for item in at.values()])
        label = "bound" if j == 0 else None
        axes.plot(limits, y, "|", color="black", markersize=9, markeredgewidth=2, label=label)
        paper = np.array([item.paper if item.paper is not None else np.nan for item in at.values()])
        if np.isfinite(paper).any():
            axes.plot(paper, y, "D", color=RED, markersize=6, label="the paper")
        for value, place in zip(values, y, strict=True):
            # At the foot of the bar, where no bound and no other mark can be.
            axes.annotate(
                f"{value:.2g}",
                (0.01, place),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=9,
                color="white" if colour == BLUE else "black",
                bbox={"facecolor": colour, "edgecolor": "none", "pad": 1.0},
            )
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    # A decade for the numbers.
    axes.set_xlim(left=0.1 * min(item.measured for item in rows))
    axes.set_xlabel(f"[{rows[0].unit}]")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=9, frameon=False)
    return png(figure)
