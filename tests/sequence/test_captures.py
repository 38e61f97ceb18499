"""Captures as their fits have written them: what is taken over, and which ones are not believed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dlogen.batch.store import Row
from dlogen.sequence.captures import CaptureFit, read_capture, read_fit
from dlogen.types import Finding

POINTS = [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [1.0, 0.0, 0.2]]
NOTE = Finding("few-points", "few points", "note")
GAP = Finding("gap", "no points over 200 mm", "doubtful", 0.5, (0.1, 0.2, 0.3))
TOUCH = Finding("self-contact", "strands touch", "doubtful")
RING = Finding("closed-ring", "a ring", "bad")
DEVIATION = Finding("deviation-above-e_max", "too far", "doubtful")


@pytest.fixture
def read(tmp_path: Path):
    """Reads a capture whose fit has these findings."""

    def read(*findings: Finding, keep_doubtful: bool = False) -> CaptureFit:
        chain = {
            "skeleton": {"points": POINTS, "length": 1.06},
            "radius": 0.01,
            "quality": {"findings": [item.to_dict() for item in findings]},
        }
        (tmp_path / "sub").mkdir(exist_ok=True)
        (tmp_path / "sub" / "x.1.json").write_text(json.dumps(chain))
        (tmp_path / "sub" / "x.1.report.json").write_text(json.dumps({"residual": {"rms": 0.002}}))
        rows = {"sub/x.1": Row("sub/x.1", "in/x.1.ply", "done")}
        return read_capture(rows, "sub/x.1", tmp_path, keep_doubtful=keep_doubtful)

    return read


def test_what_is_taken_over(read) -> None:
    capture = read(NOTE)
    assert capture.name == "sub/x.1" and capture.problem is None
    assert np.array_equal(capture.points, POINTS)
    assert (capture.length, capture.radius, capture.residual) == (1.06, 0.01, 0.002)


@pytest.mark.parametrize(
    ("findings", "problem", "when_kept"),
    [
        ((), None, None),
        # The chain of the capture alone is not used: how well it follows its line does not matter.
        ((DEVIATION, NOTE), None, None),
        ((NOTE, GAP, DEVIATION), "doubtful: no points over 200 mm [gap]", None),
        ((GAP, TOUCH), "doubtful: no points over 200 mm [gap]; strands touch [self-contact]", None),
        ((GAP, RING), *["bad: no points over 200 mm [gap]; a ring [closed-ring]"] * 2),
    ],
)
def test_verdicts(read, findings: tuple[Finding, ...], problem: str | None, when_kept: str | None) -> None:
    assert read(*findings).problem == problem
    kept = read(*findings, keep_doubtful=True)
    assert kept.problem == when_kept
    assert kept.points is not None


def test_without_a_fit(tmp_path: Path) -> None:
    rows = {"a": Row("a", "a.ply", "failed", error="the file is empty"), "b": Row("b", "b.ply", "running")}
    for key, problem in (("a", "the file is empty"), ("b", "it has not been fitted"), ("c", "it has not been fitted")):
        capture = read_capture(rows, key, tmp_path)
        assert (capture.name, capture.points, capture.problem) == (key, None, problem)


def test_chain_and_report(read, tmp_path: Path) -> None:
    read()
    chain, report = read_fit(tmp_path, "sub/x.1")
    assert chain["radius"] == 0.01 and report == {"residual": {"rms": 0.002}}
