"""What a user says of the pieces of a cloud: gaps to bridge, and the length."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.evaluation.synthetic import SyntheticCloud, synth
from dlogen.io.result import Result
from dlogen.pipeline import fit
from dlogen.stages.quality.findings import CROSSING, END_NOT_SEEN, GAP
from dlogen.stages.refined.bridging import Bridging

#: Where the cloud has no points, as shares of its length: more than is bridged by itself.
GAP_AT = (0.45, 0.7)


def in_two_pieces(seed: int) -> SyntheticCloud:
    return synth(
        "hose", points=4000, seed=seed, noise=0.0003, gaps=[GAP_AT], length=1.5, bend_radius=0.14, diameter=0.02
    )


def codes(result: Result) -> dict[str, str]:
    return {item.code: item.severity for item in result.quality.findings}


class TestConfiguration:
    def test_by_default_nothing_is_said(self) -> None:
        assert Bridging.of(Config()) == Bridging(0.0, None)
        assert Bridging().reach == 0.0

    def test_a_length_and_a_word(self) -> None:
        assert Bridging.of(Config(bridge=0.3, length=2.0)) == Bridging(0.3, 2.0)
        assert Bridging.of(Config(bridge="all")).reach == np.inf
        # The ends of pieces are a little short of those of the gap.
        assert 0.3 < Bridging(0.3).reach < 0.35


class TestLength:
    def test_the_likeliest_way_is_kept_where_no_length_is_known_or_none_fits(self) -> None:
        assert Bridging().best([1.0, 2.0], float) == 1.0
        assert Bridging(length=3.0).best([1.0, 2.0], float) == 1.0

    def test_the_likeliest_of_those_that_fit_is_taken(self) -> None:
        assert Bridging(length=2.0).best([1.0, 1.97, 2.0], float) == 1.97
        assert Bridging(length=1.0).best([1.02, 1.0], float) == 1.02

    def test_ways_are_not_made_when_the_first_one_fits(self) -> None:
        def ways():
            yield 2.0
            raise AssertionError("not needed")

        assert Bridging(length=2.0).best(ways(), float) == 2.0


class TestFindings:
    gap = GAP.found("no points", "doubtful", s=0.5)
    elsewhere = GAP.found("hardly any points in a bend", "doubtful", s=0.8)
    end = END_NOT_SEEN.found("the last end", "doubtful", s=1.0)
    other = CROSSING.found("strands", "doubtful", s=0.5)

    def severities(self, bridging: Bridging, length: float) -> list[str]:
        findings = [self.gap, self.elsewhere, self.end, self.other]
        return [item.severity for item in bridging.about(findings, [(0.4, 0.6)], length)]

    def test_gaps_that_were_asked_for_are_notes(self) -> None:
        doubtful = ["doubtful"] * 4
        assert self.severities(Bridging(), 1.0) == doubtful
        assert self.severities(Bridging(0.1), 1.0) == doubtful
        assert self.severities(Bridging(0.2), 1.0) == ["note", *doubtful[1:]]
        assert self.severities(Bridging(np.inf), 1.0) == ["note", *doubtful[1:]]

    def test_so_are_gaps_and_ends_of_a_line_as_long_as_the_object(self) -> None:
        assert self.severities(Bridging(length=1.02), 1.0) == ["note", "doubtful", "note", "doubtful"]
        assert self.severities(Bridging(length=1.1), 1.0) == ["doubtful"] * 4


@pytest.mark.parametrize("seed", range(3))
def test_a_wide_gap_is_bridged_when_that_is_asked_for(seed: int) -> None:
    cloud = in_two_pieces(seed)
    alone = fit(cloud.points)
    assert codes(alone)["several-objects"] == "bad" and alone.skeleton.length < 0.5 * cloud.truth.length
    gap = (GAP_AT[1] - GAP_AT[0]) * cloud.truth.length
    for settings in ({"bridge": "all"}, {"bridge": gap}, {"length": cloud.truth.length}):
        whole = fit(cloud.points, settings)
        assert whole.skeleton.length == pytest.approx(cloud.truth.length, rel=0.03), settings
        assert codes(whole)["gap"] == "note" and whole.quality.verdict == "good", settings
    assert "several-objects" in codes(fit(cloud.points, {"bridge": 0.3 * gap}))
    # A length that the pieces cannot have changes nothing but that it is said.
    wrong = fit(cloud.points, {"length": 3.0 * cloud.truth.length})
    assert wrong.skeleton.length == pytest.approx(alone.skeleton.length, rel=1e-6)
    assert {"several-objects", "length-mismatch"} <= set(codes(wrong))
