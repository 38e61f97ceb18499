"""Polylines are told from clouds by how far it is from one point to the next."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from curve_files import bent, refused, table, written

from dlogen.errors import InputError
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud
from dlogen.io.curves.curve import load_curve
from dlogen.io.curves.order import in_order


@pytest.mark.parametrize("suffix", ["ply", "csv"])
def test_a_cloud_is_not_taken_for_a_polyline(tmp_path: Path, suffix: str) -> None:
    points = sample_tube(centre_line("bent"), 0.02, 3000, np.random.default_rng(1)).points
    path = tmp_path / f"a.{suffix}"
    write_cloud(path, points) if suffix == "ply" else path.write_text(table(points))
    error = refused(path, "in no order")
    assert "dlogen fit" in str(error.hint)


@pytest.mark.parametrize("count", [100, 5000])
def test_noisy_and_coiled_polylines_are_still_polylines(tmp_path: Path, count: int) -> None:
    rng = np.random.default_rng(2)
    turn = np.linspace(0, 60 * np.pi, count)
    coil = np.c_[0.1 * np.cos(turn), 0.1 * np.sin(turn), 0.01 * turn / (2 * np.pi)]
    for points in (coil, bent(np.linspace(0, 1, count)) + rng.normal(0, 0.002, (count, 3))):
        assert len(load_curve(written(tmp_path, "a.csv", table(points))).points) == count


def test_points_in_order_come_back_as_they_are() -> None:
    line = bent(np.linspace(0.0, 1.0, 1000))
    assert in_order(line) is line
    shuffled = np.random.default_rng(0).permutation(line)
    with pytest.raises(InputError, match="in no order"):
        in_order(shuffled)
    # Of few points, and of such that are refused elsewhere, it is not judged.
    assert in_order(shuffled[:99]) is not None
    shuffled[0] = np.nan
    assert in_order(shuffled) is shuffled
