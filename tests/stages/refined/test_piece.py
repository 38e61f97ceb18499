"""A stretch of the centre line and its ends, on parabolas and arcs."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.geometry.polyline import arc_lengths
from dlogen.stages.refined.piece import Piece, end_direction, parabola

RADIUS = 0.01


def arc(bend: float, angle: float, step: float = RADIUS) -> np.ndarray:
    """An arc about the origin from (bend, 0, 0), counter-clockwise."""
    phase = np.linspace(0.0, angle, round(bend * angle / step) + 1)
    return np.stack([bend * np.cos(phase), bend * np.sin(phase), 0.0 * phase], axis=1)


def test_length_and_density() -> None:
    piece = Piece(np.array([[0.0, 0, 0], [3.0, 4.0, 0], [3.0, 4.0, 2.0]]), np.array([3.0, 5.0, 6.0]))
    assert piece.length == 7.0
    assert piece.density == 2.0


def test_densities_at_the_ends_are_those_of_six_steps() -> None:
    weight = np.ones(21)
    weight[:7], weight[-7:] = 4.0, 9.0
    piece = Piece(np.arange(21.0)[:, None] * [0.0, 0.5, 0.0], weight)
    # Seven vertices over six steps of half a metre.
    assert piece.end_densities == pytest.approx((28.0 / 3.0, 63.0 / 3.0))
    weight[3] += 12.0
    weight[-5] += 6.0
    assert piece.end_densities == pytest.approx((40.0 / 3.0, 69.0 / 3.0))
    # The next ones are no ends any more.
    weight[7] = weight[-8] = 1e6
    assert piece.end_densities == pytest.approx((40.0 / 3.0, 69.0 / 3.0))


def test_a_short_piece_is_its_own_ends() -> None:
    piece = Piece(np.arange(3.0)[:, None] * [1.0, 0.0, 0.0], np.array([1.0, 2.0, 5.0]))
    assert piece.end_densities == pytest.approx((4.0, 4.0))


@pytest.mark.parametrize("bend", [0.1, 0.5])
def test_the_direction_out_of_an_arc(bend: float) -> None:
    points = arc(bend, 1.5)
    # Backwards along the tangent (0, 1, 0); six radii of arc are not quite a parabola.
    assert np.allclose(end_direction(points, RADIUS), [0.0, -1.0, 0.0], atol=0.3 * (6 * RADIUS / bend) ** 2)
    out = end_direction(points[::-1], RADIUS)
    assert np.allclose(out, [-np.sin(1.5), np.cos(1.5), 0.0], atol=0.3 * (6 * RADIUS / bend) ** 2)
    assert np.linalg.norm(out) == pytest.approx(1.0)


def test_a_parabola_by_arc_length_is_met_exactly() -> None:
    # Even steps: as a function of arc length this is a parabola but for third order.
    points = arc(1.0, 0.2)
    at, outward = parabola(points, 0.03, RADIUS)
    assert np.allclose(at, [np.cos(0.03), np.sin(0.03), 0.0], atol=1e-5)
    assert np.allclose(outward, [np.sin(0.03), -np.cos(0.03), 0.0], atol=1e-3)


def test_only_the_first_six_radii_count() -> None:
    points = arc(0.3, 1.0)
    bent = points.copy()
    bent[8:] += [0.0, 0.0, 0.5]
    for one, other in zip(parabola(points, 0.01, RADIUS), parabola(bent, 0.01, RADIUS), strict=True):
        assert np.allclose(one, other, atol=1e-12)


def test_noise_is_averaged() -> None:
    rng = np.random.default_rng(0)
    points = np.arange(30.0)[:, None] * [RADIUS, 0.0, 0.0] + rng.normal(scale=0.1 * RADIUS, size=(30, 3))
    # The first step alone may point anywhere within a tenth of a radian or two.
    assert end_direction(points, RADIUS) @ [-1.0, 0.0, 0.0] > np.cos(0.2)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_few_points_give_a_straight_end(count: int) -> None:
    points = np.arange(float(count))[:, None] * np.array([0.0, 2.0, 0.0]) + 1.0
    at, outward = parabola(points, 1.0, 10.0)
    assert np.allclose(outward, [0.0, -1.0, 0.0])
    assert np.allclose(at, [1.0, 2.0, 1.0])
    # Never more than half way.
    assert np.allclose(parabola(points, 1e3, 10.0)[0], points.mean(axis=0))
    assert arc_lengths(points)[-1] == 2.0 * (count - 1)
