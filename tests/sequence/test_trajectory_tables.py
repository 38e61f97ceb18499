"""The tables of a motion: CSV and arrays say the same."""

from __future__ import annotations

import csv
import io

import numpy as np
from moving import moved

from dlogen.multibody.build import multibody
from dlogen.sequence.trajectory_tables import trajectory_csv, trajectory_npz


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
    assert arrays["joint_positions"].shape == (30, len(motion.model.links) + 1, 3)
    assert trajectory_npz(motion, names) == trajectory_npz(motion, names)


def test_without_time_and_without_a_pose() -> None:
    motion = moved(times=False)
    names = [f"j{i}" for i in range(motion.values[0].size)]
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(motion, names).decode())))
    assert rows[7]["time"] == rows[7]["x"] == "" and rows[7]["reason"] == "failed"
