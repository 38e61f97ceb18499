"""Thick ends: plugs keep the length and say nothing of the radius."""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.result import Result
from dlogen.pipeline import fit
from dlogen.stages.refined.plugs import Plug, contracted, find_plug
from dlogen.stages.refined.refine import refine
from dlogen.types import Array


def cable() -> CentreLine:
    x = np.linspace(0.0, 1.2, 400)
    return from_points(np.stack([x, 0.12 * np.sin(5.0 * x), 0.0 * x], axis=1))


def with_heads(radius: float, head: float, long: float, *, count: int, half: float, noise: float, seed: int) -> Array:
    """Points of the cable, of which the last `long` radii at either end are `head` times as thick.

    Seen from above, so many degrees to either side.
    """
    rng = np.random.default_rng(seed)
    line = cable()
    s = rng.uniform(0.0, 1.0, count)
    tangent = line.tangents(s)
    side = np.cross([0.0, 0.0, 1.0], tangent)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.radians(rng.uniform(-half, half, count))
    away = np.where(np.minimum(s, 1.0 - s) * line.length < long * radius, head * radius, radius)
    outward = np.sin(angle)[:, None] * side + np.cos(angle)[:, None] * np.cross(tangent, side)
    return line(s) + away[:, None] * outward + noise * rng.normal(size=(count, 3))


def check(result: Result, radius: float, head: float, long: float) -> None:
    line = cable()
    assert result.quality.verdict == "good"
    assert result.skeleton.length == pytest.approx(line.length, abs=0.003)
    assert result.chain.radius == pytest.approx(radius, rel=0.02)
    found = result.skeleton(np.linspace(0.0, 1.0, 500))
    assert cKDTree(line(np.linspace(0.0, 1.0, 20_000))).query(found)[0].max() < 0.25 * radius
    notes = [item for item in result.quality.findings if item.code == "radius-varies"]
    assert len(notes) == 2
    for note, name, at in zip(notes, ("first", "last"), (0.0, 1.0), strict=True):
        said = re.fullmatch(
            rf"the {name} end is thicker for ([\d.]+) mm, with a radius of ([\d.]+) mm: left out of .*", note.message
        )
        assert said is not None and note.is_note and note.s is not None and abs(note.s - at) < 0.1
        assert float(said[1]) == pytest.approx(1e3 * long * radius, abs=2.5e3 * radius)
        assert float(said[2]) == pytest.approx(1e3 * head * radius, rel=0.08)


@pytest.mark.parametrize(
    ("radius", "head", "long"),
    [(0.003, 1.5, 3.0), (0.003, 1.5, 6.0), (0.005, 1.8, 3.0), (0.01, 2.0, 3.0), (0.008, 1.35, 9.0), (0.006, 2.7, 8.0)],
)
@pytest.mark.parametrize("half", [180.0, 84.0])
def test_the_length_goes_to_the_end_of_the_plugs(radius: float, head: float, long: float, half: float) -> None:
    points = with_heads(radius, head, long, count=12_000, half=half, noise=3e-4, seed=int(1e4 * radius))
    check(fit(points), radius, head, long)


@pytest.mark.parametrize(("count", "noise"), [(6000, 0.03), (30_000, 0.08)])
def test_with_few_points_and_with_noise(count: int, noise: float) -> None:
    check(fit(with_heads(0.006, 2.0, 5.0, count=count, half=180.0, noise=noise * 0.006, seed=3)), 0.006, 2.0, 5.0)


def test_ends_as_thick_as_the_rest_are_no_plugs() -> None:
    for seed, (noise, side) in enumerate(product((0.0, 8e-4), (None, (0.0, 0.0, 1.0)))):
        line = random_centre_line(seed, clearance=0.05)
        points = sample_tube(line, 0.01, 6000, seed, noise=noise, side=side).points
        fitted = refine(points, line.points(100), 0.01)
        assert find_plug(points, fitted, False) is None
        assert find_plug(points, fitted, True) is None


def test_only_the_plug_is_moved_to_the_radius_of_the_object() -> None:
    plug = Plug(np.zeros(3), np.array([1.0, 0.0, 0.0]), start=0.02, end=0.06, radius=0.02, cut=0.9)
    points = np.array([[0.01, 0.01, 0.0], [0.03, 0.0, 0.02], [0.05, -0.02, 0.0], [0.05, 0.0, 0.2], [-0.03, 0.02, 0.0]])
    expected = points.copy()
    expected[1:3, 1:] *= 0.5
    assert contracted(points, plug, 0.01) == pytest.approx(expected)
    assert plug.contains(np.array([0.05, 0.02, 0.0]), 0.001) and not plug.contains(np.array([0.09, 0.0, 0.0]), 0.001)
