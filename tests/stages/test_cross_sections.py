"""Circles through cross-sections, against exact tubes, arcs and discs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import SyntheticCloud, sample_tube
from dlogen.stages.cross_sections import Stretches, _circle, _grow, across, cross_sections, stretches

Array = np.ndarray


def sections(cloud: SyntheticCloud, count: int = 40) -> Stretches:
    """What `stretches` would find, exactly."""
    s = np.linspace(0.05, 0.95, count)
    none = np.zeros(count)
    return Stretches(cloud.truth(s), cloud.truth.tangents(s), none, none, none > 0)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    radius=st.floats(1e-3, 1e3),
    extent=st.floats(0.8, 2.0 * np.pi),
    far=st.floats(0.0, 20.0),
)
def test_exact_circles_and_arcs(seed: int, radius: float, extent: float, far: float) -> None:
    rng = np.random.default_rng(seed)
    centre = far * radius * rng.normal(size=2)
    angle = rng.uniform(0.0, 6.0) + extent * np.append(rng.random(28), [0.0, 1.0])
    u, v = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    # A stray without weight counts for nothing.
    u, v, weight = np.append(u, 1e3 * radius), np.append(v, 0.0), np.append(rng.uniform(0.5, 2.0, 30), 0.0)
    x, y, found = _circle(u[None], v[None], weight[None])
    assert found[0] == pytest.approx(radius, rel=1e-5)
    assert np.array([x[0], y[0]]) == pytest.approx(centre, abs=1e-5 * radius * max(1.0, far))


def test_short_noisy_arcs_are_hardly_too_small() -> None:
    rng = np.random.default_rng(0)
    angle = rng.uniform(-0.8, 0.8, (400, 60))
    away = 1.0 + 0.05 * rng.normal(size=angle.shape)
    radius = _circle(away * np.cos(angle), away * np.sin(angle), np.ones_like(angle))[2]
    # The plain algebraic fit (Kasa) makes them 4 % smaller.
    assert np.median(radius) == pytest.approx(1.0, abs=0.02)


@pytest.fixture(scope="module")
def noisy() -> tuple[Array, Array]:
    """What `_circle` makes of 20 noisy arcs, and Taubin's fit by a singular value decomposition (Chernov 2010)."""
    rng = np.random.default_rng(1)
    angle = rng.uniform(-0.3, 2.0, (20, 40))
    away = 1.0 + 0.1 * rng.normal(size=angle.shape)
    u, v = 3.0 + away * np.cos(angle), away * np.sin(angle) - 2.0
    expected = []
    for row in range(20):
        middle = np.array([u[row].mean(), v[row].mean()])
        x, y = u[row] - middle[0], v[row] - middle[1]
        z = x * x + y * y
        root = 2.0 * np.sqrt(z.mean())
        a = np.linalg.svd(np.stack([(z - z.mean()) / root, x, y], axis=1), full_matrices=False)[2][2]
        a = np.array([a[0] / root, a[1], a[2], -z.mean() * a[0] / root])
        radius = np.sqrt(a[1] ** 2 + a[2] ** 2 - 4.0 * a[0] * a[3]) / abs(2.0 * a[0])
        expected.append(np.append(middle - a[1:3] / (2.0 * a[0]), radius))
    return np.stack(_circle(u, v, np.ones_like(u)), axis=1), np.array(expected)


def test_noisy_circles_are_taubins(noisy: tuple[Array, Array]) -> None:
    assert noisy[0] == pytest.approx(noisy[1], rel=1e-7)


@given(st.integers(0, 2**32 - 1))
def test_across_is_a_right_handed_frame(seed: int) -> None:
    direction = np.random.default_rng(seed).normal(size=(20, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    frames = np.stack([direction, *across(direction)], axis=1)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3), atol=1e-12)
    assert np.linalg.det(frames) == pytest.approx(1.0)
    assert np.linalg.det(np.stack([np.eye(3), *across(np.eye(3))], axis=1)) == pytest.approx(1.0)


