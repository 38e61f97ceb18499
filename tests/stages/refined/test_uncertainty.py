"""How well a line is known is how far it is off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import dlogen
from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.curvature import curvature
from dlogen.io.report import WITHIN_95, report_dict
from dlogen.types import Array


def fits(noise: float, count: int = 5000, seeds: int = 6, **options) -> list[tuple[dlogen.Result, Array]]:
    """Fits of random tubes, and the distances of their lines from the true axis at the places of the uncertainty."""
    made = []
    for seed in range(seeds):
        line = random_centre_line(seed, clearance=0.08)
        result = dlogen.fit(sample_tube(line, 0.015, count, seed, noise=noise, **options).points)
        truth = cKDTree(line.points(20_000))
        made.append((result, truth.query(result.skeleton(result.uncertainty.s))[0]))
    return made


@pytest.mark.parametrize(
    ("noise", "options"), [(0.0003, {}), (0.001, {}), (0.001, {"side": [0.0, 0.0, -1.0]}), (0.0005, {"count": 400})]
)
def test_bands_of_95_percent_cover_the_axis(noise: float, options) -> None:
    inside = [np.mean((off < WITHIN_95 * fit.uncertainty.position)[2:-2]) for fit, off in fits(noise, **options)]
    assert np.mean(inside) >= 0.9
    # Not by being wide: half of that does not do.
    near = [np.mean((off < 0.4 * fit.uncertainty.position)[2:-2]) for fit, off in fits(noise, **options)]
    assert np.mean(near) < 0.6


def test_four_times_the_noise_is_about_four_times_as_uncertain() -> None:
    quiet, loud = (
        np.median([fit.uncertainty.position for fit, _ in fits(noise, seeds=3)]) for noise in (0.0004, 0.0016)
    )
    assert 2.0 < loud / quiet < 5.0


def test_the_curvature_of_an_arc_is_within_its_uncertainty() -> None:
    line = centre_line("bent")
    result = dlogen.fit(sample_tube(line, 0.02, 5000, 1, noise=0.001).points)
    s = result.uncertainty.s
    off = np.abs(
        curvature(result.skeleton, s) - np.interp(s, np.linspace(0, 1, 2001), line.curvature(np.linspace(0, 1, 2001)))
    )
    assert np.mean((off < 3.0 * result.uncertainty.curvature)[3:-3]) > 0.85


def test_it_is_in_the_report_with_the_regime() -> None:
    result = dlogen.fit(sample_tube(centre_line("straight"), 0.02, 2000, 1, noise=0.001).points)
    report = report_dict(result)
    assert report["regime"] == "surface"
    band = report["uncertainty"]
    assert len(band["s"]) == len(band["position_std"]) == len(band["curvature_std"]) == 51
    assert band["position_95"] == pytest.approx(WITHIN_95 * np.array(band["position_std"]))
    assert band["radius_std"] == pytest.approx(result.uncertainty.radius)
    given = report_dict(dlogen.fit(sample_tube(centre_line("straight"), 0.02, 2000, 1).points, {"r": 0.02}))
    assert given["uncertainty"]["radius_std"] == 0.0
    paper = report_dict(dlogen.fit(sample_tube(centre_line("straight"), 0.02, 2000, 1).points, {"profile": "paper"}))
    assert paper["uncertainty"] is None
