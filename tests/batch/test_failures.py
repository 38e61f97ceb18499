"""The codes of failures in the records of a batch are explained."""

from __future__ import annotations

import ast

import pytest
from places import ROOT

from dlogen.batch import failures
from dlogen.batch.failures import FAILURES
from dlogen.batch.job import failure_of
from dlogen.errors import ConfigError, DlogenError, FitError, InputError, OutputError
from dlogen.stages.quality.findings import Explanation

FOLDER = ROOT / "dlogen" / "batch"


def nodes() -> list[ast.AST]:
    paths = sorted(set(FOLDER.rglob("*.py")) - {FOLDER / "failures.py"})
    return [node for path in paths for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def test_no_failure_goes_round_the_registry() -> None:
    calls = [node for node in nodes() if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Failure"]
    assert len(calls) >= 6
    written = [call.args[0] for call in calls if not (isinstance(call.args[0], ast.Name) and call.args[0].id == "code")]
    for code in written:
        assert isinstance(code, ast.Attribute) and code.attr == "code", ast.unparse(code)


@pytest.mark.parametrize("error", [InputError, ConfigError, FitError, OutputError, DlogenError])
def test_errors_are_recorded_by_codes_that_are_declared(error: type[DlogenError]) -> None:
    assert failure_of(error("it broke")).code in FAILURES


@pytest.mark.parametrize("name", [name for name, item in vars(failures).items() if isinstance(item, Explanation)])
def test_every_failure_that_is_declared_is_recorded(name: str) -> None:
    assert any(isinstance(node, ast.Name) and node.id == name for node in nodes())


def test_they_are_those_of_batches() -> None:
    assert {item.where for item in FAILURES.values()} == {"batch"}
    assert all(item.code == code and item.severities == () for code, item in FAILURES.items())
