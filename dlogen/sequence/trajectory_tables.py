"""A motion as tables: CSV for people and spreadsheets, arrays for numpy."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from dlogen.sequence.trajectory import Motion

#: Columns of the trajectory before the joints.
_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def trajectory_csv(motion: Motion, hinge_names: Sequence[str]) -> bytes:
    """A row for each capture: name, time, pose of the base, values of the joints, error and state. Empty where unknown.

    Position and quaternion are those of the first segment's frame in the root frame; metres, radians, seconds. The
    error is the largest distance between the capture's own skeleton line and the chain.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["frame", "time", *_POSE, *hinge_names, "error", "state", "reason"])
    quaternions = motion.quaternions
    for k, (item, exclusion) in enumerate(zip(motion.model.captures, motion.model.exclusions, strict=True)):
        numbers = [*motion.base_positions[k], *quaternions[k], *motion.values[k].ravel(), motion.model.deviation[k]]
        row = ["" if np.isnan(value) else repr(float(value)) for value in numbers]
        time = "" if motion.times is None else repr(float(motion.times[k]))
        writer.writerow([item.name, time, *row, motion.states[k], "" if exclusion is None else exclusion.code])
    return text.getvalue().encode("utf-8", "backslashreplace")


def trajectory_npz(motion: Motion, hinge_names: Sequence[str]) -> bytes:
    """The same as arrays, without pickles; and the positions of the joints, (F, n + 1, 3)."""
    captures = motion.model.captures
    arrays: dict[str, Any] = {
        "frame": np.array([item.name for item in captures], dtype=np.str_),
        "time": np.full(len(captures), np.nan) if motion.times is None else motion.times,
        "base_position": motion.base_positions,
        "base_quaternion": motion.quaternions,
        "joint_names": np.array(hinge_names, dtype=np.str_),
        "joint_values": motion.values.reshape(len(captures), -1),
        "joint_positions": motion.model.joints,
        "error": motion.model.deviation,
        "state": np.array(motion.states, dtype=np.str_),
    }
    data = io.BytesIO()
    np.savez(data, **arrays)
    return data.getvalue()
