"""The shared model of a recording: against the truth, and what it says of captures that spoil it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from moving import LENGTH, MOTIONS, RADIUS, Recorded, observation, recorded

from dlogen.config.sections import Segmentation
from dlogen.errors import FitError
from dlogen.evaluation.shapes import centre_line
from dlogen.geometry.polyline import resample
from dlogen.sequence.captures import CaptureFit
from dlogen.sequence.rigid_links import Shape, fit_links
from dlogen.sequence.shared_model import SharedModel, shared_model

Array = np.ndarray

SPOILT = {5: "failed", 17: "motion", 18: "doubtful", 33: "length", 46: "radius", 52: "noise"}


def spoil(made: Recorded) -> list[CaptureFit]:
    """Captures with everything that can be wrong with them."""
    captures = list(made.captures)
    captures[5] = CaptureFit("frame_05", None, problem="the file is empty")
    captures[17] = observation("frame_17", captures[17].points + np.array([0.0, 0.3, 0.0]))
    captures[18] = replace(captures[18], problem="doubtful: no points over 200 mm [gap]")
    captures[33] = observation("frame_33", captures[33].points[:600])
    captures[46] = observation("frame_46", captures[46].points, radius=1.4 * RADIUS)
    captures[52] = observation("frame_52", captures[52].points, residual=0.005)
    return captures


def against_truth(model: SharedModel, made: Recorded) -> tuple[Array, Array]:
    """Distance of joints to those of the chains of the true curves, (F, n + 1); and of single fits to the truth."""
    s = np.linspace(0.0, 1.0, 1000)
    true = made.truth(s)
    first, last = (np.linalg.norm(model.joints[:, 0] - true[:, end], axis=1).sum() for end in (0, -1))
    if last < first:
        true = true[:, ::-1]
    count = len(true)
    ideal = fit_links(
        Shape(true, np.full(count, LENGTH), LENGTH, np.zeros(count)), model.links / model.links.sum() * LENGTH
    )
    single = [
        min(np.linalg.norm(item.points[::way] - line, axis=1).max() for way in (1, -1))
        for item, line in zip(made.captures, true, strict=True)
    ]
    return np.linalg.norm(model.joints - ideal, axis=2), np.array(single)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("seed", [31, 32])
def test_as_accurate_as_single_captures(name: str, seed: int) -> None:
    made = recorded(name, seed)
    model = shared_model(spoil(made), made.times)
    assert {k: exclusion.code for k, exclusion in enumerate(model.exclusions) if exclusion} == SPOILT
    error, single = against_truth(model, made)
    good = model.good
    # No flip: an end for the other would be a metre. Both ends are averaged, so that joints are better than the line.
    assert error[good].max() < single[good].max()
    assert np.all(error[good].max(axis=1) < single[good] + 0.001)
    assert error[~good].max() < 0.006
    assert model.sizes.length.value == pytest.approx(LENGTH, abs=0.003)
    assert model.sizes.radius.value == pytest.approx(RADIUS, rel=0.005)
    assert np.nanmax(model.deviation) <= model.e_max == pytest.approx(0.5 * model.sizes.radius.value)
    assert np.array_equal(np.isnan(model.deviation), ~good)
    lengths = np.linalg.norm(np.diff(model.joints, axis=1), axis=2)
    assert lengths == pytest.approx(np.tile(model.links, (60, 1)), abs=1e-12)


def test_messages_have_numbers() -> None:
    made = recorded("hose", 1)
    said = {
        k: exclusion.message
        for k, exclusion in enumerate(shared_model(spoil(made), made.times).exclusions)
        if exclusion
    }
    assert said[5] == "the file is empty"
    assert "30" in said[17] and "neighbours" in said[17]
    assert "mm long" in said[33] and "in radius" in said[46] and "scatter" in said[52]


def test_fits_that_come_out_reversed_change_nothing() -> None:
    made = recorded("loop", 4, flips=False)
    other = [replace(item, points=item.points[::-1]) if k % 3 == 1 else item for k, item in enumerate(made.captures)]
    one, two = shared_model(made.captures, made.times), shared_model(other, made.times)
    assert np.array_equal(two.reverse, np.arange(60) % 3 == 1)
    assert two.joints == pytest.approx(one.joints, abs=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_what_is_hidden_at_one_end_is_missing_there(name: str) -> None:
    """Half of it at either end would move all joints by 4.5 mm."""
    made = recorded(name, 9, flips=False)
    captures, hidden = list(made.captures), {10: 0, 25: 1, 40: 0, 50: 1}
    for k, end in hidden.items():
        seen = captures[k].points[9:] if end == 0 else captures[k].points[:-9]
        captures[k] = observation(captures[k].name, resample(seen[:: 1 if k < 30 else -1], 1000))
    model = shared_model(captures, made.times)
    error, _ = against_truth(model, made)
    kept = [k for k in hidden if model.good[k]]
    assert len(kept) >= 2
    assert error[kept].mean() < 0.002


@pytest.mark.parametrize("name", ["hose", "loop", "rod"])
def test_a_kink_in_one_capture_is_not_believed(name: str) -> None:
    """As where strands cross: nearly all of the line is right, but it would take twice as many segments."""
    made = recorded(name, 8)
    captures = list(made.captures)
    points = captures[30].points.copy()
    points[500:540] += 0.025 * np.sin(np.linspace(0, np.pi, 40))[:, None] * np.array([0.6, 0.0, 0.8])
    captures[30] = observation("frame_30", resample(points, 1000))
    model = shared_model(captures, made.times)
    assert [k for k, exclusion in enumerate(model.exclusions) if exclusion] == [30]
    assert model.exclusions[30].code in ("motion", "length")
    assert len(model.links) <= len(shared_model(made.captures, made.times).links) + 1


def test_smooth_is_nearer_to_the_truth() -> None:
    made = recorded("loop", 5)
    rough, even = (shared_model(made.captures, made.times, smooth=smooth) for smooth in (False, True))
    assert against_truth(even, made)[0].mean() < 0.9 * against_truth(rough, made)[0].mean()


class TestLinks:
    @pytest.mark.parametrize(
        ("segmentation", "criterion", "count", "length"),
        [
            (Segmentation(segments=7), "segments", 7, LENGTH / 7),
            (Segmentation(segment_length=0.25), "segment_length", 5, 0.25),
            (Segmentation(min_bend_radius=0.1), "bend_radius", 18, 2 * np.sqrt(0.006 * (0.2 - 0.006))),
            (Segmentation(curvature_max=10.0), "bend_radius", 18, 2 * np.sqrt(0.006 * (0.2 - 0.006))),
        ],
    )
    def test_as_wished(self, segmentation: Segmentation, criterion: str, count: int, length: float) -> None:
        made = recorded("hose", 1, 8, end_noise=0.0)
        model = shared_model(made.captures, made.times, segmentation=segmentation, e_max=0.006)
        assert model.criterion == criterion
        assert len(model.links) == count
        assert model.links[0] == pytest.approx(length, rel=2e-3)
        assert model.links.sum() == pytest.approx(model.sizes.length.value)

    def test_by_equation_17_with_the_tightest_bend_of_all_captures(self) -> None:
        made = recorded("hose", 1, 20, noise=0.0)
        model = shared_model(made.captures, made.times, segmentation=Segmentation(criterion="paper"))
        true = [1.0 / line.max_curvature() for line in made.lines]
        assert model.bend.radius == pytest.approx(min(true), rel=0.01)
        assert model.bend.capture == int(np.argmin(true))
        bend, e_max = model.bend.radius, model.e_max
        assert model.links[0] == pytest.approx(2 * np.sqrt(e_max * (2 * bend - e_max)))
        s = model.bend.s if not model.reverse[model.bend.capture] else 1 - model.bend.s
        line = made.lines[model.bend.capture]
        assert line.curvature([min(s, 1 - s), max(s, 1 - s)]).max() == pytest.approx(1 / min(true), rel=0.02)

    def test_smaller_errors_take_more(self) -> None:
        made = recorded("hose", 1, 10)
        counts = [len(shared_model(made.captures, made.times, e_max=e).links) for e in (0.02, 0.006, 0.002)]
        assert counts == sorted(counts) and counts[0] < counts[-1]

    @pytest.mark.parametrize(
        ("segmentation", "e_max", "message"),
        [
            (Segmentation(), 1e-8, "more than 2000 segments"),
            (Segmentation(segment_length=1e-4), 0.006, "segments of 0.0001 m"),
        ],
    )
    def test_too_many(self, segmentation: Segmentation, e_max: float, message: str) -> None:
        line = centre_line("bent").points(1000)
        with pytest.raises(FitError, match=message):
            shared_model([observation("a", line)], np.zeros(1), segmentation=segmentation, e_max=e_max)


class TestWithoutTime:
    def test_ends_are_nearest_to_the_first_and_nothing_is_filled_in(self) -> None:
        made = recorded("loop", 6, 20)
        captures = list(made.captures)
        captures[4] = CaptureFit("frame_04", None, problem="no")
        model = shared_model(captures)
        assert not model.good[4] and model.good.sum() == 19
        assert np.isnan(model.joints[4]).all() and np.isfinite(model.joints[model.good]).all()
        ends = model.joints[model.good][:, [0, -1]] - model.joints[0, [0, -1]]
        other = model.joints[model.good][:, [-1, 0]] - model.joints[0, [0, -1]]
        assert np.all(np.linalg.norm(ends, axis=2).sum(axis=1) <= np.linalg.norm(other, axis=2).sum(axis=1))
        assert len({item.length for item in made.captures}) > 1
        assert np.linalg.norm(np.diff(model.joints[model.good], axis=1), axis=2) == pytest.approx(
            np.tile(model.links, (19, 1))
        )

    @pytest.mark.parametrize("lack", [0.006, -0.006])
    @pytest.mark.parametrize("reverse", [False, True])
    def test_what_a_capture_lacks_is_missing_at_both_ends_alike(self, lack: float, reverse: bool) -> None:
        """Ends that are 3 mm short, or 3 mm long: all of it taken to be at one would move the chain by as much."""
        made = recorded("hose", 6, 16, noise=0.0, end_noise=0.0, flips=False, duration=0.2)
        captures = list(made.captures)
        for k in (3, 8, 12):
            points = captures[k].points
            along = np.linspace(0.5 * lack, LENGTH - 0.5 * lack, 1000)
            # Too long: the object goes on straight.
            seen = Shape(points[None], np.array([LENGTH]), LENGTH, np.zeros(1)).points(along)[0]
            captures[k] = observation(captures[k].name, seen[::-1] if reverse else seen)
        model = shared_model(captures)
        assert model.good.all()
        assert model.reverse.tolist() == [reverse and k in (3, 8, 12) for k in range(16)]
        error, _ = against_truth(model, made)
        assert error.max() < 0.0005

    def test_no_order(self) -> None:
        made = recorded("loop", 6, 12, flips=False)
        one, two = shared_model(made.captures), shared_model(made.captures[:1] + made.captures[:0:-1])
        assert two.joints[1:][::-1] == pytest.approx(one.joints[1:], abs=1e-9)


def test_no_capture_is_good() -> None:
    captures = [
        CaptureFit("a", None, problem="the file is empty"),
        replace(recorded("rod", 0, 1).captures[0], problem="bad"),
    ]
    with pytest.raises(FitError, match="1 failed, 1 doubtful; a: the file is empty") as error:
        shared_model(captures, np.arange(2.0))
    assert "--keep-doubtful" in (error.value.hint or "")


def test_one_capture() -> None:
    made = recorded("hose", 0, 1)
    model = shared_model(made.captures, made.times)
    assert model.good.all() and model.joints.shape[0] == 1


@pytest.mark.parametrize("name", ["hose", "whip", "rod", "loop"])
def test_a_change_of_direction_is_never_silent(name: str) -> None:
    """Of recordings with too few captures and a gap, whatever is got wrong is named."""
    wrong = 0
    for seed, count in ((0, 7), (3, 10), (3, 14), (5, 14)):
        made = recorded(name, seed, count)
        kept = [k for k in range(count) if not 0.4 * count <= k < 0.4 * count + 2]
        model = shared_model([made.captures[k] for k in kept], made.times[kept])
        good = np.flatnonzero(model.good)
        true = made.truth(np.linspace(0.0, 1.0, len(model.links) + 1))[kept]
        far = [np.linalg.norm(model.joints - true[:, ::way], axis=2).mean(axis=1)[good] for way in (1, -1)]
        turns = set(good[1:][np.diff(far[0] < far[1])].tolist())
        assert turns <= {doubt.capture for doubt in model.doubts}
        wrong += len(turns)
    assert wrong or name != "hose"


def test_nothing_is_in_doubt_in_a_whole_recording() -> None:
    assert shared_model((made := recorded("hose", 3)).captures, made.times).doubts == ()


def test_objects_of_two_lengths() -> None:
    made = recorded("hose", 3, 20)
    captures = [observation(f"f{k}", item.points[: 1000 if k < 10 else 850]) for k, item in enumerate(made.captures)]
    model = shared_model(captures)
    assert {exclusion.code for exclusion in model.exclusions[10:] + model.exclusions[:10] if exclusion} == {"length"}
    assert model.good.tolist() in ([True] * 10 + [False] * 10, [False] * 10 + [True] * 10)
    assert [doubt.code for doubt in model.doubts] == ["sizes"]
    assert "lengths differ, 1.0" in model.doubts[0].message
    assert shared_model(captures[:13]).doubts == ()
