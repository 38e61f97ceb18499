"""Small clouds, and a plan that is quick."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlogen.batch.job import Plan
from dlogen.config.reader import load_config
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud
from dlogen.io.outputs import Outputs


@pytest.fixture(scope="session")
def clouds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """Four clouds of 400 points."""
    folder = tmp_path_factory.mktemp("clouds")
    paths = tuple(folder / f"c{i}.ply" for i in range(4))
    for i, path in enumerate(paths):
        write_cloud(path, sample_tube(random_centre_line(i, clearance=0.08), 0.015, 400, i).points)
    return paths


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    """The paper's profile, and few samples for the comparison; the results go to the folder `out`."""
    config = load_config(None, ["profile=paper", "mdtw.samples=50"])
    return Plan(str(tmp_path / "out"), config, outputs=Outputs(("json",)))
