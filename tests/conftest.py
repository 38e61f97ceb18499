"""Shared geometry with a known truth: exact skeleton lines, clouds of synthetic tubes, results made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.geometry.arc_length import arc_length, even_parameters
from dlogen.geometry.basis import CubicBSpline
from dlogen.geometry.curvature import max_curvature
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import resample
from dlogen.stages.chain import build_chain, deviation
from dlogen.stages.paper.projection import project
from dlogen.stages.paper.skeleton import fit_skeleton
from dlogen.stages.paper.sorting import sort_points
from dlogen.stages.quality.residual import foot_points, tube_residual
from dlogen.stages.segmentation.joints import place_joints
from dlogen.stages.segmentation.segment_length import max_segment_length
from dlogen.types import Basis, FitData, Intermediate, Quality, Segmentation, Skeleton

Array = np.ndarray
Curve = Callable[[Array, int], Array]


@dataclass(frozen=True)
class CurveBasis:
    """The coordinates of a curve as three basis functions: with the weights I, f(s) is the curve itself."""

    curve: Curve
    size: int = 3
    margin: float = 0.0

    def __call__(self, s: Array, derivative: int = 0) -> Array:
        return self.curve(np.asarray(s, dtype=float), derivative)

    def combine(self, s: Array, weights: Array, derivative: int = 0) -> Array:
        return self(s, derivative) @ weights

    def to_dict(self) -> dict[str, Any]:
        return {"kind": "curve"}


def _exact_line(curve: Curve | CentreLine) -> Skeleton:
    """A skeleton line that is exactly this curve, (s (K,), derivative) -> (K, 3)."""
    function = curve.curve if isinstance(curve, CentreLine) else curve
    line = Skeleton(CurveBasis(function), np.eye(3), np.zeros(3), 0.0)
    return Skeleton(line.basis, line.weights, line.offset, arc_length(line))


def _circle(radius: float, angle: float) -> Skeleton:
    """An arc in the plane z = 0 that starts at (radius, 0, 0) and turns left."""

    def curve(s: Array, derivative: int) -> Array:
        phase, scale = angle * s + derivative * np.pi / 2, radius * angle**derivative
        return np.stack([scale * np.cos(phase), scale * np.sin(phase), np.zeros_like(s)], axis=-1)

    return _exact_line(curve)


def _helix(radius: float, rise: float, angle: float) -> Skeleton:
    """(a cos t, a sin t, b t) with a = radius, b = rise a radian, t from 0 to angle; curvature a / (a^2 + b^2)."""

    def curve(s: Array, derivative: int) -> Array:
        phase, scale = angle * s + derivative * np.pi / 2, radius * angle**derivative
        z = (rise * angle * s, np.full_like(s, rise * angle), *2 * (np.zeros_like(s),))[derivative]
        return np.stack([scale * np.cos(phase), scale * np.sin(phase), z], axis=-1)

    return _exact_line(curve)


def _straight(start: Array, end: Array) -> Skeleton:
    """From start to end at even speed."""
    start, along = np.asarray(start, dtype=float), np.subtract(end, start)

    def curve(s: Array, derivative: int) -> Array:
        return start + s[:, None] * along if derivative == 0 else np.outer(np.full(len(s), derivative == 1), along)

    return _exact_line(curve)


def _fitted(line: CentreLine | Skeleton, basis: Basis | None = None) -> Skeleton:
    """Basis functions fitted closely to a line; unlike an exact line it can be written and read again."""
    s = np.linspace(0.0, 1.0, 2000)
    return fit_skeleton(line(s), s, basis or CubicBSpline(40), 1e-9)


def _make_result(
    line: Skeleton, radius: float = 0.01, e_max: float | None = None, *, name: str = "cable", **changes: Any
) -> FitData:
    """What a fit to a tube around the line would return, without a fit: the stages behind the skeleton line."""
    e_max = radius / 2 if e_max is None else e_max
    s = np.linspace(0.0, 1.0, 400)
    tangents = line(s, 1) / np.linalg.norm(line(s, 1), axis=1, keepdims=True)
    # Around the tube by the golden angle: no two neighbours on the same side.
    turns = 2.4 * np.arange(len(s))
    normals = np.cross(tangents, np.stack([np.cos(turns), np.sin(turns), np.cos(1.7 * turns)], axis=1))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = line(s) + radius * normals
    projected = project(points, normals, radius)
    walk = sort_points(projected, normals, 8 * radius)
    kappa = max_curvature(line)[0]
    joints = place_joints(line, max_segment_length(e_max, 1 / kappa if kappa > 0 else np.inf))
    chain = build_chain(joints, radius)
    even = line(even_parameters(line, 1000))
    values = {
        "name": name,
        "profile": "paper",
        "skeleton": line,
        "skeleton_points": even,
        "segmentation": Segmentation("paper", "on-curve", joints, *deviation(line, joints)),
        "joints": joints,
        "chain": chain,
        "e_max": e_max,
        "max_deviation": deviation(line, joints)[0],
        "mdtw": mdtw(even, resample(chain.joints, 1000)),
        "residual": tube_residual(foot_points(points, line)[1], radius),
        "quality": Quality(),
        "config": Config().resolved({"r": radius, "e_max": e_max}),
        "provenance": {
            "dlogen": "0",
            "input": "x.ply",
            "sha256": "0",
            "points": 400,
            "points_used": 400,
            "config": {},
            "seed": 0,
        },
        "timings": {"input": 0.001},
        "intermediates": (
            Intermediate("normals", points, {f"n{axis}": normals[:, i] for i, axis in enumerate("xyz")}),
            Intermediate("projected", projected),
            Intermediate("sorted", projected[walk.index], {"s": walk.s}, colour="s"),
            Intermediate("unreached", projected[walk.unreached]),
        ),
    }
    return FitData(**(values | changes))


@pytest.fixture(scope="session")
def exact_line() -> Callable[[Curve | CentreLine], Skeleton]:
    return _exact_line


@pytest.fixture(scope="session")
def circle() -> Callable[[float, float], Skeleton]:
    return _circle


@pytest.fixture(scope="session")
def helix() -> Callable[[float, float, float], Skeleton]:
    return _helix


@pytest.fixture(scope="session")
def straight() -> Callable[[Array, Array], Skeleton]:
    return _straight


@pytest.fixture(scope="session")
def fitted() -> Callable[..., Skeleton]:
    return _fitted


@pytest.fixture(scope="session")
def make_result() -> Callable[..., FitData]:
    return _make_result


@pytest.fixture(scope="session")
def tube() -> SyntheticCloud:
    """A whole tube around a random line: 1.4 m, radius 15 mm, 5,000 points without noise."""
    return sample_tube(random_centre_line(3, clearance=0.08), 0.015, 5000, 3)


@pytest.fixture(scope="session")
def half_tube() -> SyntheticCloud:
    """The same in a plane, seen from far above."""
    return sample_tube(random_centre_line(3, dimensions=2, clearance=0.08), 0.015, 5000, 3, side=(0.0, 0.0, -1.0))


@pytest.fixture(scope="session")
def bent() -> SyntheticCloud:
    """The paper's `bent` curve: d = 40 mm, M = 5000."""
    return sample_tube(centre_line("bent"), 0.02, 5000, 1)
