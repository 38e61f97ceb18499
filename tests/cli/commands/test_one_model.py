"""`dlogen batch --one-model`: clouds of one object in no order."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner
from moving import LENGTH, RADIUS, line, loop

from dlogen.cli.main import cli
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud


@pytest.fixture(scope="module")
def clouds(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("clouds")
    angles, middle = loop()
    for name, t in (("a", 0.0), ("b/c", 0.6), ("d", 1.3)):
        (folder / name).parent.mkdir(exist_ok=True)
        write_cloud(
            folder / f"{name}.ply", sample_tube(line(angles, t, middle(t)), RADIUS, 1500, 3, noise=0.0005).points
        )
    (folder / "e.ply").write_bytes(b"")
    return folder


def test_one_model(clouds, tmp_path) -> None:
    out = tmp_path / "out"
    call = ["batch", str(clouds), "-o", str(out), "-j", "2", "--one-model", "--format", "urdf,mjcf"]
    result = CliRunner().invoke(cli, [*call, "--set", "segmentation.segments=10"])
    assert result.exit_code == 1, "a cloud failed"
    assert "e has no pose" in result.stderr and "4 clouds, 3 good" in result.stderr

    report = json.loads((out / "one_model" / "one_model.json").read_text())
    assert report["common"]["length"] == pytest.approx(LENGTH, abs=0.003)
    assert report["common"]["segment_count"] == 10
    assert [item["state"] for item in report["frames"]] == ["good", "good", "none", "good"]
    assert report["time"]["source"] is None
    with (out / "one_model" / "poses.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["frame"] for row in rows] == ["a", "d", "e", "b/c"]
    assert rows[2]["x"] == "" and rows[2]["reason"] == "failed" and not any(row["time"] for row in rows)

    joints = np.load(out / "one_model" / "poses.npz")["joint_positions"]
    model = mujoco.MjModel.from_xml_path(str(out / "one_model" / "model.xml"))
    data = mujoco.MjData(model)
    for name, expected in zip(("a", "d", "b/c"), joints[[0, 1, 3]], strict=True):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_kinematics(model, data)
        assert np.vstack([data.xpos[1:], data.site("tip").xpos]) == pytest.approx(expected, abs=1e-6)
    # Each cloud has its own model as well.
    assert (out / "b" / "c.urdf").exists()

    again = CliRunner().invoke(cli, [*call, "--set", "segmentation.segments=10"])
    assert again.exit_code == 1 and "are done already" in again.stderr


def test_what_is_there_is_not_overwritten(clouds, tmp_path) -> None:
    (tmp_path / "one_model").mkdir()
    result = CliRunner().invoke(cli, ["batch", str(clouds / "a.ply"), "-o", str(tmp_path), "--one-model"])
    assert result.exit_code == 2 and "output exists" in result.stderr
