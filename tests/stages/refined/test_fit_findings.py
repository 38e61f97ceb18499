"""What ordering and fit found, each thing once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlogen.stages.quality.findings import CLOSED_RING, GAP, NOISE, SIDE_BY_SIDE
from dlogen.stages.refined.fit_findings import fit_findings
from dlogen.stages.refined.ordered_line import Bridge
from dlogen.stages.refined.ordering import Ordering
from dlogen.stages.refined.refine import Refined
from dlogen.types import Finding, Skeleton

RADIUS, LENGTH = 0.01, 2.0


@pytest.fixture
def fitted(straight: Any) -> Refined:
    """A fit along x, two metres long, that found nothing."""
    line: Skeleton = straight((0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0))
    nothing = np.zeros(0)
    return Refined(
        line,
        RADIUS,
        radius_std=0.0,
        radius_identifiable=True,
        inliers=np.zeros(0, dtype=bool),
        residuals=nothing,
        s=nothing,
        noise=0.0,
        shared=1.0,
        end_std=(0.0, 0.0),
        max_curvature=0.0,
        max_curvature_s=0.0,
        curvature_std=0.0,
        gaps=(),
        used=0,
        findings=(),
    )


def ordering(*findings: Finding, joins: tuple[Bridge, ...] = ()) -> Ordering:
    return Ordering(np.zeros((2, 3)), RADIUS, (), joins, findings)


def noticed(s: float, severity: Any = "note") -> Finding:
    """A gap as the ordering notices it."""
    return GAP.found("by the ordering", severity, s=s, position=(0.0, 0.0, 0.0))


def bridge(start: float, end: float) -> Bridge:
    return Bridge((start, end), (0.0, 0.0, 0.0), 0.01, "crossing", 1.0)


def test_nothing_found_is_nothing_said(fitted: Refined) -> None:
    assert fit_findings(ordering(), fitted) == ()


def test_what_both_found_of_other_kinds_stays_in_order(fitted: Refined) -> None:
    first, last = SIDE_BY_SIDE.found("two", SIDE_BY_SIDE.severities[0]), CLOSED_RING.found("ring", "bad")
    assert fit_findings(ordering(first), replace(fitted, findings=(last,))) == (first, last)


def test_a_gap_of_both_is_said_once_by_the_fit(fitted: Refined) -> None:
    (found,) = fit_findings(ordering(noticed(0.41)), replace(fitted, gaps=((0.4, 0.42),)))
    # 2 % of two metres.
    assert found.message == "no points over 40 mm (2.0 % of the length): bridged"
    assert found.s == pytest.approx(0.41)
    assert found.position == pytest.approx((0.82, 0.0, 0.0))
    assert found.severity == "note"


@pytest.mark.parametrize(("place", "count"), [(0.38, 1), (0.44, 1), (0.36, 2), (0.46, 2)])
def test_the_same_gap_is_one_within_three_percent(place: float, count: int, fitted: Refined) -> None:
    # Said by the fit in any case, and by the ordering if it was another one.
    found = fit_findings(ordering(noticed(place)), replace(fitted, gaps=((0.4, 0.43),)))
    assert len(found) == count
    assert [item.message == "by the ordering" for item in found] == [False, True][:count]


@pytest.mark.parametrize(
    ("width", "known", "said"),
    [
        # Four radii are 40 mm, 2 % of the length.
        (0.021, (), True),
        (0.019, (), False),
        (0.019, (noticed(0.41),), True),
    ],
)
def test_a_short_gap_must_have_been_noticed_before(
    width: float, known: tuple[Finding, ...], said: bool, fitted: Refined
) -> None:
    found = fit_findings(ordering(*known), replace(fitted, gaps=((0.4, 0.4 + width),)))
    assert len(found) == said


def test_or_lie_where_strands_were_joined(fitted: Refined) -> None:
    short = replace(fitted, gaps=((0.4, 0.41),))
    assert len(fit_findings(ordering(joins=(bridge(0.405, 0.5),)), short)) == 1
    assert fit_findings(ordering(joins=(bridge(0.5, 0.6),)), short) == ()
    assert fit_findings(ordering(joins=(bridge(0.3, 0.39),)), short) == ()


@pytest.mark.parametrize(
    ("end", "known", "severity"),
    [
        (0.449, "note", "note"),
        (0.451, "note", "doubtful"),  # more than a twentieth of the length
        (0.42, "doubtful", "doubtful"),
    ],
)
def test_how_doubtful_a_gap_is(end: float, known: str, severity: str, fitted: Refined) -> None:
    (found,) = fit_findings(ordering(noticed(0.41, known)), replace(fitted, gaps=((0.4, end),)))
    assert found.severity == severity


def test_a_gap_that_only_the_ordering_noticed_is_said_as_it_was(fitted: Refined) -> None:
    gap = noticed(0.7, "doubtful")
    assert fit_findings(ordering(gap), fitted) == (gap,)


def test_one_notice_counts_for_one_gap(fitted: Refined) -> None:
    """Two short gaps near one that was noticed: the second one is not the same again."""
    two = replace(fitted, gaps=((0.4, 0.41), (0.42, 0.43)))
    (found,) = fit_findings(ordering(noticed(0.415)), two)
    assert found.s == pytest.approx(0.405)


@pytest.mark.parametrize(
    ("share", "severity"), [(0.0, None), (0.0099, None), (0.011, "note"), (0.49, "note"), (0.51, "doubtful")]
)
def test_noise(share: float, severity: str | None, fitted: Refined) -> None:
    found = fit_findings(ordering(), replace(fitted, noise=share * RADIUS))
    assert [item.severity for item in found] == ([] if severity is None else [severity])
    assert all(NOISE.matches(item) and f"{100 * share:.0f} % of the radius" in item.message for item in found)
