"""The types of the chain: what they count and add up."""

from __future__ import annotations

import numpy as np

from dlogen.types import Chain, Frame, Joints, Pose, Segmentation


def test_segments_are_one_less_than_joints() -> None:
    for count in (1, 2, 17):
        joints = Joints(np.linspace(0, 1, count + 1), np.zeros((count + 1, 3)), 0.1, 0.05)
        assert Segmentation("paper", "on-curve", joints, 0.0, 0.0).count == count


def test_the_length_of_a_chain_is_that_of_its_segments() -> None:
    chain = Chain(np.zeros((4, 3)), np.zeros(4), np.zeros((3, 4, 4)), np.array([0.5, 0.5, 0.25]), 0.01)
    assert chain.length == 1.25
    assert type(chain.length) is float


def test_the_frame_of_a_cloud_is_its_own_unless_moved() -> None:
    frame, other = Frame(), Frame()
    assert np.array_equal(frame.transform, np.eye(4))
    assert frame.name
    # One's transform is not the other's.
    frame.transform[0, 3] = 1.0
    assert other.transform[0, 3] == 0.0


def test_a_pose_outside_of_recordings_has_no_time() -> None:
    assert Pose("scanned", np.zeros(3), np.eye(3), np.zeros((2, 2))).time is None
