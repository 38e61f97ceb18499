"""Findings and the verdict that they make."""

from __future__ import annotations

import itertools

import pytest

from dlogen.types import Finding, Quality

NOTE, DOUBT, BAD = Finding("noise", "n", "note"), Finding("gap", "g", "doubtful"), Finding("branch", "b", "bad")


@pytest.mark.parametrize(
    ("findings", "verdict"),
    [((), "good"), ((NOTE,), "good"), ((NOTE, DOUBT), "doubtful"), ((DOUBT, BAD), "bad"), ((NOTE, DOUBT, BAD), "bad")],
)
def test_the_verdict_is_the_worst_finding(findings: tuple[Finding, ...], verdict: str) -> None:
    for order in itertools.permutations(findings):
        assert Quality(order).verdict == verdict


def test_severities_have_an_order() -> None:
    assert [finding.gravity for finding in (NOTE, DOUBT, BAD)] == [0, 1, 2]
    assert [finding.is_note for finding in (NOTE, DOUBT, BAD)] == [True, False, False]
    assert [finding.is_bad for finding in (NOTE, DOUBT, BAD)] == [False, False, True]


def test_absent_places_are_left_out_of_the_file() -> None:
    assert NOTE.to_dict() == {"code": "noise", "message": "n", "severity": "note"}
    placed = Finding("gap", "g", "doubtful", 0.0, (1.0, 2.0, 3.0))
    assert placed.to_dict() == {
        "code": "gap",
        "message": "g",
        "severity": "doubtful",
        "s": 0.0,
        "position": [1.0, 2.0, 3.0],
    }
