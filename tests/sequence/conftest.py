"""Fixture: `result_for`."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dlogen.config.schema import Config, JointSettings
from dlogen.sequence.trajectory import Motion
from dlogen.types import Result


@pytest.fixture(scope="module")
def result_for(make_result, straight):
    """The result of a recording, by its motion and settings of the joints."""
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    def make(motion: Motion, **joints) -> Result:
        config = Config(joints=JointSettings(base="floating", **joints)).to_dict()
        return replace(template, chain=motion.chain, settings=config, recorded=motion.poses(), name="hose")

    return make
