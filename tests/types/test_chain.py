"""What a chain and a segmentation know of themselves."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.chain import build_chain
from dlogen.stages.segmentation.joints import place_joints
from dlogen.types import Segmentation


def test_lengths_and_counts(straight) -> None:
    joints = place_joints(straight([0, 0, 0], [0, 0, 1.0]), 0.3)
    chain = build_chain(joints, 0.01)
    assert chain.lengths == pytest.approx(np.array([0.3, 0.3, 0.3, 0.1]))
    assert chain.length == pytest.approx(1.0)
    assert type(chain.length) is float
    # n segments between n + 1 joints.
    assert Segmentation("paper", "on-curve", joints, 0.0, 0.0).count == 4 == len(chain.joints) - 1