class TestCircles:
    @pytest.mark.parametrize("guess", [0.7, 1.0, 1.5])
    def test_radius_and_side_of_a_whole_and_a_half_tube(self, tube, half_tube, guess: float) -> None:
        for cloud, lopsided in ((tube, 0.0), (half_tube, 2.0 / np.pi)):
            found = cross_sections(cKDTree(cloud.points), cloud.points, sections(cloud), guess * cloud.radius)
            assert found.good.all()
            assert np.median(found.radius) == pytest.approx(cloud.radius, rel=0.02)
            # The centroid of a half circle is 2 / pi radii off its centre.
            assert np.median(found.lopsided) == pytest.approx(lopsided, abs=0.12)
            assert np.median(found.noise) < 0.05 * cloud.radius
            # 5,000 points on 1.4 m.
            assert np.median(found.per_length) == pytest.approx(5000 / 1.4, rel=0.15)

    def test_noise_is_measured(self) -> None:
        cloud = sample_tube(random_centre_line(3, min_bend_radius=0.3), 0.02, 5000, 1, noise=0.001)
        found = cross_sections(cKDTree(cloud.points), cloud.points, sections(cloud), 0.02)
        assert np.median(found.noise) == pytest.approx(0.001, rel=0.3)

    def test_strays_are_left_out(self, tube) -> None:
        rng = np.random.default_rng(0)
        strays = tube.truth(rng.random(500)) + rng.uniform(-1, 1, (500, 3)) * 3 * tube.radius
        points = np.concatenate([tube.points, strays])
        found = cross_sections(cKDTree(points), points, sections(tube), tube.radius)
        assert np.median(found.radius) == pytest.approx(tube.radius, rel=0.02)

    def test_too_few_points_are_no_circle(self, tube) -> None:
        few = tube.points[::500]
        assert not cross_sections(cKDTree(few), few, sections(tube), tube.radius).good.any()

    def test_a_disc_is_no_circle(self) -> None:
        rng = np.random.default_rng(1)
        rho, angle = 0.02 * np.sqrt(rng.random(4000)), rng.uniform(0, 2 * np.pi, 4000)
        solid = np.stack([rng.random(4000), rho * np.cos(angle), rho * np.sin(angle)], axis=1)
        places = np.linspace(0.1, 0.9, 20)[:, None] * [1.0, 0.0, 0.0]
        none = np.zeros(20)
        found = cross_sections(
            cKDTree(solid), solid, Stretches(places, np.tile([1.0, 0, 0], (20, 1)), none, none, none > 0), 0.02
        )
        assert (found.noise > 0.2 * found.radius).all()


class TestStretches:
    def test_of_a_tube_they_lie_along_it(self, tube) -> None:
        tree, places = cKDTree(tube.points), np.arange(0, 5000, 100)
        found = stretches(tube.points, tree, places)
        assert len(found.centre) > 40
        s, off = tube.truth.nearest(found.centre)
        inner = (s > 0.1) & (s < 0.9)
        assert np.median(off[inner]) < 0.5 * tube.radius
        along = np.abs(np.einsum("pi,pi->p", found.direction, tube.truth.tangents(s)))
        assert np.linalg.norm(found.direction, axis=1) == pytest.approx(1.0)
        assert np.median(along[inner]) > 0.95
        # r^2 / 2 is the variance across a whole tube.
        assert np.median(found.width[inner]) == pytest.approx(tube.radius, rel=0.25)
        assert np.median(found.per_length[inner]) == pytest.approx(5000 / 1.4, rel=0.35)
        assert found.resolved.mean() > 0.9

    def test_units_and_order_do_not_matter(self, tube) -> None:
        few = tube.points[:400]
        order = np.random.default_rng(0).permutation(400)
        places = np.arange(0, 400, 10)
        one = stretches(few, cKDTree(few), places)
        moved = 1e3 * few[order]
        other = stretches(moved, cKDTree(moved), np.argsort(order)[places])
        assert other.width == pytest.approx(1e3 * one.width)
        assert other.per_length == pytest.approx(one.per_length / 1e3)
        assert other.centre == pytest.approx(1e3 * one.centre)

    def test_a_ball_and_a_plane_have_few(self) -> None:
        rng = np.random.default_rng(2)
        ball = rng.normal(size=(3000, 3))
        plane = rng.random((3000, 3)) * [1.0, 1.0, 1e-3]
        for points in (ball / np.linalg.norm(ball, axis=1, keepdims=True), plane):
            found = stretches(points, cKDTree(points), np.arange(0, 3000, 60))
            # A few neighbourhoods are elongated by chance; of a tube's, nearly all are.
            assert len(found.centre) < 0.4 * 50

    def test_a_string_of_beads_is_not_resolved(self) -> None:
        beads = np.arange(100.0)[:, None] * [0.01, 0.0, 0.0]
        beads = beads + 1e-4 * np.random.default_rng(3).normal(size=(100, 3))
        found = stretches(beads, cKDTree(beads), np.arange(10, 90, 5))
        assert len(found.centre) == 16
        assert not found.resolved.any()
        assert np.abs(found.direction[:, 0]) == pytest.approx(1.0, abs=1e-3)
        assert np.median(found.per_length) == pytest.approx(100.0, rel=0.2)

    def test_only_every_so_many_points_were_looked_at(self) -> None:
        line = np.arange(144.0)[None, :, None] * [0.01, 0.0, 0.0]
        rows = [_grow(line, step, False)[0] for step in (1, 4)]
        # The same neighbourhood stands for four times as many points.
        assert rows[1][7] == pytest.approx(4 * rows[0][7])
        assert np.delete(rows[1], 7) == pytest.approx(np.delete(rows[0], 7))
