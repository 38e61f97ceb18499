"""Thick stretches along an object are said, and are no branches."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.stages.refined.collars import find_collars
from dlogen.stages.refined.refine import refine

X = np.linspace(0.0, 1.2, 400)
LINE = from_points(np.stack([X, 0.12 * np.sin(5.0 * X), 0.0 * X], axis=1))


def collared(radius: float, head: float, long: float, seed: int, half: float = 180.0) -> np.ndarray:
    """Points of the line, thicker for `long` radii around s = 0.4, seen so many degrees to either side from above."""
    rng = np.random.default_rng(seed)
    s = rng.uniform(0.0, 1.0, 20_000)
    tangent = LINE.tangents(s)
    side = np.cross([0.0, 0.0, 1.0], tangent)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.radians(rng.uniform(-half, half, len(s)))
    away = np.where(np.abs(s - 0.4) * LINE.length < 0.5 * long * radius, head * radius, radius)
    outward = np.sin(angle)[:, None] * side + np.cos(angle)[:, None] * np.cross(tangent, side)
    return LINE(s) + away[:, None] * outward + 3e-4 * rng.normal(size=(len(s), 3))


@pytest.mark.parametrize(
    ("radius", "head", "long", "half"),
    [(0.005, 1.5, 4.0, 180.0), (0.005, 2.0, 6.0, 180.0), (0.008, 2.8, 4.0, 180.0), (0.008, 2.8, 4.0, 84.0)],
)
def test_a_connector_is_a_note(radius: float, head: float, long: float, half: float) -> None:
    result = fit(collared(radius, head, long, 1, half))
    assert result.quality.verdict == "good"
    assert result.skeleton.length == pytest.approx(LINE.length, abs=1.5e-3)
    assert result.chain.radius == pytest.approx(radius, rel=0.01)
    (note,) = (item for item in result.quality.findings if item.code == "radius-varies")
    said = re.match(r"thicker for ([\d.]+) mm, with a radius of ([\d.]+) mm instead of ", note.message)
    assert said is not None and note.is_note and note.s == pytest.approx(0.4, abs=0.01)
    assert float(said[1]) == pytest.approx(1e3 * long * radius, abs=1e3 * radius)
    assert float(said[2]) == pytest.approx(1e3 * head * radius, rel=0.05)


def test_neither_a_branch_nor_a_strand_beside_it_is_a_collar() -> None:
    tube = sample_tube(LINE, 0.01, 12_000, 1).points
    root, tangent = LINE(0.4)[0], LINE.tangents(0.4)[0]
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    twig = from_points(root + np.linspace(0.0, 0.2, 20)[:, None] * across)
    beside = from_points(LINE(np.linspace(0.3, 0.45, 30)) + np.array([0.0, 0.0, 0.021]))
    for other in (twig, beside):
        points = np.concatenate([tube, sample_tube(other, 0.01, int(9000 * other.length), 2).points])
        assert find_collars(refine(points, LINE.points(120), 0.01)) == []
    points = np.concatenate([tube, sample_tube(twig, 0.01, 1800, 2).points])
    assert "branch" in {item.code for item in fit(points).quality.findings}
