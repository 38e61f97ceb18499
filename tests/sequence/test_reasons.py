"""The codes in the report of a recording are explained."""

from __future__ import annotations

import ast

import pytest
from places import ROOT

from dlogen.sequence.reasons import REASONS

FOLDER = ROOT / "dlogen" / "sequence"
#: What holds a code, as its first value.
HOLDERS = {"Exclusion", "Doubt"}


def nodes() -> list[ast.AST]:
    paths = sorted(set(FOLDER.glob("*.py")) - {FOLDER / "reasons.py", FOLDER / "plot.py"})
    return [node for path in paths for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def words(node: ast.AST) -> set[str]:
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)}


def test_every_reason_that_is_given_is_declared() -> None:
    calls = [node for node in nodes() if isinstance(node, ast.Call) and getattr(node.func, "id", "") in HOLDERS]
    assert len(calls) >= 6
    given = set().union(*(words(call.args[0]) for call in calls))
    assert {"motion", "failed", "doubtful", "noise", "sizes", "direction"} <= given <= set(REASONS)


@pytest.mark.parametrize("code", REASONS)
def test_every_reason_that_is_declared_is_given(code: str) -> None:
    assert any(isinstance(node, ast.Constant) and node.value == code for node in nodes())


def test_they_are_those_of_sequences() -> None:
    assert {item.where for item in REASONS.values()} == {"sequence"}
    assert all(item.code == code and item.severities == () for code, item in REASONS.items())
