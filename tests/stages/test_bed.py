"""The strip of a table beside a cable: found to the point, and never where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from partly_seen import arc, on_table, oval, two_views

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube, synth
from dlogen.pipeline import fit
from dlogen.stages.bed import bed_points


@pytest.mark.parametrize("radius", [0.003, 0.012])
@pytest.mark.parametrize("edge", [0.2, 0.5, 1.0])
@pytest.mark.parametrize(("noise", "count"), [(0.02, 2000), (0.1, 6000)])
def test_the_strip_is_found_and_nothing_else(radius: float, edge: float, noise: float, count: int) -> None:
    points = on_table(radius, edge * radius, count, noise * radius, seed=3)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for cloud in (points, points @ turn.T + 2.0):
        bed = bed_points(cloud)
        assert not bed[:count].any()
        # Within four standard deviations of the plane, as far as these are known.
        assert bed[count:].mean() > 0.99


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.15])
@pytest.mark.parametrize("seed", range(2))
def test_cables_without_a_strip_have_none(noise: float, seed: int) -> None:
    clouds = [arc(0.01, half, 4000, noise * 0.01, seed, hang) for half in (180, 90, 70, 40) for hang in (False, True)]
    clouds += [oval(0.02, height, 4000, noise * 0.01, seed) for height in (0.014, 0.006)]
    clouds += [two_views(0.01, shift, 4000, noise * 0.01, seed) for shift in (0.0, 0.004)]
    line = random_centre_line(seed, clearance=0.06)
    clouds += [sample_tube(line, 0.01, 4000, seed, noise=noise * 0.01, side=side).points for side in (None, [0, 0, 1])]
    for points in clouds:
        assert not bed_points(points).any()


def test_depth_in_steps_is_no_strip() -> None:
    points = arc(0.01, 85.0, 6000, seed=1)
    points[:, 2] = np.round(points[:, 2] / 0.002) * 0.002
    assert not bed_points(points).any()


def test_few_points_have_none() -> None:
    assert not bed_points(on_table(0.01, 0.01, 60)).any()


@pytest.mark.parametrize("edge", [0.2, 0.5, 1.0])
def test_the_radius_is_right_beside_a_strip(edge: float) -> None:
    result = fit(on_table(0.005, edge * 0.005, 6000, 0.0005, seed=1))
    assert result.chain.radius == pytest.approx(0.005, rel=0.02)
    assert result.skeleton.length == pytest.approx(1.2987, rel=0.002)
    assert result.quality.verdict == "good"
    (note,) = (item for item in result.quality.findings if item.code == "stray-points" and "plane" in item.message)
    assert note.message.startswith(f"{100 * edge / (1 + edge):.0f} %")


@pytest.mark.parametrize("seed", range(3))
def test_a_straight_piece_far_below_the_rest_is_none(seed: int) -> None:
    # All of the rest lies within its height, which is many radii, beside the piece.
    turn = np.linspace(0.0, 5.0, 60)
    arc_above = np.stack([0.4 * np.cos(turn), 0.4 * np.sin(turn), 0.3 + 0.02 * np.sin(turn)], axis=1)
    rest = sample_tube(from_points(arc_above), 0.006, 3000, seed).points
    for side in (None, [0.0, 0.1, -1.0]):
        piece = sample_tube(from_points([[-0.2, 0, 0], [0.2, 0, 0]]), 0.006, 1500, seed, side=side).points
        assert not bed_points(np.concatenate([piece, rest])).any()


@pytest.mark.parametrize("seed", range(4))
def test_the_lower_side_of_a_flat_curve_with_a_gap_is_none(seed: int) -> None:
    points = synth("bent", points=5000, seed=seed, noise=0.0005, gaps=[(0.4, 0.75)]).points
    for moved in (points, points - 0.5 * (points.min(axis=0) + points.max(axis=0))):
        assert not bed_points(moved).any()
