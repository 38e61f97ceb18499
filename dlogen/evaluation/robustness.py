"""Clouds as sensors give them, with the accuracy that the refined profile has to reach on each kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.paper_tables import Figure
from dlogen.evaluation.shapes import centre_line, loop_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.curvature import max_curvature
from dlogen.pipeline import fit
from dlogen.types import FitData

_FROM_ABOVE = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Case:
    """One kind of cloud.

    Attributes:
        name: what it is.
        line: the true axis, from a random generator.
        radius: metres.
        limits: mean and maximum of the distance of the fitted line to the true one in mm, length error in percent.
        count: number of points.
        sampling: further arguments of `sample_tube`.
    """

    name: str
    line: Callable[[np.random.Generator], CentreLine]
    radius: float
    limits: tuple[float, float, float]
    count: int = 5000
    sampling: dict[str, Any] = field(default_factory=dict)


def _random(clearance: float = 0.03, **settings: Any) -> Callable[[np.random.Generator], CentreLine]:
    # Without a clearance a random line may pass through itself, which no object does.
    return lambda rng: random_centre_line(rng, clearance=clearance, **settings)


def _fixed(line: CentreLine) -> Callable[[np.random.Generator], CentreLine]:
    return lambda rng: line


_HALF = {"noise": 0.5e-3}

CASES = (
    Case("bent, no noise", _fixed(centre_line("bent")), 0.02, (0.01, 1.5, 0.1)),
    Case("straight, no noise", _fixed(centre_line("straight")), 0.02, (0.01, 0.5, 0.1)),
    Case("helical, no noise", _fixed(centre_line("helical")), 0.02, (0.01, 1.5, 0.1)),
    Case("random, no noise", _random(), 0.012, (0.01, 0.5, 0.1)),
    Case("noise 1 mm", _random(), 0.012, (0.15, 0.8, 0.2), sampling={"noise": 1e-3}),
    Case("one side, noise 1 mm", _random(0.04), 0.015, (0.4, 2.0, 0.5), sampling={"noise": 1e-3, "side": _FROM_ABOVE}),
    Case(
        "plane curve, one side, noise 2 mm",
        _random(0.05, dimensions=2),
        0.02,
        (0.6, 3.0, 0.5),
        sampling={"noise": 2e-3, "side": _FROM_ABOVE},
    ),
    Case("10 % strays", _random(), 0.012, (0.1, 0.6, 0.3), sampling={**_HALF, "stray_fraction": 0.1}),
    Case("two gaps", _random(), 0.012, (0.15, 1.5, 0.2), sampling={**_HALF, "gaps": ((0.28, 0.32), (0.61, 0.65))}),
    Case("density 1:10", _random(), 0.012, (0.1, 0.8, 0.3), sampling={**_HALF, "density_ratio": 10.0}),
    Case("strands cross, 5 r apart", _fixed(loop_centre_line(1.4, 0.06)), 0.012, (0.1, 0.8, 0.2), sampling=_HALF),
    Case("strands touch", _fixed(loop_centre_line(1.4, 2.1 * 0.012)), 0.012, (0.1, 0.8, 0.2), sampling=_HALF),
    Case("wire, r 1.5 mm", _random(), 0.0015, (0.1, 0.6, 0.3), sampling=_HALF),
    Case("300 points", _random(), 0.012, (0.3, 6.0, 1.0), count=300, sampling=_HALF),
    Case("bends down to 3 r", _random(min_bend_radius=0.036), 0.012, (0.2, 1.0, 0.3), sampling=_HALF),
)


@dataclass(frozen=True)
class Accuracy:
    """How far a fit is from the truth.

    Attributes:
        mean, max: distance of 1,000 points of the fitted line, even in arc length, to the true axis, metres.
        length: relative error of the length.
        radius: relative error of the radius.
        curvature: relative error of the largest curvature; NaN for a straight line.
    """

    mean: float
    max: float
    length: float
    radius: float
    curvature: float


def accuracy(result: FitData, truth: CentreLine, radius: float) -> Accuracy:
    """Compare a fit with the truth.

    Args:
        result: of a fit.
        truth: the true axis.
        radius: the true radius, metres.
    """
    line = result.skeleton
    distance = truth.nearest(line(even_parameters(line, 1000)))[1]
    bend = truth.max_curvature()
    return Accuracy(
        float(distance.mean()),
        float(distance.max()),
        line.length / truth.length - 1.0,
        result.chain.radius / radius - 1.0,
        max_curvature(line)[0] / bend - 1.0 if bend > 1e-6 else float("nan"),
    )


def run(case: Case, seed: int) -> FitData:
    """Fit one cloud of that kind, with nothing set."""
    return fit(_cloud(case, seed)[0])


def _cloud(case: Case, seed: int) -> tuple[np.ndarray, CentreLine]:
    rng = np.random.default_rng(seed)
    line = case.line(rng)
    return sample_tube(line, case.radius, case.count, rng, **case.sampling).points, line


def robustness(seeds: int = 3, first_seed: int = 0) -> Iterator[Figure]:
    """Mean and largest distance and length error of the refined profile on every kind of cloud, medians over seeds.

    Args:
        seeds: clouds of each kind.
        first_seed: the first one's seed.
    """
    for case in CASES:
        found = []
        for seed in range(first_seed, first_seed + seeds):
            points, line = _cloud(case, seed)
            found.append(accuracy(fit(points), line, case.radius))
        mean, largest, length = (
            float(np.median([abs(getattr(item, name)) for item in found])) for name in ("mean", "max", "length")
        )
        yield Figure("robustness", case.name, "mean distance", "mm", 1e3 * mean, high=case.limits[0])
        yield Figure("robustness", case.name, "largest distance", "mm", 1e3 * largest, high=case.limits[1])
        yield Figure("robustness", case.name, "length error", "%", 1e2 * length, high=case.limits[2])
