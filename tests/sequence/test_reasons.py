"""The codes in the report of a recording are explained."""

from __future__ import annotations

import ast

import pytest
from places import ROOT

from dlogen.sequence import reasons
from dlogen.sequence.reasons import REASONS
from dlogen.stages.quality.findings import Explanation

FOLDER = ROOT / "dlogen" / "sequence"
#: What holds a code, as its first value.
HOLDERS = {"Exclusion", "Doubt"}


def nodes() -> list[ast.AST]:
    paths = sorted(set(FOLDER.glob("*.py")) - {FOLDER / "reasons.py"})
    return [node for path in paths for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def test_no_reason_goes_round_the_registry() -> None:
    calls = [node for node in nodes() if isinstance(node, ast.Call) and getattr(node.func, "id", "") in HOLDERS]
    assert len(calls) >= 6
    for call in calls:
        code = call.args[0]
        assert isinstance(code, ast.Attribute) and code.attr == "code", ast.unparse(call)


@pytest.mark.parametrize("name", [name for name, item in vars(reasons).items() if isinstance(item, Explanation)])
def test_every_reason_that_is_declared_is_given(name: str) -> None:
    assert any(isinstance(node, ast.Name) and node.id == name for node in nodes())


def test_they_are_those_of_sequences() -> None:
    assert {item.where for item in REASONS.values()} == {"sequence"}
    assert all(item.code == code and item.severities == () for code, item in REASONS.items())
