"""Chains from nodes on the axis, as trackers give them."""

from __future__ import annotations

import numpy as np
import pytest
from node_lines import EIGHT, HELIX, WAVE, even

import dlogen
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, FitError
from dlogen.geometry.polyline import distance_to_polyline
from dlogen.io.result import Result
from dlogen.stages.refined.node_line import clear_nodes, flat_nodes, smooth_line

Array = np.ndarray


def length(curve: Array) -> float:
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def codes(result: Result) -> dict[str, str]:
    return {finding.code: finding.severity for finding in result.quality.findings}


def shuffled(nodes: Array, seed: int = 0) -> Array:
    return nodes[np.random.default_rng(seed).permutation(len(nodes))]


@pytest.mark.parametrize("curve", [WAVE, HELIX, EIGHT], ids=["wave", "helix", "eight"])
@pytest.mark.parametrize("count", [20, 50, 120, 500, 3000])
@pytest.mark.parametrize("radius", [None, 0.004, 0.01])
def test_exact_nodes(curve: Array, count: int, radius: float | None) -> None:
    result = dlogen.fit(shuffled(even(curve, count)), {} if radius is None else {"r": radius})
    true = length(curve)
    step = true / (count - 1)
    line = result.skeleton(np.linspace(0, 1, 500))
    # A cubic through nodes of a bend of radius 0.1 m is off by the fourth power of their distance.
    assert distance_to_polyline(line, curve)[0].max() < max(1e-4, 0.5 * (step / 0.1) ** 4 * 0.1)
    assert result.skeleton.length == pytest.approx(true, rel=max(2e-4, 0.01 * (20 / count) ** 2))
    assert result.max_deviation <= result.e_max * (1 + 1e-9)
    if radius is None:
        assert result.quality.verdict == "doubtful" and codes(result)["radius-unknown"] == "doubtful"
        assert result.chain.radius == pytest.approx(true / 200, rel=0.01)
        message = result.quality.findings[0].message
        assert "guess" in message and "e_max" in message and "--set r=" in message
    else:
        assert result.chain.radius == radius
        assert result.quality.verdict == "good" and set(codes(result)) <= {"noise"}


@pytest.mark.parametrize("count", [20, 30, 50, 80, 120, 200])
@pytest.mark.parametrize("seed", range(3))
def test_millimetres_of_jitter(count: int, seed: int) -> None:
    nodes = even(WAVE, count) + np.random.default_rng(seed).normal(0.0, 0.001, (count, 3))
    result = dlogen.fit(shuffled(nodes), {"r": 0.005})
    line = result.skeleton(np.linspace(0, 1, 500))
    assert distance_to_polyline(line, WAVE)[0].max() < 0.004
    # Through the nodes, the line of 200 of them would be 4 % longer.
    assert result.skeleton.length == pytest.approx(length(WAVE), rel=3e-3)
    assert result.quality.verdict == "good" and codes(result)["noise"] == "note"


def test_a_curve_in_a_plane_and_a_straight_one() -> None:
    for nodes in (even(WAVE, 40), even(np.c_[WAVE[:, 0], 0 * WAVE[:, :2]], 40), even(WAVE, 40)[:, [2, 0, 1]]):
        result = dlogen.fit(nodes)
        assert result.skeleton.length == pytest.approx(length(nodes), rel=1e-3)
        assert codes(result) == {"radius-unknown": "doubtful"}


def test_flat_clouds_that_are_no_nodes() -> None:
    rng = np.random.default_rng(0)
    assert flat_nodes(even(WAVE, 40)) and flat_nodes(1000 * even(WAVE, 3000))
    assert not flat_nodes(np.c_[rng.uniform(size=(300, 2)), np.zeros(300)])
    assert not flat_nodes(np.round(1000 * even(WAVE, 40)))  # pixels, it seems
    assert not flat_nodes(even(HELIX, 40))


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_units_and_place(scale: float) -> None:
    nodes = scale * (even(HELIX, 60) + np.array([4e5, 5e6, 0.0]))
    result = dlogen.fit(nodes, {"units": "m" if scale == 1.0 else "mm", "r": 0.005})
    assert result.skeleton.length == pytest.approx(length(HELIX), rel=1e-3)
    assert result.quality.verdict == "good"


def test_a_gap_is_bridged_and_said() -> None:
    nodes = even(WAVE, 100)
    result = dlogen.fit(np.delete(nodes, range(30, 50), axis=0), {"r": 0.005})
    assert codes(result)["gap"] == "doubtful"
    assert result.skeleton.length == pytest.approx(length(WAVE), rel=0.02)


def test_a_stray_is_left_out() -> None:
    result = dlogen.fit(np.vstack([even(WAVE, 50), [[0.3, 0.5, 0.1]]]), {"r": 0.005})
    assert codes(result) == {"stray-points": "note"}
    assert result.skeleton.length == pytest.approx(length(WAVE), rel=1e-3)


def test_two_lines_are_refused_or_bad() -> None:
    nodes = even(WAVE, 50)
    with pytest.raises(FitError, match="may be two objects"):
        dlogen.fit(np.vstack([nodes, nodes + np.array([0.0, 0.5, 0.0])]), {"r": 0.005})


@pytest.mark.parametrize("count", [20, 80, 200])
def test_a_ring_has_no_ends(count: int) -> None:
    angle = 2 * np.pi * np.arange(count) / count
    result = dlogen.fit(np.c_[0.2 * np.cos(angle), 0.2 * np.sin(angle), 0 * angle], {"r": 0.005})
    assert result.quality.is_bad and codes(result)["closed-ring"] == "bad"


def test_nodes_as_far_apart_as_strands_are_never_good() -> None:
    """Loops that pass one another at about one spacing: the order may be wrong, and is not said to be right."""
    t = np.linspace(0.0, 1.0, 4000)
    loops = np.c_[0.5 * t - 0.1 * np.sin(3 * np.pi * t), 0.2 * np.cos(3 * np.pi * t), 0.02 * t]
    for count in (20, 35, 50):
        try:
            result = dlogen.fit(shuffled(even(loops, count)), {"r": 0.003})
        except FitError:
            continue
        assert not result.quality.is_good


def test_a_radius_that_cannot_be() -> None:
    with pytest.raises(ConfigError, match="more than the whole cloud"):
        dlogen.fit(even(WAVE, 50), {"r": 1.0})
    assert codes(dlogen.fit(even(HELIX, 200), {"r": 0.12}))["bend-tighter-than-radius"] == "bad"


def test_jitter_beyond_a_given_radius_is_doubtful() -> None:
    nodes = even(WAVE, 40) + np.random.default_rng(0).normal(0.0, 0.002, (40, 3))
    assert codes(dlogen.fit(nodes, {"r": 0.001}))["noise"] == "doubtful"


def test_settings_of_the_other_profile_are_named() -> None:
    assert "settings-not-used" in codes(dlogen.fit(even(WAVE, 50), Config(N=21)))


def test_a_surface_is_left_to_the_fit_of_tubes() -> None:
    for points in (200, 1000, 5000):
        assert clear_nodes(dlogen.synth("bent", points=points, seed=1).points, None) is None


def test_s_goes_with_arc_length() -> None:
    line = smooth_line(even(WAVE, 60))
    speed = np.linalg.norm(line(np.linspace(0, 1, 300), 1), axis=1)
    assert speed == pytest.approx(line.length, rel=1e-3)
