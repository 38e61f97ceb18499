"""Veils of flying pixels are left out, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.stages.refined.veil import veil
from dlogen.types import Array

DOWN = np.array([0.0, 0.0, -1.0])


def veiled(radius: float, share: float, depth: float, count: int, seed: int) -> tuple[Array, Array, float]:
    """A tube seen from above with so many points hanging from its edges, which of all points do, and its length."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.2, 200)
    phase = rng.uniform(0.0, 6.0)
    line = from_points(np.stack([x, 0.12 * np.sin(5.0 * x + phase), 0.02 * np.cos(4.0 * x)], axis=1))
    tube = sample_tube(line, radius, count, rng, noise=0.04 * radius, side=-DOWN).points
    s = rng.uniform(0.0, 1.0, int(share * count))
    across = np.cross(line.tangents(s), DOWN)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    away = rng.choice([-1.0, 1.0], len(s)) * (radius + rng.exponential(0.05 * radius, len(s)))
    hanging = line(s) + away[:, None] * across + rng.uniform(0.0, depth, len(s))[:, None] * DOWN
    return np.concatenate([tube, hanging]), np.arange(count + len(s)) >= count, line.length


@pytest.mark.parametrize(("radius", "share", "depth"), [(0.01, 0.15, 0.1), (0.01, 0.4, 0.1), (0.006, 0.3, 0.06)])
@pytest.mark.parametrize("count", [5000, 20_000])
def test_a_veil_is_left_out_with_a_note(radius: float, share: float, depth: float, count: int) -> None:
    points, hanging, length = veiled(radius, share, depth, count, seed=int(1000 * radius))
    result = fit(points)
    assert result.skeleton.length == pytest.approx(length, rel=5e-3)
    assert result.chain.radius == pytest.approx(radius, rel=0.03)
    assert not any(item.is_bad for item in result.quality.findings)
    (finding,) = (item for item in result.quality.findings if item.code == "stray-points")
    assert result.quality.verdict == ("good" if finding.is_note else "doubtful")
    assert finding.is_note or share > 0.3
    out = veil(points, radius)
    # What is next to the edge is as good as on it.
    assert out[hanging].mean() > 0.6
    assert out[~hanging].mean() < 0.01


@pytest.mark.parametrize("sampling", [{}, {"density_ratio": 10}, {"side": (0, 0, 1)}, {"noise": 1e-3}])
def test_an_object_is_no_veil(sampling: dict[str, object]) -> None:
    for seed in range(3):
        line = random_centre_line(seed, clearance=0.03)
        assert not veil(sample_tube(line, 0.01, 6000, seed, **sampling).points, 0.01).any()


def test_a_sparse_second_object_is_no_veil() -> None:
    line = random_centre_line(1, clearance=0.05)
    tube = sample_tube(line, 0.01, 6000, 1).points
    other = sample_tube(line, 0.01, 300, 2).points + np.array([0.0, 0.0, 1.0])
    assert not veil(np.concatenate([tube, other]), 0.01).any()
    result = fit(np.concatenate([tube, other]))
    assert "several-objects" in {item.code for item in result.quality.findings}
