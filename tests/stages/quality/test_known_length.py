"""A known length against that of the line."""

from __future__ import annotations

import pytest

from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.pipeline import fit
from dlogen.stages.quality.known_length import check_length


@pytest.mark.parametrize("known", [None, 2.0, 1.945, 2.06])
def test_nothing_is_said_within_three_per_cent(known: float | None) -> None:
    assert check_length(2.0, known) == []


@pytest.mark.parametrize(("known", "how"), [(2.1, "4.76 % shorter"), (1.9, "5.26 % longer"), (1.0, "100 % longer")])
def test_it_says_by_how_much(known: float, how: str) -> None:
    (finding,) = check_length(2.0, known)
    assert finding.code == "length-mismatch" and finding.severity == "doubtful"
    assert finding.message == f"the line is 2 m long, {how} than the known length of {known:g} m"


@pytest.mark.parametrize(("share", "verdict"), [(1.0, "good"), (1.02, "good"), (1.1, "doubtful"), (0.9, "doubtful")])
@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_a_fit_asks_for_it(tube: SyntheticCloud, share: float, verdict: str, profile: str) -> None:
    line = fit(tube.points, {"profile": profile}).skeleton.length
    quality = fit(tube.points, {"length": share * line, "profile": profile}).quality
    assert ("length-mismatch" in [finding.code for finding in quality.findings]) == (verdict != "good")
    assert profile == "paper" or quality.verdict == verdict
