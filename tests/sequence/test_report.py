"""The report of a recording: each row is about the capture that it names."""

from __future__ import annotations

import json

import numpy as np
import pytest
from moving import moved

from dlogen.sequence.report import sequence_dict


def test_rows_are_about_the_captures_that_they_name(result_for) -> None:
    motion = moved()
    report = sequence_dict(motion, result_for(motion), time_source="numbers", rate=30.0)
    model, rows = motion.model, report["frames"]
    assert report["frame_count"] == len(rows) == 30
    for k, (row, capture) in enumerate(zip(rows, model.captures, strict=True)):
        assert (row["name"], row["time"], row["state"]) == (f"frame_{k:02d}", motion.times[k], motion.states[k])
        assert row["reversed"] == model.reverse[k]
        if k in (7, 29):
            assert row["reason"] == {"code": "failed", "message": "the file is empty"}
            assert row["length"] is row["radius"] is row["residual"] is row["error"] is None
        else:
            assert row["reason"] is None
            assert (row["length"], row["radius"]) == (capture.length, capture.radius)
            assert (row["residual"], row["error"]) == (capture.residual, model.deviation[k])
    # No two captures are alike: rows in another order would show.
    assert len({row["error"] for row in rows}) == 29 and len({row["length"] for row in rows}) == 29
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_what_is_said_of_all(result_for) -> None:
    motion = moved()
    report = sequence_dict(motion, result_for(motion), time_source="numbers", rate=30.0)
    model, common = motion.model, report["common"]
    errors = {row["name"]: row["error"] for row in report["frames"] if row["error"] is not None}
    assert common["max_deviation"] == max(errors.values()) == errors[common["max_deviation_frame"]]
    assert common["mean_deviation"] == pytest.approx(sum(errors.values()) / 28)
    assert common["reference_frame"] == f"frame_{model.reference:02d}"
    assert common["min_bend_radius_frame"] == f"frame_{model.bend.capture:02d}"
    assert common["segment_count"] * common["segment_length"] == pytest.approx(common["length"])
    steps = np.linalg.norm(model.joints[1:] - model.joints[:-1], axis=2)
    assert common["largest_step"] == pytest.approx(steps.max())
    assert report["states"] == {"good": 28, "interpolated": 1, "held": 1, "none": 0}
    assert report["time"] == {"source": "numbers", "rate": 30.0, "start": 0.0, "end": motion.times[-1]}
    for name, size in report["thresholds"].items():
        assert size["median"] == getattr(model.sizes, name).value
        assert size["allowed"] == getattr(model.sizes, name).allowed


def test_without_time(result_for) -> None:
    motion = moved(times=False)
    report = sequence_dict(motion, result_for(motion), time_source=None, rate=None)
    assert set(report["time"].values()) == {None} and report["common"]["largest_step"] is None
    assert report["states"] == {"good": 28, "interpolated": 0, "held": 0, "none": 2}
    assert all(row["time"] is None for row in report["frames"])
