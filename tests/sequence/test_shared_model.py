"""The common model of a recording: against the truth, and what it says of frames that spoil it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from moving import LENGTH, MOTIONS, RADIUS, Recorded, observation, recorded

from dlogen.config.sections import Segmentation
from dlogen.errors import FitError
from dlogen.evaluation.shapes import centre_line
from dlogen.geometry.polyline import resample
from dlogen.sequence.outliers import Observed
from dlogen.sequence.rigid_links import Shape, fit_links
from dlogen.sequence.shared_model import Common, common_model

Array = np.ndarray

SPOILT = {5: "failed", 17: "motion", 18: "doubtful", 33: "length", 46: "radius", 52: "noise"}


def spoil(made: Recorded) -> list[Observed]:
    """Frames with everything that can be wrong with them."""
    frames = list(made.observed)
    frames[5] = Observed("frame_05", None, problem="the file is empty")
    frames[17] = observation("frame_17", frames[17].points + np.array([0.0, 0.3, 0.0]))
    frames[18] = replace(frames[18], problem="doubtful: no points over 200 mm [gap]")
    frames[33] = observation("frame_33", frames[33].points[:600])
    frames[46] = observation("frame_46", frames[46].points, radius=1.4 * RADIUS)
    frames[52] = observation("frame_52", frames[52].points, residual=0.005)
    return frames


def against_truth(common: Common, made: Recorded) -> tuple[Array, Array]:
    """Distance of joints to those of the chains of the true curves, (F, n + 1); and of single fits to the truth."""
    s = np.linspace(0.0, 1.0, 1000)
    true = made.truth(s)
    first, last = (np.linalg.norm(common.joints[:, 0] - true[:, end], axis=1).sum() for end in (0, -1))
    if last < first:
        true = true[:, ::-1]
    count = len(true)
    ideal = fit_links(
        Shape(true, np.full(count, LENGTH), LENGTH, np.zeros(count)), common.links / common.links.sum() * LENGTH
    )
    single = [
        min(np.linalg.norm(item.points[::way] - line, axis=1).max() for way in (1, -1))
        for item, line in zip(made.observed, true, strict=True)
    ]
    return np.linalg.norm(common.joints - ideal, axis=2), np.array(single)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("seed", [31, 32])
def test_as_accurate_as_single_frames(name: str, seed: int) -> None:
    made = recorded(name, seed)
    common = common_model(spoil(made), made.times)
    assert {k: aside.code for k, aside in enumerate(common.asides) if aside} == SPOILT
    error, single = against_truth(common, made)
    good = common.good
    # No flip: an end for the other would be a metre. Both ends are averaged, so that joints are better than the line.
    assert error[good].max() < single[good].max()
    assert np.all(error[good].max(axis=1) < single[good] + 0.001)
    assert error[~good].max() < 0.006
    assert common.sizes.length.value == pytest.approx(LENGTH, abs=0.003)
    assert common.sizes.radius.value == pytest.approx(RADIUS, rel=0.005)
    assert np.nanmax(common.deviation) <= common.e_max == pytest.approx(0.5 * common.sizes.radius.value)
    assert np.array_equal(np.isnan(common.deviation), ~good)
    lengths = np.linalg.norm(np.diff(common.joints, axis=1), axis=2)
    assert lengths == pytest.approx(np.tile(common.links, (60, 1)), abs=1e-12)


def test_messages_have_figures() -> None:
    made = recorded("hose", 1)
    said = {k: aside.message for k, aside in enumerate(common_model(spoil(made), made.times).asides) if aside}
    assert said[5] == "the file is empty"
    assert "30" in said[17] and "neighbours" in said[17]
    assert "mm long" in said[33] and "in radius" in said[46] and "scatter" in said[52]


def test_fits_that_come_out_reversed_change_nothing() -> None:
    made = recorded("loop", 4, flips=False)
    other = [replace(item, points=item.points[::-1]) if k % 3 == 1 else item for k, item in enumerate(made.observed)]
    one, two = common_model(made.observed, made.times), common_model(other, made.times)
    assert np.array_equal(two.reverse, np.arange(60) % 3 == 1)
    assert two.joints == pytest.approx(one.joints, abs=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_what_is_hidden_at_one_end_is_missing_there(name: str) -> None:
    """Half of it at either end would move all joints by 4.5 mm."""
    made = recorded(name, 9, flips=False)
    frames, hidden = list(made.observed), {10: 0, 25: 1, 40: 0, 50: 1}
    for k, end in hidden.items():
        seen = frames[k].points[9:] if end == 0 else frames[k].points[:-9]
        frames[k] = observation(frames[k].name, resample(seen[:: 1 if k < 30 else -1], 1000))
    common = common_model(frames, made.times)
    error, _ = against_truth(common, made)
    kept = [k for k in hidden if common.good[k]]
    assert len(kept) >= 2
    assert error[kept].mean() < 0.002


@pytest.mark.parametrize("name", ["hose", "loop", "rod"])
def test_a_kink_in_one_frame_is_not_believed(name: str) -> None:
    """As where strands cross: nearly all of the line is right, but it would take twice as many segments."""
    made = recorded(name, 8)
    frames = list(made.observed)
    points = frames[30].points.copy()
    points[500:540] += 0.025 * np.sin(np.linspace(0, np.pi, 40))[:, None] * np.array([0.6, 0.0, 0.8])
    frames[30] = observation("frame_30", resample(points, 1000))
    common = common_model(frames, made.times)
    assert [k for k, aside in enumerate(common.asides) if aside] == [30]
    assert common.asides[30].code in ("motion", "length")
    assert len(common.links) <= len(common_model(made.observed, made.times).links) + 1


def test_smooth_is_nearer_to_the_truth() -> None:
    made = recorded("loop", 5)
    rough, even = (common_model(made.observed, made.times, smooth=smooth) for smooth in (False, True))
    assert against_truth(even, made)[0].mean() < 0.9 * against_truth(rough, made)[0].mean()


class TestLinks:
    @pytest.mark.parametrize(
        ("wish", "criterion", "count", "length"),
        [
            (Segmentation(segments=7), "segments", 7, LENGTH / 7),
            (Segmentation(segment_length=0.25), "segment_length", 5, 0.25),
            (Segmentation(min_bend_radius=0.1), "bend_radius", 18, 2 * np.sqrt(0.006 * (0.2 - 0.006))),
            (Segmentation(curvature_max=10.0), "bend_radius", 18, 2 * np.sqrt(0.006 * (0.2 - 0.006))),
        ],
    )
    def test_as_wished(self, wish: Segmentation, criterion: str, count: int, length: float) -> None:
        made = recorded("hose", 1, 8, end_noise=0.0)
        common = common_model(made.observed, made.times, segmentation=wish, e_max=0.006)
        assert common.criterion == criterion
        assert len(common.links) == count
        assert common.links[0] == pytest.approx(length, rel=2e-3)
        assert common.links.sum() == pytest.approx(common.sizes.length.value)

    def test_by_equation_17_with_the_tightest_bend_of_all_frames(self) -> None:
        made = recorded("hose", 1, 20, noise=0.0)
        common = common_model(made.observed, made.times, segmentation=Segmentation(criterion="paper"))
        true = [1.0 / line.max_curvature() for line in made.lines]
        assert common.bend.radius == pytest.approx(min(true), rel=0.01)
        assert common.bend.frame == int(np.argmin(true))
        bend, e_max = common.bend.radius, common.e_max
        assert common.links[0] == pytest.approx(2 * np.sqrt(e_max * (2 * bend - e_max)))
        s = common.bend.s if not common.reverse[common.bend.frame] else 1 - common.bend.s
        line = made.lines[common.bend.frame]
        assert line.curvature([min(s, 1 - s), max(s, 1 - s)]).max() == pytest.approx(1 / min(true), rel=0.02)

    def test_smaller_errors_take_more(self) -> None:
        made = recorded("hose", 1, 10)
        counts = [len(common_model(made.observed, made.times, e_max=e).links) for e in (0.02, 0.006, 0.002)]
        assert counts == sorted(counts) and counts[0] < counts[-1]

    @pytest.mark.parametrize(
        ("wish", "e_max", "message"),
        [
            (Segmentation(), 1e-8, "more than 2000 segments"),
            (Segmentation(segment_length=1e-4), 0.006, "segments of 0.0001 m"),
        ],
    )
    def test_too_many(self, wish: Segmentation, e_max: float, message: str) -> None:
        line = centre_line("bent").points(1000)
        with pytest.raises(FitError, match=message):
            common_model([observation("a", line)], np.zeros(1), segmentation=wish, e_max=e_max)


class TestWithoutTime:
    def test_ends_are_nearest_to_the_first_and_nothing_is_filled_in(self) -> None:
        made = recorded("loop", 6, 20)
        frames = list(made.observed)
        frames[4] = Observed("frame_04", None, problem="no")
        common = common_model(frames)
        assert not common.good[4] and common.good.sum() == 19
        assert np.isnan(common.joints[4]).all() and np.isfinite(common.joints[common.good]).all()
        ends = common.joints[common.good][:, [0, -1]] - common.joints[0, [0, -1]]
        other = common.joints[common.good][:, [-1, 0]] - common.joints[0, [0, -1]]
        assert np.all(np.linalg.norm(ends, axis=2).sum(axis=1) <= np.linalg.norm(other, axis=2).sum(axis=1))
        assert len({item.length for item in made.observed}) > 1
        assert np.linalg.norm(np.diff(common.joints[common.good], axis=1), axis=2) == pytest.approx(
            np.tile(common.links, (19, 1))
        )

    def test_no_order(self) -> None:
        made = recorded("loop", 6, 12, flips=False)
        one, two = common_model(made.observed), common_model(made.observed[:1] + made.observed[:0:-1])
        assert two.joints[1:][::-1] == pytest.approx(one.joints[1:], abs=1e-9)


def test_no_frame_is_good() -> None:
    frames = [
        Observed("a", None, problem="the file is empty"),
        replace(recorded("rod", 0, 1).observed[0], problem="bad"),
    ]
    with pytest.raises(FitError, match="1 failed, 1 doubtful; a: the file is empty") as error:
        common_model(frames, np.arange(2.0))
    assert "--keep-doubtful" in (error.value.hint or "")


def test_one_frame() -> None:
    made = recorded("hose", 0, 1)
    common = common_model(made.observed, made.times)
    assert common.good.all() and common.joints.shape[0] == 1


@pytest.mark.parametrize("name", ["hose", "whip", "rod", "loop"])
def test_a_change_of_direction_is_never_silent(name: str) -> None:
    """Of recordings with too few frames and a gap, whatever is got wrong is named."""
    wrong = 0
    for seed, frames in ((0, 7), (3, 10), (3, 14), (5, 14)):
        made = recorded(name, seed, frames)
        kept = [k for k in range(frames) if not 0.4 * frames <= k < 0.4 * frames + 2]
        common = common_model([made.observed[k] for k in kept], made.times[kept])
        good = np.flatnonzero(common.good)
        true = made.truth(np.linspace(0.0, 1.0, len(common.links) + 1))[kept]
        far = [np.linalg.norm(common.joints - true[:, ::way], axis=2).mean(axis=1)[good] for way in (1, -1)]
        turns = set(good[1:][np.diff(far[0] < far[1])].tolist())
        assert turns <= {doubt.frame for doubt in common.doubts}
        wrong += len(turns)
    assert wrong or name != "hose"


def test_nothing_is_in_doubt_in_a_whole_recording() -> None:
    assert common_model((made := recorded("hose", 3)).observed, made.times).doubts == ()


def test_objects_of_two_lengths() -> None:
    made = recorded("hose", 3, 20)
    frames = [observation(f"f{k}", item.points[: 1000 if k < 10 else 850]) for k, item in enumerate(made.observed)]
    common = common_model(frames)
    assert {aside.code for aside in common.asides[10:] + common.asides[:10] if aside} == {"length"}
    assert common.good.tolist() in ([True] * 10 + [False] * 10, [False] * 10 + [True] * 10)
    assert [doubt.code for doubt in common.doubts] == ["sizes"]
    assert "lengths differ, 1.0" in common.doubts[0].message
    assert common_model(frames[:13]).doubts == ()
