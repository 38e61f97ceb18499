"""From the fits of a batch to one model: with times, and in no order."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dlogen.batch.store import Row
from dlogen.config.reader import load_config
from dlogen.errors import FitError
from dlogen.sequence.assemble import assemble
from dlogen.sequence.timestamps import capture_times

CONFIG = load_config(None, ["profile=paper", "mdtw.samples=50", "joints.base=floating", "segmentation.segments=6"])
ROWS = {"sub/b": Row("sub/b", "b.ply", "done"), "c": Row("c", "c.ply", "failed", error="the file is empty")}


def rows(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode())))


def test_in_time(fitted: Path) -> None:
    times = capture_times(["c", "sub/b"], [2.0, 1.0])
    keys = [["c", "sub/b"][k] for k in times.order]
    made = assemble(keys, ROWS, fitted, CONFIG, ["urdf"], times=times, keep_doubtful=True)
    assert set(made.contents) == {"model.urdf", "trajectory.csv", "trajectory.npz", "sequence.json"}
    assert made.motion.states == ("good", "held")
    assert made.report["time"] == {"source": "list", "rate": None, "start": 1.0, "end": 2.0}
    assert made.report["common"]["criterion"] == "segments"
    table = rows(made.contents["trajectory.csv"])
    assert [(row["frame"], row["time"], row["reason"]) for row in table] == [
        ("sub/b", "1.0", ""),
        ("c", "2.0", "failed"),
    ]
    assert made.motion.model.joints[1] == pytest.approx(made.motion.model.joints[0])


def test_in_no_order(fitted: Path) -> None:
    made = assemble(["c", "sub/b"], ROWS, fitted, CONFIG, ["urdf"], keep_doubtful=True)
    assert set(made.contents) == {"model.urdf", "poses.csv", "poses.npz", "one_model.json"}
    assert made.motion.states == ("none", "good") and made.motion.model.reference == 1
    assert np.isnan(made.motion.base_positions[0]).all()
    assert [row["reason"] for row in rows(made.contents["poses.csv"])] == ["failed", ""]


def test_the_largest_deviation_that_is_allowed(fitted: Path) -> None:
    """Half of the radius, unless the configuration has another."""
    free = replace(CONFIG, segmentation=load_config(None).segmentation)
    by_radius = assemble(["sub/b"], ROWS, fitted, free, [], keep_doubtful=True).motion.model
    assert by_radius.e_max == 0.5 * by_radius.sizes.radius.value
    wide = assemble(["sub/b"], ROWS, fitted, replace(free, e_max=0.02), [], keep_doubtful=True).motion.model
    assert wide.e_max == 0.02 and len(wide.links) < len(by_radius.links)


def test_nothing_to_go_by(fitted: Path) -> None:
    with pytest.raises(FitError, match="1 failed; c: the file is empty"):
        assemble(["c"], ROWS, fitted, CONFIG, ["urdf"])
