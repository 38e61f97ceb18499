"""The registry of findings: complete, the only place that makes them, and the source of the README's table."""

from __future__ import annotations

import ast
import runpy
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

from dlogen.stages.quality import findings
from dlogen.stages.quality.findings import BRANCH, GAP, NOISE, REGISTRY, FindingKind, declared
from dlogen.types import SEVERITIES, Array, Finding, Quality

#: The script that writes the table, which is in no package.
SCRIPT = runpy.run_path(str(ROOT / "tests" / "tools" / "findings_table.py"))
with_table, README = SCRIPT["with_table"], SCRIPT["README"]

PACKAGE = ROOT / "dlogen"
REGISTRY_FILE = PACKAGE / "stages" / "quality" / "findings.py"

#: The constants of the registry by their names.
CONSTANTS = {name: value for name, value in vars(findings).items() if isinstance(value, FindingKind)}


@cache
def trees() -> dict[Path, ast.Module]:
    """All modules of the package, parsed."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}


def calls_of(name: str) -> Iterator[tuple[Path, ast.Call]]:
    """Where something of this name is called, as it is or as an attribute."""
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and name in (
                getattr(node.func, "id", None),
                getattr(node.func, "attr", None),
            ):
                yield path, node


def severities_made() -> dict[str, set[str]]:
    """Code -> the severities that the package makes findings of this kind with."""
    made: dict[str, set[str]] = {code: set() for code in REGISTRY}
    for method, place in (("found", 1), ("at", 3)):
        for _, call in calls_of(method):
            assert isinstance(call.func, ast.Attribute)
            kind = CONSTANTS.get(getattr(call.func.value, "id", ""))
            if kind is None:
                continue
            named = [item.value for item in call.keywords if item.arg == "severity"]
            given = call.args[place : place + 1] + named
            words = {
                node.value
                for argument in given
                for node in ast.walk(argument)
                if isinstance(node, ast.Constant) and isinstance(node.value, str)
            }
            # Left out, it is the only one.
            made[kind.code] |= words if given else set(kind.severities[:1])
    return made


def test_every_constant_is_registered_by_its_code() -> None:
    assert {kind.code: kind for kind in CONSTANTS.values()} == dict(REGISTRY)
    for name, kind in CONSTANTS.items():
        assert name == kind.code.upper().replace("-", "_")


def test_the_contract_names_these_codes() -> None:
    """Scripts depend on them."""
    codes = (
        *("gap", "crossing", "side-by-side", "branch", "closed-ring", "several-objects", "not-a-line", "stray-points"),
        *("points-not-reached", "points-off-the-tube", "radius-unknown", "radius-mismatch", "radius-varies", "units"),
        *("bend-tighter-than-radius", "curvature-uncertain", "end-cut-off", "noise", "deviation-above-e_max"),
        *("settings-not-used", "too-few-points"),
    )
    assert set(REGISTRY) >= set(codes)


def test_findings_are_made_by_the_registry_only() -> None:
    made = {path for path, _ in calls_of("Finding")}
    assert made == {REGISTRY_FILE}
    assert {path for path, _ in calls_of("FindingKind")} == {REGISTRY_FILE}


@pytest.mark.parametrize("code", REGISTRY)
def test_every_kind_is_made_with_every_severity_that_it_declares(code: str) -> None:
    assert severities_made()[code] == set(REGISTRY[code].severities)


def test_nothing_compares_codes_and_severities_as_bare_strings() -> None:
    """Only the types themselves know what the words mean."""

    def is_told(node: ast.expr) -> bool:
        if isinstance(node, ast.Subscript):
            return isinstance(node.slice, ast.Constant) and node.slice.value in ("code", "severity")
        return (getattr(node, "attr", None) or getattr(node, "id", None)) in ("code", "severity")

    def has_words(node: ast.expr) -> bool:
        return any(isinstance(part, ast.Constant) and isinstance(part.value, str) for part in ast.walk(node))

    seen = set()
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare):
                sides = [node.left, *node.comparators]
                if any(is_told(side) for side in sides) and any(
                    has_words(side) and not is_told(side) for side in sides
                ):
                    seen.add(f"{path.relative_to(PACKAGE).as_posix()}: {ast.unparse(node)}")
    assert seen == {"types/quality.py: self.severity == 'note'", "types/quality.py: self.severity == 'bad'"}


def test_a_finding_has_the_code_of_its_kind() -> None:
    assert GAP.found("no points", "bad", s=0.5, position=(1.0, 2.0, 3.0)) == Finding(
        "gap", "no points", "bad", 0.5, (1.0, 2.0, 3.0)
    )
    assert NOISE.found("it scatters", "note") == Finding("noise", "it scatters", "note", None, None)


def test_the_only_severity_need_not_be_named() -> None:
    assert BRANCH.severities == ("bad",)
    assert BRANCH.found("two ways").severity == "bad"
    assert BRANCH.found("two ways", "bad").severity == "bad"


def test_severities_that_a_kind_does_not_have_are_refused() -> None:
    with pytest.raises(ValueError, match="'branch' is one of bad, not note"):
        BRANCH.found("two ways", "note")
    with pytest.raises(ValueError, match="'noise' is one of note, doubtful, not bad"):
        NOISE.found("it scatters", "bad")
    with pytest.raises(ValueError, match="'gap' is one of note, doubtful, bad, not None"):
        GAP.found("no points")


def test_a_finding_at_a_coordinate_has_its_place_in_space() -> None:
    def line(s: float) -> Array:
        return np.array([2.0 * s, s**2, 0.5 - s])

    finding = GAP.at(line, 0.25, "no points", "note")
    assert finding == Finding("gap", "no points", "note", 0.25, (0.5, 0.0625, 0.25))
    assert finding.position is not None and all(type(value) is float for value in finding.position)


def test_a_kind_knows_its_findings() -> None:
    finding = GAP.found("no points", "bad")
    assert [kind for kind in REGISTRY.values() if kind.matches(finding)] == [GAP]


def test_severities_are_in_order() -> None:
    assert SEVERITIES == ("note", "doubtful", "bad")
    assert [Finding("gap", "x", severity).gravity for severity in SEVERITIES] == [0, 1, 2]
    for kind in REGISTRY.values():
        assert kind.severities and list(kind.severities) == [item for item in SEVERITIES if item in kind.severities]


@pytest.mark.parametrize(
    ("severities", "good", "bad", "warnings"),
    [
        ((), True, False, 0),
        (("note",), True, False, 0),
        (("note", "doubtful"), False, False, 1),
        (("bad",), False, True, 1),
    ],
)
def test_what_findings_make_of_the_quality(severities, good: bool, bad: bool, warnings: int) -> None:
    quality = Quality(tuple(GAP.found("x", severity) for severity in severities))
    assert (quality.is_good, quality.is_bad, len(quality.warnings)) == (good, bad, warnings)
    assert [item.is_note for item in quality.findings] == [severity == "note" for severity in severities]
    assert [item.is_bad for item in quality.findings] == [severity == "bad" for severity in severities]


@pytest.mark.parametrize(
    "finding", [GAP.found("x", "note"), GAP.found("y", "bad", s=0.0), GAP.found("z", "bad", position=(1.0, 0.0, -2.0))]
)
def test_findings_come_back_from_their_dictionaries(finding: Finding) -> None:
    assert Finding.from_dict(finding.to_dict()) == finding


def test_a_code_is_declared_once() -> None:
    table = dict(REGISTRY)
    with pytest.raises(ValueError, match="'gap' is declared twice"):
        declared(table, GAP)
    assert table == dict(REGISTRY)


def test_the_table_in_the_readme_is_the_registry() -> None:
    """If this fails: python tests/tools/findings_table.py --write."""
    text = README.read_text(encoding="utf-8")
    assert with_table(text) == text
    for kind in REGISTRY.values():
        assert text.count(f"\n| `{kind.code}` | ") == 1
        assert kind.meaning in text and kind.what_to_do in text


def test_the_table_replaces_what_is_between_the_comments() -> None:
    text = "# Title\n<!-- findings: how -->\nstale\nrows\n<!-- /findings -->\nrest\n"
    made = with_table(text)
    assert made.startswith("# Title\n<!-- findings: how -->\n| code |") and made.endswith(
        "|\n<!-- /findings -->\nrest\n"
    )
    assert "stale" not in made and with_table(made) == made
    with pytest.raises(ValueError, match="0 times"):
        with_table("no place")


def test_the_readme_leads_to_the_table() -> None:
    assert README.relative_to(ROOT).as_posix() in (ROOT / "README.md").read_text(encoding="utf-8")
