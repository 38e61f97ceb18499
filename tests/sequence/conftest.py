"""Fixtures: `result_for` and `fitted`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dlogen.batch.job import Plan, Task, run_job
from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.config.sections import JointSettings
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud
from dlogen.io.outputs import Outputs
from dlogen.sequence.trajectory import Motion
from dlogen.types import FitData


@pytest.fixture(scope="module")
def result_for(make_result, straight):
    """The result of a recording, by its motion and settings of the joints."""
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    def make(motion: Motion, **joints) -> FitData:
        config = Config(joints=JointSettings(base="floating", **joints))
        return replace(template, chain=motion.chain, config=config, recorded=motion.poses(), name="hose")

    return make


@pytest.fixture(scope="session")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a batch with the fit of one cloud, whose key is sub/b."""
    folder = tmp_path_factory.mktemp("fits")
    write_cloud(folder / "b.ply", sample_tube(random_centre_line(1, clearance=0.08), 0.015, 600, 1).points)
    config = load_config(None, ["profile=paper", "mdtw.samples=50"])
    outcome = run_job(Plan(str(folder), config, outputs=Outputs(("json",))), Task(str(folder / "b.ply"), "sub/b"))
    assert outcome.failure is None
    return folder
