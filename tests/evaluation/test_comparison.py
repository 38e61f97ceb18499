"""How two curves differ: direction, sampling, and the numbers of MDTW."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable

import numpy as np
import pytest
from curve_files import HOOK, bent, helical

from dlogen.evaluation.comparison import compare
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.io.json_text import dump_json
from dlogen.types import FitData, Skeleton


@pytest.fixture(scope="module")
def result(
    make_result: Callable[..., FitData], fitted: Callable[..., Skeleton], helix: Callable[..., Skeleton]
) -> FitData:
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01, name="cable")


def test_even_arc_length_takes_the_parameter_out() -> None:
    # One curve sampled in two parameters is about a quarter of the sample spacing from itself; resampled it is not.
    s = np.linspace(0, 1, 1000)
    spacing = arc_lengths(bent(s))[-1] / 999
    assert 0.15 * spacing < mdtw(bent(s), bent(0.8 * s + 0.2 * s**2)).mean < 0.35 * spacing
    fine = np.linspace(0, 1, 20_000)
    assert compare(bent(fine), bent(0.8 * fine + 0.2 * fine**2))["mean"] < 1e-4 * spacing


@pytest.mark.parametrize(("flip_a", "flip_b"), [*itertools.product([False, True], repeat=2)])
def test_compare_finds_the_direction(flip_a: bool, flip_b: bool) -> None:
    s = np.linspace(0, 1, 300)
    a, b = helical(s), helical(s) * [1, 1, 1.1]
    expected = compare(a, b)
    found = compare(a[::-1] if flip_a else a, b[::-1] if flip_b else b)
    assert found["reversed"] is (flip_a != flip_b)
    for key in ("mean", "max", "hausdorff", "length_a", "length_b"):
        assert found[key] == pytest.approx(expected[key])
    assert found["length_difference"] == pytest.approx(found["length_a"] - found["length_b"])
    assert found["length_difference"] < 0


def test_compare_keeps_the_direction_when_told_to_and_in_doubt() -> None:
    line = np.array([[0.0, 0, 0], [1, 0, 0]])
    found = compare(line, line[::-1], 100, align_direction=False)
    assert found["reversed"] is False
    assert found["mean"] > 0.1
    assert found["hausdorff"] == pytest.approx(0, abs=1e-12)
    across = np.array([[0.5, -1.0, 0], [0.5, 1, 0]])
    assert compare(line, across)["reversed"] is False


def test_compare_is_mdtw_of_even_samples() -> None:
    a, b = HOOK, HOOK + 0.01 * np.eye(4, 3)
    found, expected = compare(a, b, 250), mdtw(resample(a, 250), resample(b, 250))
    assert (found["samples"], found["sampling"]) == (250, "even arc length")
    assert (found["mean"], found["std"], found["max"]) == (expected.mean, expected.std, expected.max)
    assert found["path_length"] == len(found["error"]) == len(found["s"]) == len(expected.path)
    assert found["error"] == expected.error.tolist()
    assert json.loads(dump_json(found)) == found


def test_compare_does_not_depend_on_how_often_a_curve_was_sampled(result: FitData) -> None:
    joints = result.chain.joints
    once, often = compare(result.skeleton_points, joints), compare(result.skeleton_points, resample(joints, 5001))
    assert often["mean"] == pytest.approx(once["mean"], rel=1e-3)
    assert often["hausdorff"] == pytest.approx(once["hausdorff"], rel=1e-3)
    # The chain was made not to leave the skeleton line by more than e_max, half the radius here.
    assert 0.5 * result.e_max < once["hausdorff"] <= result.e_max


def test_parallel_lines_are_as_far_apart_as_they_are() -> None:
    a = np.array([[0.0, 0, 0], [2.0, 0, 0]])
    found = compare(a, a + np.array([0.0, 0.3, 0.4]), 100)
    for key in ("mean", "max", "hausdorff"):
        assert found[key] == pytest.approx(0.5)
    assert (found["std"], found["length_a"], found["length_difference"]) == pytest.approx((0.0, 2.0, 0.0))
    longer = compare(3.0 * a, a)
    assert (longer["length_a"], longer["length_b"], longer["length_difference"]) == (6.0, 2.0, 4.0)
    assert longer["hausdorff"] == pytest.approx(4.0)
