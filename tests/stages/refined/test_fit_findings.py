"""What ordering and fit found, each thing once: gaps that one or both of them noticed, and the noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dlogen.stages.refined.fit_findings import fit_findings
from dlogen.types import Finding

RADIUS = 0.01
STRAYS = Finding("stray-points", "some", "note")
OWN = Finding("radius-unknown", "who knows", "doubtful")


@pytest.fixture
def found(straight):
    """Findings about a straight line of 1 m along x: of an ordering with gaps and joins, and of a fit with gaps."""

    def make(
        gaps: Any = (), noticed: Any = (), joins: Any = (), noise: float = 0.0, more: Any = ()
    ) -> tuple[Finding, ...]:
        ordering = SimpleNamespace(findings=(STRAYS, *noticed), joins=[SimpleNamespace(s=s) for s in joins])
        line = straight([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
        fitted = SimpleNamespace(skeleton=line, radius=RADIUS, gaps=gaps, noise=noise, findings=more)
        return fit_findings(ordering, fitted)

    return make


def noticed(s: float, severity: Any = "note") -> Finding:
    return Finding("gap", "bridged roughly", severity, s)


def test_what_each_found_alone_stays(found) -> None:
    assert found(more=(OWN,)) == (STRAYS, OWN)
    # A gap that only the ordering noticed stays as it said it.
    assert found(noticed=[noticed(0.4)], more=(OWN,)) == (STRAYS, noticed(0.4), OWN)


def test_a_gap_of_both_is_said_once_as_the_fit_has_it(found) -> None:
    _, gap = found([(0.3, 0.33)], [noticed(0.35)])
    assert (gap.code, gap.severity) == ("gap", "note")
    assert gap.s == pytest.approx(0.315)
    assert np.array(gap.position) == pytest.approx([0.315, 0.0, 0.0])
    assert "30 mm (3.0 % of the length)" in gap.message
    # Another one elsewhere is another one.
    assert len(found([(0.3, 0.33)], [noticed(0.35), noticed(0.7)])) == 3


@pytest.mark.parametrize(
    ("gap", "noted", "severity"),
    [
        ((0.3, 0.349), "note", "note"),
        ((0.3, 0.351), "note", "doubtful"),
        ((0.3, 0.33), "doubtful", "doubtful"),
    ],
)
def test_when_a_gap_is_doubtful(found, gap: tuple[float, float], noted: str, severity: str) -> None:
    assert found([gap], [noticed(0.32, noted)])[1].severity == severity


def test_short_ones_must_have_been_noticed_or_bridged(found) -> None:
    # Four radii are 40 mm.
    assert found([(0.3, 0.339)]) == (STRAYS,)
    assert [item.code for item in found([(0.3, 0.341)])] == ["stray-points", "gap"]
    assert [item.code for item in found([(0.3, 0.32)], joins=[(0.31, 0.5)])] == ["stray-points", "gap"]
    assert found([(0.3, 0.32)], joins=[(0.32, 0.5)]) == (STRAYS,)


@pytest.mark.parametrize(("share", "severity"), [(0.009, None), (0.011, "note"), (0.49, "note"), (0.51, "doubtful")])
def test_noise_is_noted_by_its_share_of_the_radius(found, share: float, severity: str | None) -> None:
    codes = {item.code: item.severity for item in found(noise=share * RADIUS) if item.code == "noise"}
    assert codes == ({} if severity is None else {"noise": severity})
