"""Nodes on the axis in the order that they have on their line, and told from points of a surface."""

from __future__ import annotations

import numpy as np
import pytest
from node_lines import EIGHT, HELIX, HOOK, WAVE, even

from dlogen.evaluation.synthetic import synth
from dlogen.stages.refined.nodes import is_thin, order_nodes

Array = np.ndarray


def same_line(found: Array, expected: Array) -> bool:
    return np.array_equal(found, expected) or np.array_equal(found, expected[::-1])


@pytest.mark.parametrize("curve", [WAVE, HELIX, EIGHT, HOOK], ids=["wave", "helix", "eight", "hook"])
@pytest.mark.parametrize("count", [20, 35, 80, 200, 500])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_any_order_comes_to_the_right_one(curve: Array, count: int, jitter: float) -> None:
    rng = np.random.default_rng(count)
    nodes = even(curve, count)
    spacing = np.linalg.norm(nodes[1] - nodes[0])
    nodes = nodes + jitter * spacing * rng.normal(size=nodes.shape)
    found = order_nodes(nodes[rng.permutation(count)], clear=True)
    assert found is not None
    assert same_line(found.points, nodes)
    # Six nodes for each turn of a helix scatter as points of a surface do.
    assert found.likely or (curve is HELIX and count == 20)
    assert found.spacing == pytest.approx(spacing, rel=0.15)
    if count > 20:
        assert found.scatter <= (1.5 * jitter + 0.02) * spacing


def test_it_is_the_same_for_every_order_to_the_last_bit() -> None:
    nodes = even(EIGHT, 60) + 0.001 * np.random.default_rng(0).normal(size=(60, 3))
    first = order_nodes(nodes)
    assert first is not None
    for seed in range(3):
        again = order_nodes(nodes[np.random.default_rng(seed).permutation(60)])
        assert again is not None and np.array_equal(again.points, first.points)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_place_and_direction_do_not_matter(scale: float) -> None:
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    nodes = scale * (even(HELIX, 50) @ turn.T + rng.normal(size=3))
    found = order_nodes(nodes[rng.permutation(50)], clear=True)
    assert found is not None and found.certain and same_line(found.points, nodes)


@pytest.mark.parametrize("points", [12, 30, 60, 100, 200, 500, 1000])
@pytest.mark.parametrize("shape", ["straight", "bent", "helical"])
@pytest.mark.parametrize("seed", [0, 1])
def test_points_of_a_surface_are_not_taken_for_nodes(points: int, shape: str, seed: int) -> None:
    found = order_nodes(synth(shape, points=points, seed=seed).points, clear=True)
    # Where the tube is seen once in six radii of length, nodes look the same.
    cloud = synth(shape, points=2, seed=0)
    if cloud.truth.length / points < 3.0 * cloud.radius:
        assert found is None or not found.likely


def test_planes_and_balls_are_no_nodes() -> None:
    rng = np.random.default_rng(0)
    for count in (30, 100, 500):
        plane, ball = np.c_[rng.uniform(size=(count, 2)), np.zeros(count)], rng.normal(size=(count, 3))
        for points in (plane, ball):
            found = order_nodes(points)
            assert found is None or not found.possible


def test_scan_lines_along_a_tube_are_not_certainly_nodes() -> None:
    """Five lines, with points as far apart as a tenth of the radius."""
    x = np.linspace(0.0, 0.2, 200)
    lines = [np.c_[x, np.full(200, 0.01 * np.cos(a)), np.full(200, 0.01 * np.sin(a))] for a in np.arange(5) * 0.5]
    found = order_nodes(np.concatenate(lines), clear=True)
    assert found is None or not found.certain


def test_thin_and_thick() -> None:
    rng = np.random.default_rng(0)
    assert is_thin(HELIX) and is_thin(even(WAVE, 3000) + 1e-6 * rng.normal(size=(3000, 3)))
    for shape in ("straight", "bent", "helical"):
        assert not is_thin(synth(shape, points=4000, seed=1).points)
        assert not is_thin(synth(shape, points=100_000, seed=1).points)


@pytest.mark.parametrize("count", [3000, 20_000])
def test_of_many_an_even_part_is_taken_with_both_ends(count: int) -> None:
    nodes = even(WAVE, count)
    found = order_nodes(nodes[np.random.default_rng(0).permutation(count)])
    assert found is not None and found.certain and len(found.points) <= 1000
    ends = {tuple(found.points[0]), tuple(found.points[-1])}
    assert ends == {tuple(nodes[0]), tuple(nodes[-1])}
    steps = np.linalg.norm(np.diff(found.points, axis=0), axis=1)
    assert steps.max() < 1.6 * steps.mean() and steps.sum() == pytest.approx(1.295, abs=0.005)


def test_a_node_by_itself_is_left_out() -> None:
    nodes = even(WAVE, 50)
    found = order_nodes(np.vstack([nodes, [[0.3, 0.5, 0.1]]]))
    assert found is not None and same_line(found.points, nodes)


def test_too_few() -> None:
    assert order_nodes(even(WAVE, 7)) is None
    assert order_nodes(np.zeros((20, 3))) is None
