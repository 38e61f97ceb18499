"""Models of motions."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dlogen.config.schema import Config
from dlogen.config.sections import JointSettings
from dlogen.sequence.trajectory import Motion
from dlogen.types import Result


@pytest.fixture(scope="module")
def result_for(make_result, straight):
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    def make(motion: Motion, **joints) -> Result:
        config = Config(joints=JointSettings(base="floating", **joints))
        return replace(template, chain=motion.chain, config=config, recorded=motion.poses(), name="hose")

    return make
