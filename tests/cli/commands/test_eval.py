"""`dlogen eval` on tables that are given: what it prints, writes and exits with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dlogen.cli.main import cli
from dlogen.evaluation.paper_tables import Figure

GOOD = Figure("II", "bent", "MDTW mean", "mm", 1.25, paper=1.5, high=2.0)
BAD = Figure("robustness", "noise", "mean distance", "mm", 0.5, high=0.25)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Tables of one figure each; and with what they were asked for."""
    seen: dict[str, Any] = {}

    def table(name: str, figures: list[Figure]) -> Any:
        def measured(*arguments: int) -> list[Figure]:
            seen[name] = arguments
            return figures

        return measured

    monkeypatch.setattr("dlogen.evaluation.paper_tables.table_2", table("II", [GOOD]))
    third = Figure("III", "hose", "n", "", 16, 16, 15, 17)
    monkeypatch.setattr("dlogen.evaluation.paper_tables.table_3", table("III", [third]))
    monkeypatch.setattr("dlogen.evaluation.robustness.robustness", table("robustness", [BAD]))
    return seen


def run(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["eval", *arguments])


def test_all_tables_with_the_seeds_asked_for(asked: dict[str, Any]) -> None:
    run("--seeds", "3", "--seed", "7")
    assert asked == {"II": (3, 7), "III": (7,), "robustness": (3, 7)}
    asked.clear()
    run("--table", "III")
    assert asked == {"III": (0,)}


def test_a_figure_outside_its_bound_exits_with_1(asked: dict[str, Any]) -> None:
    good = run("--table", "II", "--table", "III", "--json")
    assert good.exit_code == 0
    data = json.loads(good.stdout)
    assert (data["schema"], data["ok"], len(data["figures"])) == ("dlogen.evaluation/1", True, 2)
    assert data["figures"][0]["measured"] == 1.25
    bad = run("--table", "robustness", "--json")
    assert bad.exit_code == 1
    assert json.loads(bad.stdout)["ok"] is False
    assert "outside the bound: noise mean distance" in bad.stderr


def test_the_lines_say_which(asked: dict[str, Any]) -> None:
    lines = run().stdout.splitlines()
    assert len(lines) == 4
    assert lines[1].split() == ["II", "bent", "MDTW", "mean", "1.5", "1.25", "<=", "2", "mm"]
    assert lines[2].split() == ["III", "hose", "n", "16", "16", "15", "..", "17"]
    assert [line.endswith("WORSE") for line in lines] == [False, False, False, True]


def test_pictures_are_not_overwritten(asked: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    arguments = ["--table", "II", "--plot", str(tmp_path)]
    assert run(*arguments).exit_code == 0
    (path,) = tmp_path.iterdir()
    assert path.name == "table_II.png"
    path.write_bytes(b"mine")
    assert run(*arguments).exit_code == 2
    assert path.read_bytes() == b"mine"
    assert run(*arguments, "--force").exit_code == 0
    assert path.read_bytes().startswith(b"\x89PNG")
