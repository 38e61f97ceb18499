"""The files that say how the project is built and checked agree with each other; tests have the marks they need."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import ROOT

from dlogen import __version__

TESTS = ROOT / "tests"
PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
#: What the extra `oracles` makes importable.
ORACLES = ("pinocchio", "pydrake", "yourdfpy")


def requirements(key: str) -> dict[str, str]:
    """Names and lowest versions in a list of pyproject.toml (Python 3.10 cannot read TOML)."""
    (block,) = re.findall(rf"^{key} = \[(.*?)\]$", PYPROJECT, re.MULTILINE | re.DOTALL)
    return dict(re.findall(r'"([\w-]+)>=([\d.]+)', block))


def parts(version: str) -> tuple[int, ...]:
    numbers = [int(part) for part in version.split(".")]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def test_the_lowest_versions_are_those_of_pyproject() -> None:
    allowed = requirements("dependencies") | requirements("plots") | requirements("distributed")
    lines = (ROOT / ".ci" / "lowest.txt").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert {name: parts(version) for name, version in pinned.items()} == {
        name.lower(): parts(version) for name, version in allowed.items()
    }
    assert len(pinned) >= 9


def test_the_extra_for_tests_has_no_heavy_engine() -> None:
    small, heavy = requirements("test"), requirements("oracles")
    assert {"pytest", "mujoco-core", "hypothesis", "ruff", "mypy"} <= set(small)
    assert set(heavy) == {"yourdfpy", "pin", "drake"}
    assert not set(small) & set(heavy)


def test_ci_runs_every_python_that_the_package_names() -> None:
    named = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', PYPROJECT)
    workflow = load(".github/workflows/ci.yml")
    (job,) = workflow["jobs"].values()
    matrix = job["strategy"]["matrix"]
    assert matrix["python"] == named == [f"3.{minor}" for minor in range(10, 15)]
    assert {row["dependencies"] for row in matrix["include"]} | set(matrix["dependencies"]) == {"newest", "lowest"}
    assert job["steps"][-1] == {"run": ".ci/run"}
    assert f'requires-python = ">={named[0]}"' in PYPROJECT


def test_the_citation_has_the_version() -> None:
    citation = load(".github/CITATION.cff")
    assert citation["version"] == __version__
    assert {"cff-version", "message", "title", "authors", "license"} <= set(citation)


def test_the_changelog_has_the_version() -> None:
    titles = re.findall(r"^## (\S+)", (ROOT / "dlogen" / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert titles[0] == "Unreleased" and __version__ in titles


@pytest.mark.parametrize("form", ["bug", "feature"])
def test_issue_forms_are_whole(form: str) -> None:
    content = load(f".github/ISSUE_TEMPLATE/{form}.yml")
    assert content["name"] and content["description"]
    fields = [item for item in content["body"] if item["type"] != "markdown"]
    assert len({item["id"] for item in fields}) == len(fields) >= 3
    assert all(item["attributes"]["label"] for item in fields)
    assert form != "bug" or any("dlogen info" in str(item["attributes"]) for item in fields)


def test_pre_commit_runs_what_ci_runs() -> None:
    (local,) = load(".pre-commit-config.yaml")["repos"]
    assert [hook["id"] for hook in local["hooks"]] == ["ruff", "ruff-format", "mypy"]


def test_tests_of_heavy_engines_have_the_mark() -> None:
    found = list(uses_of_oracles())
    assert len(found) >= 9
    assert [where for where, marked in found if not marked] == []


def uses_of_oracles() -> Iterator[tuple[str, bool]]:
    """Test functions that ask for an engine of the extra, and whether they have the mark; anything else that does."""
    for path in TESTS.rglob("test_*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in tree.body:
            if not any(asks(inner) for inner in ast.walk(node)):
                continue
            where = f"{path.relative_to(ROOT)}:{node.lineno}"
            if isinstance(node, ast.FunctionDef):
                yield where, any("pytest.mark.oracle" in ast.unparse(item) for item in node.decorator_list)
            elif isinstance(node, ast.ClassDef):
                # A helper: the parameter of the fixture that makes it has the mark.
                yield where, f'pytest.param("{node.name.lower()}", marks=pytest.mark.oracle)' in path.read_text("utf-8")
            else:
                yield where, False


def asks(node: ast.AST) -> bool:
    """Whether it imports an engine of the extra."""
    if isinstance(node, ast.Import):
        names = [item.name for item in node.names]
    elif isinstance(node, ast.ImportFrom):
        names = [node.module or ""]
    elif isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.importorskip":
        names = [str(item.value) for item in node.args if isinstance(item, ast.Constant)]
    else:
        return False
    return any(name.split(".")[0] in ORACLES for name in names)


def load(name: str) -> dict[str, Any]:
    content = yaml.safe_load(Path(ROOT / name).read_text(encoding="utf-8"))
    assert isinstance(content, dict)
    return content
