"""Corrugated hoses: the line does not follow the ripples, and these are a note."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.types import Array

X = np.linspace(0.0, 1.2, 400)
LINE = from_points(np.stack([X, 0.12 * np.sin(5.0 * X), 0.0 * X], axis=1))


def hose(radius: float, height: float, pitch: float, half: float, count: int, seed: int) -> Array:
    """Points of a hose with ripples so many radii long and high, seen so many degrees to either side from above."""
    rng = np.random.default_rng(seed)
    s = rng.uniform(0.0, 1.0, count)
    tangent = LINE.tangents(s)
    side = np.cross([0.0, 0.0, 1.0], tangent)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.radians(rng.uniform(-half, half, count))
    away = radius * (1.0 + height * np.sin(2.0 * np.pi * s * LINE.length / (pitch * radius)))
    outward = np.sin(angle)[:, None] * side + np.cos(angle)[:, None] * np.cross(tangent, side)
    return LINE(s) + away[:, None] * outward + 0.015 * radius * rng.normal(size=(count, 3))


@pytest.mark.parametrize(("radius", "pitch", "count"), [(0.02, 2.5, 20_000), (0.02, 3.0, 6000), (0.012, 3.5, 12_000)])
@pytest.mark.parametrize("half", [180.0, 84.0])
def test_a_corrugated_hose_is_good_and_said_to_be_one(radius: float, pitch: float, count: int, half: float) -> None:
    result = fit(hose(radius, 0.1, pitch, half, count, seed=int(10 * pitch)))
    assert result.quality.verdict == "good"
    assert result.skeleton.length == pytest.approx(LINE.length, rel=2e-3)
    assert result.chain.radius == pytest.approx(radius, rel=0.02)
    found = result.skeleton(np.linspace(0.0, 1.0, 500))
    assert cKDTree(LINE(np.linspace(0.0, 1.0, 20_000))).query(found)[0].max() < 0.12 * radius
    (note,) = (item for item in result.quality.findings if item.code == "radius-varies")
    said = re.match(r"the radius goes up and down by (\d+) % every ([\d.]+) mm", note.message)
    assert said is not None and note.is_note
    assert float(said[1]) == pytest.approx(10.0, abs=2.5)
    assert float(said[2]) == pytest.approx(1e3 * pitch * radius, rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.15])
def test_a_smooth_tube_has_no_ripples(noise: float) -> None:
    for seed in range(3):
        line = random_centre_line(seed, clearance=0.05)
        result = fit(sample_tube(line, 0.012, 6000, seed, noise=noise * 0.012, side=(0.0, 0.0, 1.0)).points)
        assert "corrugated" not in " ".join(item.message for item in result.quality.findings)
