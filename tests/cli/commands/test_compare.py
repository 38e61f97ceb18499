"""`dlogen compare` from the outside: what is printed, and exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dlogen.cli.main import cli
from dlogen.evaluation.comparison import compare
from dlogen.io.curves.curve import load_curve


def run(*arguments: object, stdin: bytes | None = None) -> Result:
    return CliRunner().invoke(cli, ["compare", *map(str, arguments)], input=stdin)


@pytest.fixture
def line(tmp_path: Path) -> Path:
    """1 m along x."""
    path = tmp_path / "line.csv"
    path.write_text("x,y,z\n0,0,0\n1,0,0\n")
    return path


@pytest.fixture
def beside(tmp_path: Path) -> Path:
    """The same 4 mm above and 20 mm shorter, from its end to its start."""
    path = tmp_path / "beside.json"
    points = [[0.98, 0, 0.004], [0.5, 0, 0.004], [0, 0, 0.004]]
    path.write_text(json.dumps({"schema": "dlogen.truth/1", "units": "m", "points": points}))
    return path


def test_table_for_people(line: Path, beside: Path) -> None:
    result = run(line, beside)
    assert result.exit_code == 0
    assert result.stderr == ""
    rows = {row[:18].strip(): row[19:].strip() for row in result.stdout.splitlines()}
    assert rows["A"] == f"{line} (csv, 2 vertices)"
    assert rows["B"] == f"{beside} (truth, 3 vertices), taken from its end to its start"
    assert rows["sampling"] == "1000 points on each, even arc length"
    assert rows["length of A"] == "1000.000 mm"
    assert rows["length of B"] == "980.000 mm"
    assert rows["A less B"] == "20.000 mm (+2.04 %)"
    assert rows["Hausdorff distance"] == f"{1e3 * np.hypot(0.02, 0.004):.3f} mm"
    assert rows["MDTW max"] == f"{1e3 * np.hypot(0.02, 0.004):.3f} mm at s = 1.000 of A"
    assert 4.0 <= float(rows["MDTW mean"].split()[0]) < 5.0


def test_json_is_what_compare_returns_with_the_names(line: Path, beside: Path) -> None:
    result = run(line, beside, "--json", "--samples", 300)
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["schema"] == "dlogen.compare/1"
    assert found["a"] == {"name": str(line), "kind": "csv", "vertices": 2}
    assert found["b"] == {"name": str(beside), "kind": "truth", "vertices": 3}
    expected = compare(load_curve(line).points, load_curve(beside).points, 300)
    assert {key: found[key] for key in expected} == expected
    assert found["reversed"] is True
    assert 0.004 <= found["mean"] < 0.005
    assert run(line, beside, "--json", "--samples", 300).stdout == result.stdout


def test_direction_can_be_kept(line: Path, beside: Path) -> None:
    kept = json.loads(run(line, beside, "--keep-direction", "--json").stdout)
    assert kept["reversed"] is False
    assert kept["mean"] > 0.1


def test_fail_above(line: Path, beside: Path) -> None:
    assert run(line, beside, "--fail-above", 0.021).exit_code == 0
    result = run(line, beside, "--fail-above", 0.020)
    assert result.exit_code == 1
    assert "MDTW max" in result.stdout
    assert result.stderr.startswith("error: the largest error is 20.396 mm, above the 20.000 mm allowed")
    assert run(line, line, "--fail-above", 0).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-", "-"], "stdin"),
        (["--", "-", "-#skeleton"], "stdin"),
        (["LINE", "nowhere.json"], "nowhere.json"),
        (["LINE", "LINE", "--samples", "1"], "--samples"),
        (["LINE", "LINE", "--samples", "1000000"], "--samples"),
        (["LINE", "LINE", "--fail-above", "nan"], "--fail-above"),
        (["LINE", "LINE", "--fail-above", "-1"], "--fail-above"),
        (["LINE"], "B"),
        (["LINE", "LINE#skeleton"], "skeleton"),
    ],
)
def test_what_cannot_be_done_is_refused(line: Path, arguments: list[str], words: str) -> None:
    result = run(*(word.replace("LINE", str(line)) for word in arguments))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert words in result.stderr
    assert "Traceback" not in result.stderr


def test_stdin(line: Path) -> None:
    result = run("-", line, "--json", stdin=line.read_bytes())
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert (found["a"]["name"], found["max"]) == ("stdin", 0.0)


def test_millimetres_are_pointed_out(line: Path, tmp_path: Path) -> None:
    other = tmp_path / "mm.csv"
    other.write_text("0,0,0\n1000,0,0\n")
    result = run(line, other)
    assert result.exit_code == 0
    assert "warning: one curve is 1000 times as long" in result.stderr
    assert run(line, other, "-q").stderr == ""
