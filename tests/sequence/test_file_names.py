"""Names of the files beside the models."""

from __future__ import annotations

from dlogen.sequence.file_names import MODEL, file_names


def test_recordings_and_poses_have_names_of_their_own() -> None:
    assert file_names(True, False) == ("trajectory.csv", "trajectory.npz", "sequence.json")
    assert file_names(False, False) == ("poses.csv", "poses.npz", "one_model.json")


def test_a_picture_comes_last_and_only_if_there_is_to_be_one() -> None:
    assert file_names(True, True) == (*file_names(True, False), "sequence.png")
    assert file_names(False, True) == (*file_names(False, False), "one_model.png")
    assert MODEL not in {name.partition(".")[0] for name in file_names(True, True) + file_names(False, True)}
