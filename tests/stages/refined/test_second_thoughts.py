"""What the fit disproves of the ordering's fears."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.pipeline import fit
from dlogen.stages.quality.findings import BRANCH, NOT_A_LINE
from dlogen.stages.refined.refine import refine
from dlogen.stages.refined.second_thoughts import reconsidered


def roll(radius: float, pitch: float, turns: int) -> CentreLine:
    """A flat roll: its turns `pitch` apart."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 400 * turns)
    away = 6.0 * radius + pitch * angle / (2.0 * np.pi)
    return from_points(np.stack([away * np.cos(angle), away * np.sin(angle), 0.0 * angle], axis=1))


@pytest.mark.parametrize(("radius", "pitch"), [(0.005, 3.6), (0.005, 4.0), (0.012, 3.6), (0.003, 5.0)])
def test_a_flat_roll_is_a_line(radius: float, pitch: float) -> None:
    line = roll(radius, pitch * radius, 4)
    result = fit(sample_tube(line, radius, 20_000, 3, noise=0.04 * radius).points)
    assert result.quality.verdict == "good"
    assert result.skeleton.length == pytest.approx(line.length, rel=2e-3)
    assert result.chain.radius == pytest.approx(radius, rel=0.01)


@pytest.mark.parametrize("length", [4.0, 5.8])
@pytest.mark.parametrize("side", [None, (0.0, 0.0, 1.0)])
def test_a_short_object_is_doubtful_and_right(length: float, side: tuple[float, float, float] | None) -> None:
    line = from_points(np.array([[0.0, 0.0, 0.0], [0.02 * length, 0.0, 0.0]]))
    result = fit(sample_tube(line, 0.02, 4000, 1, side=side).points)
    assert result.skeleton.length == pytest.approx(line.length, rel=0.01)
    assert result.chain.radius == pytest.approx(0.02, rel=0.01)
    (finding,) = (item for item in result.quality.findings if not item.is_note)
    assert finding.code == NOT_A_LINE.code and finding.severity == "doubtful"
    assert f"{0.5 * length:.1f} diameters" in finding.message


def test_what_the_fit_does_not_disprove_stays() -> None:
    rng = np.random.default_rng(2)
    line = from_points(np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]]))
    tube = sample_tube(line, 0.01, 4000, 1, noise=2e-4).points
    findings = [NOT_A_LINE.found("feared", "bad"), BRANCH.found("seen", s=0.5)]
    backbone = np.stack([np.linspace(0.01, 0.39, 40), np.zeros(40), np.zeros(40)], axis=1)
    assert reconsidered(findings, refine(tube, backbone, 0.01)) == findings[1:]
    # A fifth of the points elsewhere, or noise that makes it anything, and nothing is disproved.
    table = np.stack([rng.uniform(0.0, 0.4, 1000), rng.uniform(-0.2, 0.2, 1000), np.full(1000, -0.05)], axis=1)
    noisy = tube + 1.5e-3 * rng.normal(size=tube.shape)
    for cloud in (np.concatenate([tube, table]), noisy):
        assert reconsidered(findings, refine(cloud, backbone, 0.01)) == findings
