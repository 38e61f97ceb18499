"""Findings and the verdict that they lead to."""

from __future__ import annotations

import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.types import SEVERITIES, Finding, Quality, Severity

FINITE = st.floats(allow_nan=False, allow_infinity=False)
FINDINGS = st.builds(
    Finding,
    st.text(),
    st.text(),
    st.sampled_from(SEVERITIES),
    st.none() | FINITE,
    st.none() | st.tuples(FINITE, FINITE, FINITE),
)


def of(*severities: Severity) -> Quality:
    return Quality(tuple(Finding("gap", "no points", severity) for severity in severities))


@given(FINDINGS)
def test_a_finding_comes_back_from_its_dictionary(finding: Finding) -> None:
    assert Finding.from_dict(finding.to_dict()) == finding
    # By way of a file, where a tuple becomes a list.
    assert Finding.from_dict(json.loads(json.dumps(finding.to_dict()))) == finding


@given(FINDINGS)
def test_places_that_are_not_known_are_left_out(finding: Finding) -> None:
    keys = finding.to_dict().keys()
    assert ("s" in keys) == (finding.s is not None)
    assert ("position" in keys) == (finding.position is not None)
    assert list(keys)[:3] == ["code", "message", "severity"]


def test_the_start_of_the_line_is_a_place() -> None:
    """s = 0 is not "no s"."""
    assert Finding("gap", "no points", s=0.0).to_dict()["s"] == 0.0


@pytest.mark.parametrize("missing", ["code", "message", "severity"])
def test_what_a_finding_needs(missing: str) -> None:
    data = Finding("gap", "no points").to_dict()
    del data[missing]
    with pytest.raises(KeyError, match=missing):
        Finding.from_dict(data)


def test_severities_from_the_mildest_to_the_gravest() -> None:
    assert SEVERITIES == ("note", "doubtful", "bad")
    findings = [Finding("gap", "no points", severity) for severity in SEVERITIES]
    assert [finding.gravity for finding in findings] == [0, 1, 2]
    assert [finding.is_note for finding in findings] == [True, False, False]
    assert [finding.is_bad for finding in findings] == [False, False, True]


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_the_gravest_finding_is_the_verdict_in_whatever_order(count: int) -> None:
    for severities in itertools.product(SEVERITIES, repeat=count):
        quality = of(*severities)
        gravest = max((SEVERITIES.index(severity) for severity in severities), default=0)
        assert quality.verdict == ("good", "doubtful", "bad")[gravest]
        assert quality.is_good is (quality.verdict == "good")
        assert quality.is_bad is (quality.verdict == "bad")
        assert [item.severity for item in quality.warnings] == [item for item in severities if item != "note"]


def test_nothing_found_is_good() -> None:
    assert Quality().verdict == "good"
    assert Quality().warnings == ()
