"""What `dlogen info` says of a cloud."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.inspect import inspect
from dlogen.io.cloud_files import read_cloud, write_cloud
from dlogen.pipeline import fit
from dlogen.stages.clean import clean
from dlogen.types import Cloud


@pytest.fixture(scope="module")
def cloud(tube: SyntheticCloud) -> Cloud:
    """5,000 points of a tube of radius 15 mm, no file."""
    return clean(tube.points)


def test_size_and_place(cloud: Cloud) -> None:
    found = inspect(cloud)
    points = cloud.points
    assert found["minimum"] == pytest.approx(points.min(axis=0))
    assert found["maximum"] == pytest.approx(points.max(axis=0))
    assert found["extent"] == pytest.approx(np.ptp(points, axis=0))
    assert (found["points"], found["far_away"], found["problem"]) == (5000, 0, None)
    assert found["dropped"] == {"non_finite": 0, "duplicates": 0}
    assert found["units"] == {"guess": "m", "used": "m", "given": False}
    assert (found["name"], found["format"], found["organised"]) == (None, None, None)
    assert found["normals"] is False and found["viewpoint"] is None


def test_it_chooses_what_a_fit_chooses(cloud: Cloud) -> None:
    chosen = inspect(cloud)["chosen"]
    made = fit(cloud, {"profile": "paper"}).config
    assert chosen["r"] == pytest.approx(made.r, rel=1e-9)
    assert chosen["r_n"] == pytest.approx(made.r_n, rel=1e-9)
    assert chosen["e_max"] == pytest.approx(made.e_max, rel=1e-9)
    assert (chosen["N"], chosen["normals.neighbours"]) == (made.N, made.normals.neighbours)
    # And this is near the truth, so that both are not wrong together.
    assert chosen["r"] == pytest.approx(0.015, rel=0.05)


@pytest.mark.parametrize(("units", "scale"), [("mm", 1000.0), ("cm", 100.0)])
def test_lengths_are_metres_whatever_the_cloud_has(cloud: Cloud, units: str, scale: float) -> None:
    viewpoint = np.array([1.0, 2.0, 3.0])
    large = replace(cloud, points=scale * cloud.points, viewpoint=scale * viewpoint)
    found, expected = inspect(large, units), inspect(cloud)
    assert found["units"]["used"] == units and found["units"]["given"] is True
    assert found["viewpoint"] == pytest.approx(viewpoint)
    for key in ("minimum", "maximum", "extent"):
        assert found[key] == pytest.approx(expected[key])
    # Rounding may let the estimate look at other neighbours.
    assert found["chosen"]["r"] == pytest.approx(expected["chosen"]["r"], rel=1e-3)
    # The guess is about the cloud, not what was given.
    assert inspect(cloud, units)["units"] == {"guess": "m", "used": units, "given": True}


def test_points_that_mark_missing_data_do_not_count(cloud: Cloud) -> None:
    marked = replace(cloud, points=np.vstack([cloud.points, [[1e10, 1e10, 1e10]] * 3]))
    found = inspect(marked)
    assert (found["points"], found["far_away"]) == (5003, 3)
    assert found["extent"] == pytest.approx(np.ptp(cloud.points, axis=0))
    assert found["chosen"]["r"] == pytest.approx(inspect(cloud)["chosen"]["r"])


def test_of_a_file(cloud: Cloud, tmp_path) -> None:
    path = tmp_path / "tube.ply"
    write_cloud(path, cloud.points)
    found = inspect(read_cloud(path))
    assert (found["name"], found["format"], found["declared_points"]) == ("tube.ply", "ply", 5000)
    assert found["encoding"] and found["fields"] == ["x", "y", "z"]


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (np.eye(3), "3 points are too few"),
        (np.random.default_rng(1).random((100, 3)) * [1.0, 1.0, 0.0], "the cloud is flat: z"),
    ],
)
def test_why_a_cloud_cannot_be_fitted(points: np.ndarray, problem: str) -> None:
    found = inspect(clean(points))
    assert found["problem"].startswith(problem)
    assert "chosen" not in found and "scale" not in found
    assert found["points"] == len(points)


def test_it_is_json_whatever_is_in_the_cloud(cloud: Cloud) -> None:
    for item in (cloud, clean(np.eye(3)), replace(cloud, points=cloud.points[:40])):
        assert json.loads(json.dumps(inspect(item), allow_nan=False))["schema"] == "dlogen.info/1"
