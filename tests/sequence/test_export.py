"""Files of a motion: the same numbers in all of them, each with the time step that it belongs to."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from recorded_motion import moved

from dlogen.io.json_text import dump_json
from dlogen.multibody.build import multibody
from dlogen.sequence.export import contents, trajectory_csv, trajectory_npz


def test_trajectory_files_say_the_same(result_for) -> None:
    motion = moved()
    names = multibody(result_for(motion)).hinge_names
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(motion, names).decode())))
    arrays = np.load(io.BytesIO(trajectory_npz(motion, names)), allow_pickle=False)
    assert [row["frame"] for row in rows] == arrays["frame"].tolist() == [f"frame_{k:02d}" for k in range(30)]
    assert [float(row["time"]) for row in rows] == arrays["time"].tolist() == motion.times.tolist()
    assert arrays["joint_names"].tolist() == list(names)
    for name, column in zip(names, arrays["joint_values"].T, strict=True):
        assert [float(row[name]) for row in rows] == column.tolist()
    for keys, array in ((("x", "y", "z"), "base_position"), (("qw", "qx", "qy", "qz"), "base_quaternion")):
        assert np.array([[float(row[key]) for key in keys] for row in rows]).tolist() == arrays[array].tolist()
    assert [row["state"] for row in rows] == arrays["state"].tolist()
    assert (
        [row["error"] == "" for row in rows] == np.isnan(arrays["error"]).tolist() == [k in (7, 29) for k in range(30)]
    )
    assert arrays["joint_positions"].shape == (30, len(motion.common.links) + 1, 3)
    assert trajectory_npz(motion, names) == trajectory_npz(motion, names)


def test_rows_are_the_poses_of_their_time_steps(result_for) -> None:
    motion = moved("helix")
    names = multibody(result_for(motion)).hinge_names
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(motion, names).decode())))
    assert list(rows[0]) == ["frame", "time", "x", "y", "z", "qw", "qx", "qy", "qz", *names, "error", "state", "reason"]
    for k in (0, 12, 28):
        w, x, y, z = (float(rows[k][key]) for key in ("qw", "qx", "qy", "qz"))
        # The first column of the rotation, written out: where the first segment points.
        along = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        first = motion.common.joints[k, 1] - motion.common.joints[k, 0]
        assert along == pytest.approx(first / np.linalg.norm(first), abs=1e-9)
        assert [float(rows[k][key]) for key in "xyz"] == pytest.approx(motion.common.joints[k, 0].tolist(), abs=1e-9)
        assert [float(rows[k][name]) for name in names] == motion.values[k].ravel().tolist()
        assert float(rows[k]["error"]) == motion.common.deviation[k]
    assert [rows[k]["reason"] for k in (6, 7, 29)] == ["", "failed", "failed"]


def test_all_files_by_their_names(result_for) -> None:
    motion = moved()
    result = result_for(motion)
    made = contents(motion, result, {"a": 1}, ["urdf", "csv"], ("t.csv", "t.npz", "r.json"))
    assert set(made) >= {"t.csv", "t.npz", "r.json", "hose.urdf"}
    names = multibody(result).hinge_names
    assert made["t.csv"] == trajectory_csv(motion, names)
    assert made["t.npz"] == trajectory_npz(motion, names)
    assert made["r.json"] == dump_json({"a": 1}).encode()
    assert not any(name.endswith(".png") for name in made)
