"""Options about a simulated sensor: which sensors there are, what goes together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from dlogen.cli.main import cli
from dlogen.cli.sensor_options import SENSOR_NAMES, cuts_out, seen
from dlogen.evaluation.camera import capture
from dlogen.evaluation.sensors.models import SENSORS
from dlogen.evaluation.shapes import hose_centre_line

ROPE = hose_centre_line(0.6, 0.05)


def test_the_names_are_those_of_the_sensors() -> None:
    assert tuple(SENSORS) == SENSOR_NAMES


def test_kinect_v1_alone_is_the_camera_of_the_papers_experiment() -> None:
    hose = hose_centre_line()
    cloud, background, line = seen("kinect-v1", hose, 0.02, np.random.default_rng(3), {})
    as_before = capture(hose, 0.02, np.random.default_rng(3))
    np.testing.assert_array_equal(cloud.points, as_before.scene.points)
    assert background is not None
    np.testing.assert_array_equal(background.points, as_before.background.points)
    np.testing.assert_array_equal(line.points(10), as_before.line.points(10))


@pytest.mark.parametrize(
    ("sensing", "alone"),
    [
        ({}, False),
        ({"tilt": 10.0, "frames": 3, "holes": 0.1, "world": True}, False),
        ({"mask_grow": 0.0}, True),
        ({"views": 2, "registration": 0.002}, True),
        ({"voxel": 0.005, "voxel_centre": True}, True),
    ],
)
def test_a_background_goes_with_the_whole_scene_only(sensing: dict[str, Any], alone: bool) -> None:
    cloud, background, _ = seen("kinect-v2", ROPE, 0.01, np.random.default_rng(0), sensing)
    assert cuts_out(sensing) == alone == (background is None)
    assert cloud.organised != alone


def test_the_centre_of_a_voxel() -> None:
    options = {"voxel": 0.005, "voxel_centre": True, "world": True}
    cloud, _, _ = seen("zed2", ROPE, 0.01, np.random.default_rng(0), options)
    np.testing.assert_allclose(cloud.points / 0.005 % 1.0, 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--tilt", "10"], "--tilt is the camera's"),
        (["--mask-grow", "1", "--world"], "--mask-grow and --world are the camera's"),
        (["--camera", "zed2", "--registration", "0.01"], "--views"),
        (["--camera", "zed2", "--voxel-centre"], "--voxel METRES"),
        (["--camera", "zed2", "--tilt", "80"], "--tilt"),
        (["--camera", "zed2", "--holes", "1"], "--holes"),
        (["--camera", "zed2", "--views", "0"], "--views"),
        (["--camera", "zed2", "--distance", "0.25"], "depths"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path: Path, arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(cli, ["synth", "hose", "-o", str(tmp_path / "out" / "c.ply"), *arguments])
    assert result.exit_code == 2, result.stderr
    assert words in result.stderr and "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()
