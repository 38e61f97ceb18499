"""Rigid links on curves: lengths are exact, the fit is the nearest one, and no link more than needed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import random_centre_line
from dlogen.geometry.polyline import hausdorff, resample
from dlogen.sequence.rigid_links import (
    Shape,
    centre,
    deviations,
    equal_links,
    fewest_links,
    fit_links,
    from_directions,
    links_of_length,
)

Array = np.ndarray


def shape_of(curves: list[Array], length: float) -> Shape:
    """Curves that show all of the object."""
    return Shape(np.array(curves), np.full(len(curves), length), length, np.zeros(len(curves)))


def lines(count: int, length: float = 1.4, radius: float = 0.1) -> Shape:
    return shape_of([random_centre_line(seed, length, radius).points(1000) for seed in range(count)], length)


def arc(radius: float, angle: float) -> Array:
    phase = np.linspace(0.0, angle, 1000)
    return radius * np.stack([np.cos(phase), np.sin(phase), 0.2 + 0 * phase], axis=1)


def cost(shape: Shape, joints: Array, links: Array) -> Array:
    """Mean square distance of material points, by plain sampling."""
    t = (np.arange(64) + 0.5) / 64
    ends = np.concatenate([[0.0], np.cumsum(links)])
    total = 0.0
    for i, link in enumerate(links):
        chain = joints[:, i, None] + t[:, None] * (joints[:, i + 1, None] - joints[:, i, None])
        total = total + link * ((chain - shape.points(ends[i] + link * t)) ** 2).sum(axis=2).mean(axis=1)
    return total / links.sum()


class TestLengths:
    def test_equal(self) -> None:
        assert equal_links(1.2, 5) == pytest.approx([0.24] * 5)

    @given(st.floats(0.1, 10), st.floats(0.01, 20))
    def test_all_but_the_last(self, length: float, link: float) -> None:
        links = links_of_length(length, link)
        assert links.sum() == pytest.approx(length)
        assert np.all(links[:-1] == link) and 0 < links[-1] <= link * (1 + 1e-6)

    def test_no_crumb_is_left(self) -> None:
        assert len(links_of_length(1.2, 0.3)) == 4
        assert len(links_of_length(0.3 * 3 + 1e-13, 0.3)) == 3


class TestMaterialPoints:
    def test_by_distance_along_the_object(self) -> None:
        line = random_centre_line(1, 1.4)
        points = shape_of([line.points(1000)], 1.4).points(np.array([0.0, 0.35, 1.4]))
        assert points[0] == pytest.approx(line(np.array([0.0, 0.25, 1.0])), abs=1e-5)

    def test_what_a_curve_does_not_show_goes_on_straight(self) -> None:
        curve = np.stack([np.linspace(0.0, 1.0, 50), np.zeros(50), np.zeros(50)], axis=1)
        points = Shape(curve[None], np.array([1.0]), 1.1, np.array([0.02])).points(np.array([0.0, 0.02, 1.02, 1.1]))
        assert points[0, :, 0] == pytest.approx([-0.02, 0.0, 1.0, 1.08])


class TestFit:
    @pytest.mark.parametrize("links", [equal_links(1.4, 1), equal_links(1.4, 14), links_of_length(1.4, 0.13)])
    def test_lengths_are_exact(self, links: Array) -> None:
        joints = fit_links(lines(5), links)
        assert np.linalg.norm(np.diff(joints, axis=1), axis=2) == pytest.approx(np.tile(links, (5, 1)), abs=1e-14)

    def test_a_straight_line_is_hit(self) -> None:
        curve = np.linspace([0.1, 0.2, 0.3], [0.1, 0.2, 1.5], 1000)
        joints = fit_links(shape_of([curve], 1.2), equal_links(1.2, 6))[0]
        assert joints == pytest.approx(np.linspace([0.1, 0.2, 0.3], [0.1, 0.2, 1.5], 7), abs=1e-12)

    def test_a_circle_runs_on_both_sides_of_its_polygon(self) -> None:
        links = equal_links(0.3 * np.pi, 12)
        joints = fit_links(shape_of([arc(0.3, np.pi)], 0.3 * np.pi), links)[0]
        corners = np.linalg.norm(joints[2:-2, :2], axis=1)
        middles = np.linalg.norm(0.5 * (joints[2:-3, :2] + joints[3:-2, :2]), axis=1)
        # The polygon with the circumference of the circle has this circumradius; free ends open it a little more.
        assert corners == pytest.approx(links[0] / 2 / np.sin(links[0] / 0.6), rel=2e-3)
        assert np.all(corners > 0.3) and np.all(middles < 0.3)

    @settings(max_examples=20, deadline=None)
    @given(st.integers(0, 10_000), st.integers(2, 20))
    def test_no_other_chain_of_these_links_is_nearer(self, seed: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        shape, links = shape_of([random_centre_line(rng, 1.4, 0.2).points(1000)], 1.4), equal_links(1.4, count)
        joints = fit_links(shape, links)
        directions = np.diff(joints, axis=1) / links[:, None]
        for size in (1e-1, 1e-2, 1e-3):
            other = directions + size * rng.normal(size=directions.shape)
            other /= np.linalg.norm(other, axis=2, keepdims=True)
            moved = from_directions(centre(joints, links) + 0.1 * size * rng.normal(size=3), other, links)
            assert cost(shape, moved, links) > cost(shape, joints, links) - 1e-9

    def test_joints_are_material_points(self) -> None:
        shape, links = lines(20), equal_links(1.4, 20)
        joints = fit_links(shape, links)
        apart = np.linalg.norm(joints - shape.points(np.linspace(0.0, 1.4, 21)), axis=2)
        assert apart.max() < 0.006 and apart.mean() < 0.002

    def test_captures_do_not_touch_one_another(self) -> None:
        shape, links = lines(6), links_of_length(1.4, 0.11)
        alone = [fit_links(shape.of([k]), links)[0] for k in range(6)]
        assert fit_links(shape, links) == pytest.approx(np.array(alone), abs=1e-9)

    def test_a_motion_of_the_curve_moves_the_chain(self) -> None:
        shape, links = lines(1), equal_links(1.4, 12)
        turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
        moved = shape_of([shape.curves[0] @ turn.T + [5.0, -3.0, 100.0]], 1.4)
        expected = fit_links(shape, links)[0] @ turn.T + [5.0, -3.0, 100.0]
        assert fit_links(moved, links)[0] == pytest.approx(expected, abs=1e-9)


class TestDeviation:
    def test_at_least_the_hausdorff_distance_and_not_much_more(self) -> None:
        shape, links = lines(8, radius=0.2), equal_links(1.4, 12)
        joints = fit_links(shape, links)
        for found, curve, chain in zip(deviations(shape, joints, links), shape.curves, joints, strict=True):
            true = hausdorff(curve, resample(chain, 2000))
            assert true * 0.99 <= found <= 1.25 * true + 2e-4

    def test_of_a_shifted_chain(self) -> None:
        curve = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1000)
        shape, links = shape_of([curve], 1.0), equal_links(1.0, 4)
        joints = np.linspace([0.0, 0.003, 0.004], [1.0, 0.003, 0.004], 5)[None]
        assert deviations(shape, joints, links) == pytest.approx([0.005])

    @pytest.mark.parametrize("joint", range(5))
    def test_of_one_joint_off_the_curve(self, joint: int) -> None:
        """Before and behind it the chain comes back to the curve: nothing but that joint is so far away."""
        curve = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1000)
        joints = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 5)
        joints[joint] += [0.0, 0.03, -0.04]
        links = np.linalg.norm(np.diff(joints, axis=0), axis=1)
        shape = Shape(curve[None], np.array([1.0]), float(links.sum()), np.array([0.5 * (links.sum() - 1.0)]))
        found = deviations(shape, joints[None], links)[0]
        assert 0.05 <= found < 0.051
        assert found >= hausdorff(curve, joints)

    def test_of_ends_that_go_past_those_of_the_curve(self) -> None:
        # The curve is all of the object, but the chain stands out at one end: there no place of the curve is so far.
        curve = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1000)
        for shift in (0.01, -0.01):
            joints = np.linspace([shift, 0.0, 0.0], [1.0 + shift, 0.0, 0.0], 5)[None]
            assert deviations(shape_of([curve], 1.0), joints, equal_links(1.0, 4)) == pytest.approx([0.01])


class TestFewest:
    def test_one_less_is_too_few(self) -> None:
        shape = lines(10)
        count = fewest_links(shape, 0.006, 100)
        assert count is not None
        for number, fits in ((count, True), (count - 1, False)):
            links = equal_links(1.4, number)
            assert bool(deviations(shape, fit_links(shape, links), links).max() <= 0.006) is fits

    def test_a_straight_one_is_one_link(self) -> None:
        assert fewest_links(shape_of([np.linspace([0, 0, 0], [1.0, 0, 0], 1000)], 1.0), 1e-4, 10) == 1

    def test_too_many(self) -> None:
        assert fewest_links(lines(1), 1e-6, 20) is None
