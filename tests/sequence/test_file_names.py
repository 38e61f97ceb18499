"""Names of the files of a recording."""

from __future__ import annotations

from dlogen.sequence.file_names import file_names


def test_recordings_and_clouds_in_no_order() -> None:
    assert file_names(in_time=True, plot=False) == ("trajectory.csv", "trajectory.npz", "sequence.json")
    assert file_names(in_time=False, plot=True) == ("poses.csv", "poses.npz", "one_model.json", "one_model.png")
