"""Threads: points along a line that show no width, as wires in a laser scan from the air."""

from __future__ import annotations

import numpy as np
import pytest

import dlogen
from dlogen.errors import FitError
from dlogen.geometry.polyline import distance_to_polyline, segment_lengths
from dlogen.stages.refined.thread import order_any, thread_of
from dlogen.stages.scale import estimate_scale
from dlogen.types import Array


def wire(length: float, spacing: float, noise: float, seed: int, jitter: float = 0.5) -> tuple[Array, Array]:
    """Points of a wire that hangs, in any order, and vertices of its axis, metres."""
    rng = np.random.default_rng(seed)
    count = int(length / spacing)

    def axis(x: Array) -> Array:
        return np.stack([x, 0.1 * np.sin(2.0 * np.pi * x / length), 0.12 * x * (x / length - 1.0)], axis=1)

    x = np.clip((np.arange(count) + rng.uniform(-jitter, jitter, count)) * spacing, 0.0, length)
    return rng.permutation(axis(x) + rng.normal(0.0, noise, (count, 3))), axis(np.linspace(0.0, length, 4000))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("length", "spacing", "noise"),
    [(10.0, 0.035, 0.005), (10.0, 0.06, 0.005), (25.0, 0.06, 0.01), (50.0, 0.02, 0.02), (50.0, 0.06, 0.005)],
)
def test_wires_come_out_whole(length: float, spacing: float, noise: float, seed: int) -> None:
    points, axis = wire(length, spacing, noise, seed)
    result = dlogen.fit(points)
    line = result.skeleton(np.linspace(0.0, 1.0, 500))
    assert np.mean(distance_to_polyline(line, axis)[0]) < max(0.6 * noise, 1.5e-3 * np.sqrt(length))
    assert result.skeleton.length == pytest.approx(segment_lengths(axis).sum(), abs=3.0 * spacing)
    assert "radius-unknown" in {item.code for item in result.quality.findings}
    # So long a wire may be said to be in other units.
    assert {item.code for item in result.quality.findings if item.is_bad} <= {"units"}


def test_a_given_radius_stays() -> None:
    points, axis = wire(25.0, 0.05, 0.005, 3)
    result = dlogen.fit(points, {"r": 0.008})
    assert result.chain.radius == 0.008
    assert result.skeleton.length == pytest.approx(segment_lengths(axis).sum(), abs=0.15)


def test_a_hole_in_a_wire_is_said() -> None:
    points, _ = wire(25.0, 0.05, 0.01, 1)
    result = dlogen.fit(points[(points[:, 0] < 10.0) | (points[:, 0] > 12.0)])
    gaps = [item for item in result.quality.findings if item.code == "gap"]
    assert len(gaps) == 1 and gaps[0].s == pytest.approx(11.0 / 25.0, abs=0.02)


def test_density_and_scatter() -> None:
    points, _ = wire(20.0, 0.04, 0.01, 5)
    thread = thread_of(points)
    assert thread is not None
    assert thread.per_metre == pytest.approx(25.0, rel=0.2)
    assert thread.scatter == pytest.approx(0.01, rel=0.25)


def test_a_plane_is_no_thread() -> None:
    rng = np.random.default_rng(1)
    assert thread_of(np.append(rng.uniform(0.0, 1.0, (500, 2)), np.zeros((500, 1)), axis=1)) is None


def test_tubes_are_ordered_as_before() -> None:
    cloud = dlogen.synth("helical", points=400, seed=2)
    found = order_any(cloud.points, None, estimate_scale(cloud.points), None)
    assert not found.thread


def test_beads_in_noise_do_not_zigzag() -> None:
    points, axis = wire(5.0, 0.05, 0.03, 2)
    found = order_any(points, None, estimate_scale(points), None)
    assert found.thread
    assert segment_lengths(found.backbone).sum() == pytest.approx(segment_lengths(axis).sum(), rel=0.08)


def test_nodes_on_the_axis_are_no_thread() -> None:
    points, _ = wire(15.0, 0.05, 1e-5, 1)
    try:
        found = order_any(points, None, estimate_scale(points), None)
    except FitError:
        return
    assert not found.thread
