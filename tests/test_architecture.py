"""The rooms of the package and which of them may know which, held by reading the imports."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from places import ROOT

PACKAGE = ROOT / "dlogen"

#: A room may import from those above it in this list, and from itself. Rooms on one line do not know each other.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("errors", "_version"),
    ("config",),
    ("types",),
    ("geometry",),
    ("stages", "multibody"),
    ("io",),
    ("pipeline",),
    ("inspect", "evaluation"),
    ("batch",),
    ("sequence",),
    ("cli",),
)
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}

#: What the core has to do without: it knows no files, no command line and no pictures.
CORE = ("types", "geometry", "stages", "multibody", "pipeline")
NOT_IN_CORE = {"click", "yaml", "rich", "matplotlib", "plyfile", "trimesh", "pathlib", "json"}

#: The front door and `python -m dlogen` stand outside of the rooms.
_OUTSIDE = {"dlogen", "dlogen.__main__"}


@cache
def modules() -> dict[str, Path]:
    """All modules of the package by their names."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(module: str) -> Iterator[str]:
    """What a module imports, wherever it does: at its top, in a function, for types only."""
    for node in ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} has a relative import"
            assert node.module is not None
            for alias in node.names:
                below = f"{node.module}.{alias.name}"
                yield below if below in modules() else node.module


@cache
def graph() -> dict[str, set[str]]:
    """Which modules of the package each of them imports."""
    return {name: {other for other in imported(name) if other in modules()} - {name} for name in modules()}


def room(module: str) -> str:
    """The room of a module: the first part of its name below the package."""
    return module.split(".")[1]


def test_every_module_is_in_a_room_of_the_plan() -> None:
    assert {room(name) for name in modules() if name not in _OUTSIDE} == set(FLOOR)


def test_few_modules_stand_in_the_hall() -> None:
    assert len(list(PACKAGE.glob("*.py"))) <= 6


@pytest.mark.parametrize("name", sorted(set(modules()) - _OUTSIDE))
def test_imports_lead_down(name: str) -> None:
    own = room(name)
    for other in graph()[name]:
        assert other not in _OUTSIDE, f"{name} imports the front door"
        assert room(other) == own or FLOOR[room(other)] < FLOOR[own], f"{name} imports {other}"


def test_there_is_no_circle() -> None:
    """Not even one of imports in functions, or for types only."""
    left = dict(graph())
    while free := [name for name, others in left.items() if not others & left.keys()]:
        for name in free:
            del left[name]
    assert not left, f"in a circle, or above one: {sorted(left)}"


@pytest.mark.parametrize("name", sorted(name for name in modules() if name not in _OUTSIDE and room(name) in CORE))
def test_the_core_knows_no_files(name: str) -> None:
    assert not {other.split(".")[0] for other in imported(name)} & NOT_IN_CORE


@pytest.mark.parametrize("name", sorted(modules()))
def test_no_file_is_too_long(name: str) -> None:
    assert len(modules()[name].read_text(encoding="utf-8").splitlines()) <= 400


def has_code(module: str) -> bool:
    """Whether a module does more than to name, re-export and declare: it has a function, or a class with a method."""
    tree = ast.parse(modules()[module].read_text(encoding="utf-8"))
    bodies = [tree.body, *(node.body for node in tree.body if isinstance(node, ast.ClassDef))]
    return any(isinstance(node, ast.FunctionDef) for body in bodies for node in body)


@pytest.mark.parametrize("name", sorted(set(modules()) - _OUTSIDE))
def test_every_module_has_a_test_of_its_name(name: str) -> None:
    """dlogen/<room>/<module>.py is tested by tests/<room>/test_<module>.py, or by several test_<module>_*.py."""
    path = modules()[name]
    if not has_code(name):
        return
    room = ROOT / "tests" / path.relative_to(PACKAGE).parent
    stem = path.parent.name if path.stem == "__init__" else path.stem
    assert (room / f"test_{stem}.py").exists() or any(room.glob(f"test_{stem}_*.py")), f"{name} has no test of its name"
