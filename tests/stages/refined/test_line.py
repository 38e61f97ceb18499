"""The stages of the profile refined one after another: what they choose, leave behind, and say when they fail."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.errors import ConfigError, FitError
from dlogen.evaluation.shapes import loop_centre_line
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.geometry.polyline import arc_lengths, distance_to_polyline, resample
from dlogen.geometry.vectors import unit
from dlogen.stages.clock import Clock
from dlogen.stages.prepare import prepare
from dlogen.stages.refined.line import _PAPER_ONLY, refined_line
from dlogen.types import Array, Cloud, FittedLine

#: Strays far from the tube, after its points.
STRAYS = 100


@pytest.fixture(scope="module")
def cloud(tube: SyntheticCloud) -> Cloud:
    """The tube with noise of half a millimetre, and strays."""
    rng = np.random.default_rng(4)
    low, high = tube.points.min(axis=0), tube.points.max(axis=0)
    strays = rng.uniform(low, high, (40 * STRAYS, 3))
    strays = strays[tube.truth.nearest(strays)[1] > 0.05][:STRAYS]
    return prepare(
        Cloud(np.vstack([tube.points + rng.normal(scale=0.0005, size=tube.points.shape), strays])), "m"
    ).cloud


@pytest.fixture(scope="module")
def timed(cloud: Cloud) -> tuple[FittedLine, Clock]:
    clock = Clock()
    return refined_line(cloud, Config(), clock), clock


def codes(line: FittedLine) -> list[str]:
    return [finding.code for finding in line.findings]


def test_the_line_is_the_axis_from_end_to_end(
    timed: tuple[FittedLine, Clock], cloud: Cloud, tube: SyntheticCloud
) -> None:
    line, _ = timed
    moved = (tube.points - cloud.points[: len(tube.points)]).mean(axis=0)
    distance = tube.truth.nearest(line.skeleton(np.linspace(0, 1, 200)) + moved)[1]
    assert distance.mean() < 1e-4 and distance.max() < 1e-3  # a fifth of the noise, and twice of it
    assert line.skeleton.length == pytest.approx(tube.truth.length, rel=2e-3)
    assert line.radius == pytest.approx(0.015, rel=0.01)


def test_what_was_chosen_stands_under_its_dotted_key(timed: tuple[FittedLine, Clock]) -> None:
    line, _ = timed
    assert line.chosen == {"r": line.radius, "N": line.skeleton.basis.size}


def test_stages_and_what_they_leave_are_in_order(timed: tuple[FittedLine, Clock], cloud: Cloud) -> None:
    line, clock = timed
    assert list(clock.seconds) == ["scale", "ordering", "refine"]
    ordering, on, off = line.intermediates
    assert [item.name for item in line.intermediates] == ["ordering", "tube", "off_tube"]
    assert len(ordering.points) > 20
    assert len(on.points) + len(off.points) == len(cloud.points)
    assert on.colour == "s" and off.colour is None
    s = on.columns["s"]
    assert (np.diff(s) >= 0).all() and s[0] < 0.01 and s[-1] > 0.99
    # Each point has its own residual and place, although they have been sorted.
    foot = line.skeleton(s)
    away = np.linalg.norm(on.points - foot, axis=1)
    inside = (s > 0.0) & (s < 1.0)
    np.testing.assert_allclose(away[inside], line.radius + on.columns["residual"][inside], atol=2e-5)
    # As many strays as there are, and none of them on the tube.
    np.testing.assert_array_equal(off.points, cloud.points[~line.on_tube])
    np.testing.assert_allclose(off.columns["residual"], line.distance[~line.on_tube] - line.radius, atol=1e-12)
    assert not line.on_tube[-STRAYS:].any()
    assert line.on_tube[:-STRAYS].mean() > 0.99


def test_distances_are_those_to_a_dense_line(timed: tuple[FittedLine, Clock], cloud: Cloud) -> None:
    line, _ = timed
    dense = line.skeleton(np.linspace(0.0, 1.0, 20_000))
    some = np.flatnonzero(line.on_tube)[::50]
    expected = np.linalg.norm(cloud.points[some, None] - dense, axis=2).min(axis=1)
    np.testing.assert_allclose(line.distance[some], expected, atol=1e-5)
    assert line.distance.shape == line.on_tube.shape == (len(cloud.points),)


def test_a_given_radius_stays(cloud: Cloud) -> None:
    line = refined_line(cloud, Config(r=0.0153), Clock())
    assert line.radius == line.chosen["r"] == 0.0153
    assert "radius-mismatch" not in codes(line)


def test_a_wrong_radius_is_said(cloud: Cloud) -> None:
    assert "radius-mismatch" in codes(refined_line(cloud, Config(r=0.02), Clock()))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({}, None),
        ({"e_max": 0.003, "joints.dof": 3, "seed": 3}, None),
        ({"beta": 0.1}, "beta"),
        ({"r_n": 0.1, "normals.neighbours": 20, "sorting.start": 3}, "r_n, normals.neighbours, sorting.start"),
    ],
)
def test_settings_that_are_not_used_are_said(changes: dict[str, float], named: str | None, cloud: Cloud) -> None:
    line = refined_line(cloud, Config().replace(changes), Clock())
    found = [finding for finding in line.findings if finding.code == "settings-not-used"]
    assert [finding.message.rsplit(": ", 1)[1] for finding in found] == ([] if named is None else [named])


def test_they_are_settings_that_there_are() -> None:
    for key in _PAPER_ONLY:
        Config().value(key)
    # Those that it does use are not among them.
    assert not {"r", "e_max", "units", "profile"} & {*_PAPER_ONLY}


def test_a_radius_that_cannot_be_names_its_stage(cloud: Cloud) -> None:
    clock = Clock()
    with pytest.raises(ConfigError, match="more than the whole cloud") as caught:
        refined_line(cloud, Config(r=5.0), clock)
    assert caught.value.stage == "scale"
    assert list(clock.seconds) == ["scale"]


def test_a_failure_of_the_fit_is_explained_by_what_was_wrong_before(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dlogen.stages.quality.findings import CLOSED_RING
    from dlogen.stages.refined import line as module

    def failing(*args: object, **kwargs: object) -> None:
        raise FitError("the tube is lost")

    monkeypatch.setattr(module, "refine", failing)
    with pytest.raises(FitError, match="the tube is lost") as caught:
        refined_line(cloud, Config(), Clock())
    assert caught.value.stage == "refine"

    order = module.order_any

    def with_a_ring(*args: object) -> object:
        from dataclasses import replace

        found = order(*args)
        return replace(found, findings=(*found.findings, CLOSED_RING.found("a ring has no ends", "bad")))

    monkeypatch.setattr(module, "order_any", with_a_ring)
    with pytest.raises(FitError, match="no chain can be made of this cloud: a ring has no ends") as caught:
        refined_line(cloud, Config(), Clock())
    assert isinstance(caught.value.__cause__, FitError) and caught.value.__cause__.message == "the tube is lost"


def test_strands_that_touch_are_said_once() -> None:
    touching = sample_tube(loop_centre_line(1.4, 2.02 * 0.012), 0.012, 4000, 3)
    line = refined_line(prepare(Cloud(touching.points), "m").cloud, Config(), Clock())
    found = codes(line)
    assert len(set(found)) == len(found), found


def meander(passes: int, width: float, gap: float) -> Array:
    """A flat line that goes to and fro, as 2,000 vertices a metre, metres."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 60)[1:-1]
    corners = []
    for k in range(passes):
        way = 1 if k % 2 == 0 else -1
        corners.append(np.stack([np.array([0.0, width])[::way], np.full(2, k * gap)], axis=1))
        bend = [(width if way > 0 else 0.0) + way * 0.5 * gap * np.cos(turn), (k + 0.5 + 0.5 * np.sin(turn)) * gap]
        corners.append(np.stack(bend, axis=1))
    flat = np.concatenate(corners[:-1])
    line = np.append(flat, np.zeros((len(flat), 1)), axis=1)
    return resample(line, int(2000 * arc_lengths(line)[-1]))


