"""`dlogen info`: what is in a cloud, and what a fit would choose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from node_lines import WAVE, even
from swept_meshes import elbow

from dlogen.cli.main import cli
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud
from dlogen.types import RawCloud

CLOUD = sample_tube(centre_line("bent"), 0.02, 4000, np.random.default_rng(8)).points


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["info", *map(str, arguments)])


@pytest.mark.parametrize(("scale", "units"), [(1.0, "m"), (100.0, "mm"), (1000.0, "mm")])
def test_estimates(tmp_path: Path, scale: float, units: str) -> None:
    write_cloud(tmp_path / "a.ply", CLOUD * scale)
    found = json.loads(run(tmp_path / "a.ply", "--json").stdout)
    assert found["units"]["guess"] == units
    if scale != 100.0:
        assert found["chosen"]["r"] == pytest.approx(0.02, rel=0.03)
        assert found["extent"] == pytest.approx(np.ptp(CLOUD, axis=0).tolist(), rel=1e-6)
        assert found["chosen"]["r_n"] > 2 * found["chosen"]["r"]
        assert found["chosen"]["e_max"] == pytest.approx(found["chosen"]["r"] / 2)
    assert found["points"] == 4000
    assert found["problem"] is None


def test_counts_and_fields(tmp_path: Path) -> None:
    points = np.vstack([CLOUD, CLOUD[:7], np.full((5, 3), np.nan)])
    pose = np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0])
    write_cloud(tmp_path / "a.pcd", RawCloud(points, viewpoint=pose, width=len(points)))
    found = json.loads(run(tmp_path / "a.pcd", "--json").stdout)
    assert found["dropped"] == {"non_finite": 5, "duplicates": 7}
    assert (found["declared_points"], found["points"]) == (4012, 4000)
    assert found["format"] == "pcd" and found["fields"] == ["x", "y", "z"]
    assert found["viewpoint"] == pytest.approx([0.1, 0.2, 0.3])


def test_a_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(elbow(0.02, 0.5, 0.1).ply())
    found = json.loads(run(tmp_path / "a.ply", "--json").stdout)
    assert found["mesh"]["triangles"] == 1088 and found["mesh"]["sampled"] > 10_000
    assert (found["points"], found["problem"]) == (576, None)
    # The vertices are in two clumps, which tell no radius.
    assert found["chosen"]["r"] == pytest.approx(0.02, rel=0.03)
    text = run(tmp_path / "a.ply").stdout
    assert f"1088 triangles; a fit spreads {found['mesh']['sampled']} points over them" in text


def test_nodes_on_the_axis(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", even(WAVE, 40))
    found = json.loads(run(tmp_path / "a.ply", "--json").stdout)
    assert found["nodes"] is True and found["problem"] is None and "chosen" not in found
    assert "the points lie on a line and show no width" in run(tmp_path / "a.ply").stdout
    write_cloud(tmp_path / "b.ply", CLOUD)
    assert json.loads(run(tmp_path / "b.ply", "--json").stdout)["nodes"] is False


def test_few_digits(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", (CLOUD + np.array([1e5, 0.0, 0.0])).astype(np.float32))
    found = json.loads(run(tmp_path / "a.ply", "--json").stdout)
    assert found["steps"] == [pytest.approx(2.0**-7), 0.0, 0.0]
    assert "digits                 x is stored in steps of 7.81 mm at 1e+05" in run(tmp_path / "a.ply").stdout
    write_cloud(tmp_path / "b.ply", (CLOUD + np.array([5e6, 0.0, 0.0])).astype(np.float32))
    found = json.loads(run(tmp_path / "b.ply", "--json").stdout)
    assert "single precision" in found["problem"]


def test_for_people(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", CLOUD)
    result = run(tmp_path / "a.ply")
    assert result.exit_code == 0 and result.stderr == ""
    rows = dict(line.split(maxsplit=1) for line in result.stdout.splitlines())
    assert rows["points"] == "4000 of 4000"
    assert float(rows["r"].split()[0]) == pytest.approx(20.0, rel=0.03)
    assert rows["units"] == "m"


def test_markers_of_missing_data_are_counted(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", np.vstack([CLOUD, [1e10, 0.0, 0.0]]))
    out = run(tmp_path / "a.ply").stdout
    assert "very far away          1 (left out)\n" in out and "units                  m\n" in out


def test_guessed_units_say_what_a_fit_needs(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", CLOUD * 1000)
    assert "mm (a guess; fit with --set units=mm)\n" in run(tmp_path / "a.ply").stdout
    assert "units                  mm\n" in run(tmp_path / "a.ply", "--units", "mm").stdout
    assert "m (looks like mm)\n" in run(tmp_path / "a.ply", "--units", "m").stdout


def test_a_cloud_that_cannot_be_fitted_is_shown_with_the_reason(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", CLOUD * [1, 1, 0])
    result = run(tmp_path / "a.ply", "--json")
    assert result.exit_code == 0
    assert "flat" in json.loads(result.stdout)["problem"]


def test_a_file_that_is_none(tmp_path: Path) -> None:
    result = run(tmp_path / "nothing.ply")
    assert result.exit_code == 2 and "hint:" in result.stderr
