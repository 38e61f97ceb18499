"""How long segments are: against brute force, on random curves, and in the corners."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.errors import FitError
from dlogen.evaluation.shapes import hose_centre_line, random_centre_line
from dlogen.geometry.curvature import max_curvature
from dlogen.io.report import report_dict
from dlogen.pipeline import fit
from dlogen.stages.chain import deviation
from dlogen.stages.segmentation.joints import place_joints
from dlogen.stages.segmentation.segment import segment
from dlogen.stages.segmentation.segment_length import max_segment_length
from dlogen.stages.segmentation.specification import SegmentationSpec
from dlogen.types import Joints, Segmentation, Skeleton

ALL = SegmentationSpec(alternatives=True)
CRITERIA = [("paper", "on-curve"), ("fewest", "on-curve"), ("fewest", "minimax")]


def by_criterion(made: Segmentation) -> dict[tuple[str, str], Segmentation]:
    return {(item.criterion, item.placement): item for item in (made, *made.alternatives)}


def measured(line: Skeleton, joints: Joints, samples: int = 300) -> float:
    """The deviation, worked out the plain way: every piece against its segment, and joints against f(s)."""
    worst = float(np.linalg.norm(joints.positions - line(joints.s), axis=1).max())
    for i in range(len(joints.s) - 1):
        points = line(np.linspace(joints.s[i], joints.s[i + 1], samples))
        a, b = joints.positions[i : i + 2]
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        worst = max(worst, float(np.linalg.norm(points - a - t[:, None] * (b - a), axis=1).max()))
    return worst


def check(line: Skeleton, made: Segmentation, e_max: float | None = None) -> None:
    """What every segmentation has to hold."""
    joints = made.joints
    chords = np.linalg.norm(np.diff(joints.positions, axis=0), axis=1)
    # Moved to where the cloud is, they can differ in the last digit.
    assert joints.positions[[0, -1]] == pytest.approx(line([0.0, 1.0]), rel=0, abs=1e-15)
    assert joints.s[0] == 0.0
    assert joints.s[-1] == 1.0
    assert (np.diff(joints.s) > 0).all()
    assert np.abs(chords[:-1] - joints.segment_length).max(initial=0.0) < 1e-9
    assert chords[-1] == pytest.approx(joints.last_segment_length, abs=1e-12)
    assert chords[-1] <= joints.segment_length + 1e-9
    plain = measured(line, joints)
    assert plain <= made.deviation * (1 + 1e-7) + 1e-12
    assert plain == pytest.approx(made.deviation, rel=1e-3, abs=1e-12)
    if made.placement == "on-curve":
        assert joints.positions == pytest.approx(line(joints.s), abs=1e-12)
    if e_max is not None:
        assert made.deviation <= e_max * (1 + 1e-9)


# --- the three criteria on random curves ---


@pytest.fixture(scope="module")
def two_hundred(fitted) -> list[tuple[Skeleton, float, dict[tuple[str, str], Segmentation]]]:
    """All criteria on 200 curves: e_max from a fifteenth of the smallest radius of curvature to a third of it."""
    rng = np.random.default_rng(7)
    out = []
    for seed in range(200):
        truth = random_centre_line(
            seed, length=rng.uniform(0.6, 1.6), min_bend_radius=rng.uniform(0.07, 0.2), dimensions=2 + seed % 2
        )
        line = fitted(truth)
        e_max = 10 ** rng.uniform(-1.2, -0.5) / max_curvature(line)[0]
        out.append((line, e_max, by_criterion(segment(line, e_max, ALL))))
    return out


def test_the_measured_deviation_is_within_e_max(two_hundred) -> None:
    for line, e_max, made in two_hundred:
        assert list(made) != []
        for key in CRITERIA:
            check(line, made[key], e_max)


def test_never_more_segments_than_the_paper(two_hundred) -> None:
    for _, _, made in two_hundred:
        paper, fewest, minimax = (made[key].count for key in CRITERIA)
        assert minimax <= fewest <= paper


def test_a_fifth_fewer_segments_with_joints_beside_the_line(two_hundred) -> None:
    paper, fewest, minimax = (np.array([made[key].count for _, _, made in two_hundred]) for key in CRITERIA)
    assert np.mean(1 - minimax / paper) > 0.25
    assert np.mean(1 - (minimax - 1) / (paper - 1)) > 0.2  # inner joints
    assert np.mean(1 - fewest / paper) > 0.05


def test_one_segment_less_is_too_far_off(two_hundred) -> None:
    for line, e_max, made in two_hundred:
        fewest = made["fewest", "on-curve"]
        if fewest.count == 1:
            continue
        assert fewest.fewer is not None
        assert fewest.fewer.count == fewest.count - 1
        assert fewest.fewer.resolution is not None
        assert fewest.fewer.resolution <= 1e-6
        assert fewest.fewer.deviation > e_max
        # It is what a chain of that length has.
        joints = place_joints(line, fewest.fewer.segment_length)
        assert len(joints.s) - 1 == fewest.fewer.count
        assert deviation(line, joints)[0] == pytest.approx(fewest.fewer.deviation, rel=1e-3)


def test_what_fewer_segments_would_deviate_by_is_a_number(two_hundred) -> None:
    # The search with joints beside the line can find no chain at all with one segment less.
    for _, _, made in two_hundred:
        for item in made.values():
            assert item.fewer is None or math.isfinite(item.fewer.deviation)


def test_the_last_segment_is_no_stub_where_there_is_a_choice(two_hundred) -> None:
    shares = np.array(
        [
            made["fewest", "on-curve"].joints.last_segment_length / made["fewest", "on-curve"].joints.segment_length
            for _, _, made in two_hundred
        ]
    )
    # Of evenly distributed last segments half would be shorter.
    assert np.mean(shares < 0.5) < 0.3


# --- corners ---


@pytest.mark.parametrize("e_max", [1e-4, 1e-3, 0.01, 0.02, 0.04])
def test_from_a_tenth_of_a_millimetre_to_the_diameter(fitted, e_max: float) -> None:
    line = fitted(random_centre_line(11, clearance=0.05))
    made = by_criterion(segment(line, e_max, ALL))
    for key in CRITERIA:
        check(line, made[key], e_max)
    paper, fewest, minimax = (made[key].count for key in CRITERIA)
    assert minimax < paper
    assert minimax <= fewest <= paper


@pytest.mark.parametrize("times", [1.0, 1.5, 4.0, 100.0])
def test_e_max_beyond_the_radius_of_curvature(fitted, circle, times: float) -> None:
    for line in (fitted(random_centre_line(2)), circle(0.3, 5.0)):
        e_max = times / max_curvature(line)[0]
        made = by_criterion(segment(line, e_max, ALL))
        for key in CRITERIA:
            check(line, made[key], e_max)
        assert made["fewest", "minimax"].count <= made["fewest", "on-curve"].count <= made["paper", "on-curve"].count


@pytest.mark.parametrize("wish", [ALL, SegmentationSpec(placement="minimax"), SegmentationSpec(criterion="paper")])
def test_a_straight_line_is_one_segment(straight, wish: SegmentationSpec) -> None:
    line = straight([0.1, 0.2, 0.3], [1.0, -0.5, 0.4])
    made = segment(line, 0.001, wish)
    assert made.count == 1
    assert made.deviation < 1e-12
    assert made.joints.last_segment_length == pytest.approx(line.length)
    assert made.joints.segment_length == pytest.approx(line.length)


def test_a_line_shorter_than_a_segment(circle) -> None:
    line = circle(0.5, 0.2)  # sagitta 2.5 mm
    made = by_criterion(segment(line, 0.01, ALL))
    assert {item.count for item in made.values()} == {1}
    assert made["fewest", "on-curve"].deviation == pytest.approx(0.5 * (1 - math.cos(0.1)), rel=1e-9)


@pytest.mark.parametrize("open_by", [0.05, 0.005])
def test_ends_that_nearly_meet(circle, open_by: float) -> None:
    line = circle(0.2, 2 * math.pi - open_by)
    made = by_criterion(segment(line, 0.01, ALL))
    for key in CRITERIA:
        check(line, made[key], 0.01)
    # Chords of a circle with a sagitta of e_max at most.
    needed = (2 * math.pi - open_by) / (2 * math.acos(1 - 0.01 / 0.2))
    assert made["fewest", "on-curve"].count == math.ceil(needed)


@pytest.mark.parametrize("e_max", [0.01, 0.25, 0.5])
def test_ends_that_meet(circle, e_max: float) -> None:
    line = circle(0.2, 2 * math.pi)
    made = segment(line, e_max, SegmentationSpec())
    check(line, made, e_max)
    assert made.count >= 2


def test_an_arc_needs_the_chords_that_geometry_says(circle) -> None:
    r, e, angle = 0.5, 0.002, 5.0
    made = by_criterion(segment(circle(r, angle), e, ALL))
    assert made["paper", "on-curve"].count == math.ceil(angle / (2 * math.acos(1 - e / r)))
    assert made["fewest", "on-curve"].count == made["paper", "on-curve"].count
    # With both ends e outside of the arc a chord may have a sagitta of 2 e. The first one starts on the arc, and all
    # are as long as it: with its end y = e outside, its deviation is y t - 4 h t (1 - t), at most e for h = 1.457 e.
    t = np.linspace(0, 1, 100_001)
    h = max(h for h in np.linspace(1, 2, 1001) if np.abs(t - 4 * h * t * (1 - t)).max() <= 1)
    assert made["fewest", "minimax"].count == math.ceil(angle / math.sqrt(8 * h * e / r))


def test_the_papers_hose(exact_line) -> None:
    made = by_criterion(segment(exact_line(hose_centre_line()), 0.01, ALL))
    assert made["paper", "on-curve"].count in (16, 17)
    assert made["paper", "on-curve"].joints.segment_length == pytest.approx(0.1059, abs=2e-4)
    assert made["fewest", "minimax"].count <= 13


def test_min_last_zero_is_the_longest_length(fitted) -> None:
    line = fitted(random_centre_line(3))
    longest, even = (segment(line, 0.01, SegmentationSpec(min_last=share)) for share in (0.0, 1.0))
    assert longest.count == even.count
    assert longest.joints.segment_length >= even.joints.segment_length
    assert longest.deviation == pytest.approx(0.01, rel=1e-4)
    # A little longer, and it is too far off, or there is another number of segments.
    longer = place_joints(line, longest.joints.segment_length * (1 + 1e-4))
    assert deviation(line, longer)[0] > 0.01


# --- by wish ---


@pytest.mark.parametrize("count", [1, 2, 3, 16, 100])
def test_so_many_equal_segments(fitted, count: int) -> None:
    line = fitted(random_centre_line(4))
    made = segment(line, 0.01, SegmentationSpec(segments=count))
    check(line, made)
    assert made.count == count
    assert made.joints.last_segment_length == pytest.approx(made.joints.segment_length, abs=1e-9)
    assert made.criterion == "segments"


def test_equal_segments_of_a_circle(circle) -> None:
    made = segment(circle(0.3, 4.0), 0.01, SegmentationSpec(segments=8))
    assert made.joints.s == pytest.approx(np.linspace(0, 1, 9), abs=1e-9)
    assert made.joints.segment_length == pytest.approx(0.6 * math.sin(0.25), abs=1e-12)


def test_segments_of_a_length(fitted) -> None:
    line = fitted(random_centre_line(4))
    made = segment(line, 0.01, SegmentationSpec(segment_length=0.1))
    check(line, made)
    assert made.joints.segment_length == 0.1


def test_a_known_bending_radius(fitted) -> None:
    line = fitted(random_centre_line(4))
    made = segment(line, 0.01, SegmentationSpec(bend_radius=0.05))
    check(line, made, 0.01)
    assert made.joints.segment_length == pytest.approx(max_segment_length(0.01, 0.05))


def test_a_closed_line_is_not_one_segment(circle) -> None:
    with pytest.raises(FitError):
        segment(circle(0.3, 2 * math.pi), 0.01, SegmentationSpec(segments=1))


@pytest.mark.parametrize(
    ("settings", "criterion", "placement"),
    [
        ({}, "fewest", "on-curve"),
        ({"criterion": "paper"}, "paper", "on-curve"),
        ({"placement": "minimax"}, "fewest", "minimax"),
        ({"segments": 9}, "segments", "on-curve"),
        ({"segment_length": 0.08}, "segment_length", "on-curve"),
        ({"min_bend_radius": 0.08}, "bend_radius", "on-curve"),
        ({"curvature_max": 12.5}, "bend_radius", "on-curve"),
    ],
)
def test_through_the_pipeline(tube, settings: dict, criterion: str, placement: str) -> None:
    result = fit(tube.points, {"r": 0.015, "segmentation": settings})
    assert (result.segmentation.criterion, result.segmentation.placement) == (criterion, placement)
    check(result.skeleton, result.segmentation)
    assert result.max_deviation == result.segmentation.deviation
    assert result.joints is result.segmentation.joints
    codes = [finding.code for finding in result.quality.findings]
    assert ("deviation-above-e_max" in codes) == (result.max_deviation > result.e_max * (1 + 1e-9))
    if criterion in ("bend_radius",):
        assert result.joints.segment_length == pytest.approx(max_segment_length(0.0075, 0.08))


def test_the_profile_paper_keeps_its_criterion(tube) -> None:
    assert fit(tube.points, {"profile": "paper", "r": 0.015}).segmentation.criterion == "paper"
    told = fit(tube.points, {"profile": "paper", "r": 0.015, "segmentation": {"criterion": "fewest"}})
    assert told.segmentation.criterion == told.settings["segmentation"]["criterion"] == "fewest"


def test_a_wish_that_breaks_e_max_is_a_finding(tube) -> None:
    result = fit(tube.points, {"r": 0.015, "segmentation": {"segments": 3}})
    finding = next(item for item in result.quality.findings if item.code == "deviation-above-e_max")
    assert result.quality.verdict == "doubtful"
    assert finding.s is not None
    # It is at the place that is farthest from the chain.
    worst = result.skeleton(finding.s)
    assert finding.position == pytest.approx(worst, abs=1e-9)
    assert f"{1e3 * result.max_deviation:.2f} mm" in finding.message


def test_the_report_shows_all_criteria_side_by_side(tube) -> None:
    config = Config.from_dict({"r": 0.015, "report": {"alternatives": True}, "joints": {"dof": 3}})
    result = fit(tube.points + np.array([1e3, -2e3, 50.0]), config)
    report = report_dict(result)["segmentation"]
    rows = [report, *report["alternatives"]]
    assert sorted((row["criterion"], row["placement"]) for row in rows) == sorted(CRITERIA)
    for row in rows:
        assert row["dof"] == 3 * (row["segment_count"] - 1)
        assert row["deviation"] <= result.e_max * (1 + 1e-9)
        assert 0 < row["last_segment_length"] <= row["segment_length"] * (1 + 1e-9)
    assert report["fewer"]["segment_count"] == report["segment_count"] - 1
    assert report["fewer"]["smallest_deviation"] > result.e_max
    # Alternatives are in the cloud's frame as well.
    for made in (result.segmentation, *result.segmentation.alternatives):
        assert made.joints.positions[0] == pytest.approx(result.skeleton(0.0), abs=1e-9)