@pytest.mark.parametrize(("passes", "noise", "mean"), [(12, 0.0, 0.01e-3), (12, 2e-4, 0.05e-3), (30, 2e-4, 0.05e-3)])
def test_a_long_line_bends_as_often_as_the_object_does(passes: int, noise: float, mean: float) -> None:
    """Thousands of radii of cable, in bends of six radii: no number of knots or points may be fixed."""
    axis, radius, rng = meander(passes, 0.5, 0.05), 0.004, np.random.default_rng(passes)
    length = float(arc_lengths(axis)[-1])
    count = int(25 * length / radius)
    index, angle = rng.integers(0, len(axis), count), rng.uniform(0.0, 2.0 * np.pi, count)
    tangent = unit(np.gradient(axis, axis=0))[index]
    sideways = np.stack([-tangent[:, 1], tangent[:, 0], np.zeros(count)], axis=1)
    points = axis[index] + radius * (np.sin(angle)[:, None] * sideways + np.cos(angle)[:, None] * [0.0, 0.0, 1.0])
    prepared = prepare(Cloud(points + rng.normal(scale=max(noise, 1e-9), size=points.shape)), "m")
    out = refined_line(prepared.cloud, Config(), Clock())
    line = out.skeleton(np.linspace(0.0, 1.0, 10_000)) + prepared.centre
    assert out.skeleton.length == pytest.approx(length, abs=2e-3)
    assert distance_to_polyline(line, axis)[0].mean() < mean
    assert out.radius == pytest.approx(radius, rel=2e-3)
