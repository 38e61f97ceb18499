"""The table of the skeleton line against the line itself, and chains and deviations on circles and straight lines."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.geometry.vectors import column_dots
from dlogen.stages.chain import deviation
from dlogen.stages.segmentation.curve_table import CurveTable, deviations, trace
from dlogen.stages.segmentation.joints import place_joints


def test_the_table_lays_the_same_joints_as_the_line(fitted) -> None:
    line = fitted(random_centre_line(5))
    table = CurveTable(line)
    chains = trace(table, np.array([0.05, 0.1, 0.3, 3.0]))
    for i, length in enumerate(chains.lengths):
        joints = place_joints(line, float(length))
        n = chains.counts[i]
        assert n == len(joints.s) - 1
        assert table.parameter(chains.u[i, : n + 1]) == pytest.approx(joints.s, abs=1e-8)
        u = chains.u[i, : n + 1]
        assert deviations(table, u, table(u), 48).distance.max() == pytest.approx(deviation(line, joints)[0], rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_table_is_the_line_even_in_arc_length(fitted, seed: int) -> None:
    line = fitted(random_centre_line(seed))
    table = CurveTable(line)
    u = np.linspace(0.0, table.cells, 5000)
    assert np.abs(table(u).T - line(table.parameter(u))).max() < 5e-9 * line.length
    assert table.step * table.cells == pytest.approx(line.length)
    steps = np.linalg.norm(np.diff(line(table.s), axis=0), axis=1)
    assert steps == pytest.approx(np.full(table.cells, table.step), rel=1e-4)


def test_tangents_and_bend_of_a_helix(helix) -> None:
    radius, rise, angle = 0.3, 0.1, 7.0
    table = CurveTable(helix(radius, rise, angle))
    u = np.linspace(0.0, table.cells, 333)
    points, tangents = table.with_tangent(u)
    t, speed = angle * u / table.cells, math.hypot(radius, rise)
    assert np.allclose(points, [radius * np.cos(t), radius * np.sin(t), rise * t], atol=1e-8)
    expected = np.stack([-radius * np.sin(t), radius * np.cos(t), np.full_like(t, rise)]) / speed
    assert np.allclose(tangents, expected, atol=1e-6)
    # With its margin of 1 %.
    assert table.bend == pytest.approx(1.01 * radius / speed**2, rel=1e-4)


def test_a_line_at_uneven_speed(exact_line) -> None:
    truth = centre_line("bent")
    table = CurveTable(exact_line(truth))
    u = np.linspace(0.0, table.cells, 100)
    assert np.abs(table(u).T - truth(u / table.cells)).max() < 1e-7


def test_arrays_of_any_shape(helix) -> None:
    table = CurveTable(helix(0.3, 0.1, 7.0))
    u = np.random.default_rng(0).uniform(0.0, table.cells, (4, 5, 6))
    assert table(u).shape == (3, 4, 5, 6)
    assert np.array_equal(table(u)[:, 1, 2, 3], table(u[1, 2, 3:4])[:, 0])
    assert column_dots(table(u), table(u)) == pytest.approx((table(u) ** 2).sum(axis=0))


def test_joints_on_a_circle_and_on_a_straight_line(circle, straight) -> None:
    radius, angle = 0.5, 4.0
    lengths = np.array([0.05, 0.2, 0.7, 1.2])
    chains = trace(CurveTable(circle(radius, angle)), lengths)
    cells = CurveTable(circle(radius, angle)).cells
    for i, length in enumerate(lengths):
        # No chord is longer than the diameter: then one segment goes to the end.
        step = 2 * math.asin(length / (2 * radius)) if length < 2 * radius else math.inf
        count = math.ceil(angle / step) if math.isfinite(step) else 1
        assert chains.counts[i] == count
        expected = np.append(np.arange(count) * (step if count > 1 else 0.0), angle)
        assert chains.u[i, : count + 1] * angle / cells == pytest.approx(expected, abs=1e-9)
        assert (chains.u[i, count:] == cells).all()
    table = CurveTable(straight([0, 0, 0], [0, 0, 1.0]))
    ended = trace(table, np.array([0.25, 0.3]))
    # A quarter fits four times: no fifth segment of rounding errors.
    assert ended.counts.tolist() == [4, 4]
    assert ended.u[1] / table.cells == pytest.approx([0.0, 0.3, 0.6, 0.9, 1.0])


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 0.999, 0.9999, 1.5])
def test_hairpins_are_left_where_they_first_leave_the_sphere(exact_line, share: float) -> None:
    # A zigzag: from every joint the distance grows, falls, and grows once more; it may leave the sphere for a moment.
    def zigzag(s, derivative):
        phase, scale = 8 * np.pi * s + derivative * np.pi / 2, 0.05 * (8 * np.pi) ** derivative
        y = (0.1 * s, np.full_like(s, 0.1), np.zeros_like(s))[derivative]
        return np.stack([scale * np.sin(phase), y, 0.0 * s], axis=-1)

    table = CurveTable(exact_line(zigzag))
    dense = np.linspace(0.0, table.cells, 100_001)
    points = table(dense)
    highest = np.linalg.norm(points[:, :10_000], axis=0).max()
    chain = trace(table, np.array([share * highest]))
    u = chain.u[0, : chain.counts[0] + 1]
    assert len(u) > 2
    for begin, end in pairwise(u[:-1]):
        away = np.linalg.norm(points - table(np.array([begin])), axis=0)
        first = dense[(dense > begin) & (away >= share * highest)][0]
        assert end == pytest.approx(first, abs=2.0 * table.cells / 100_000)


def test_deviations_on_an_arc(circle) -> None:
    radius, angle = 0.5, 2.0
    table = CurveTable(circle(radius, angle))
    u = np.array([0.0, 0.3, 0.5, 1.0]) * table.cells
    far = deviations(table, u, table(u))
    steps = angle * np.diff(u) / table.cells
    assert far.distance == pytest.approx(radius * (1 - np.cos(steps / 2)), rel=1e-6)
    assert far.height == pytest.approx(far.distance)
    assert far.u == pytest.approx((u[:-1] + u[1:]) / 2, rel=1e-4)
    assert far.along == pytest.approx(np.full(3, 0.5), abs=1e-4)
    # Outwards, away from the centre.
    outward = table(far.u) / radius
    assert np.allclose(far.direction, outward, atol=1e-4)


def test_beyond_the_end_of_a_segment_the_distance_is_to_the_end(straight) -> None:
    # A piece from 0 to 1 m whose segment covers only the part from 0.5 m, 0.1 m beside.
    table = CurveTable(straight([0, 0, 0], [1.0, 0, 0]))
    joints = np.array([[0.5, 1.0], [0.1, 0.1], [0.0, 0.0]])
    far = deviations(table, np.array([0.0, float(table.cells)]), joints, 199)
    assert far.distance[0] == pytest.approx(math.hypot(0.5, 0.1), rel=0.01)
    assert far.height[0] == pytest.approx(0.1)
    assert far.along[0] == pytest.approx(-1.0, abs=0.02)
    assert far.direction[:, 0] == pytest.approx([0.0, -1.0, 0.0])
