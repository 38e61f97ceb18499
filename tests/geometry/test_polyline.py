from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dlogen.geometry import polyline as module
from dlogen.geometry.polyline import (
    arc_lengths,
    at_arc_lengths,
    distance_to_polyline,
    hausdorff,
    piecewise_linear,
    resample,
    segment_lengths,
)

CORNER = np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0]])
coordinates = st.floats(-10, 10, allow_nan=False, width=32)
polylines = st.integers(2, 12).flatmap(lambda k: hnp.arrays(float, (k, 3), elements=coordinates))


def helix(count: int) -> np.ndarray:
    t = np.linspace(0, 4 * np.pi, count)
    return np.c_[0.2 * np.cos(t), 0.2 * np.sin(t), 0.05 * t]


def test_arc_lengths() -> None:
    assert arc_lengths(CORNER) == pytest.approx([0, 3, 4])
    assert arc_lengths(CORNER[:1]) == pytest.approx([0])


@given(polylines)
def test_arc_lengths_are_sums_of_segment_lengths(points: np.ndarray) -> None:
    lengths = segment_lengths(points)
    expected = [float(np.sqrt(((b - a) ** 2).sum())) for a, b in pairwise(points)]
    assert lengths == pytest.approx(expected, rel=1e-14)
    assert np.diff(arc_lengths(points)) == pytest.approx(lengths, abs=1e-12)
    # Of many polylines, each one's.
    assert segment_lengths(np.stack([points, 2.0 * points])) == pytest.approx(np.stack([lengths, 2.0 * lengths]))


def test_places_at_arc_lengths_by_hand() -> None:
    found = at_arc_lengths(CORNER, arc_lengths(CORNER), np.array([-1.0, 0.0, 1.5, 3.0, 3.25, 4.0, 9.0]))
    assert found.tolist() == [[0, 0, 0], [0, 0, 0], [1.5, 0, 0], [3, 0, 0], [3, 0.25, 0], [3, 1, 0], [3, 1, 0]]


def test_piecewise_linear_follows_equations_12_to_14() -> None:
    # By hand: L_sum = 4, u = (0, 3/4, 1); g_1 has the slope L_sum (1, 0, 0), g_2 L_sum (0, 1, 0).
    u = np.array([0.0, 0.25, 0.75, 0.875, 1.0])
    assert piecewise_linear(CORNER, u) == pytest.approx(
        np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0], [3, 0.5, 0], [3, 1, 0]])
    )


def test_piecewise_linear_clamps_and_passes_over_joints_that_coincide() -> None:
    doubled = CORNER[[0, 0, 1, 1, 2, 2]]
    u = np.linspace(0, 1, 101)
    assert piecewise_linear(doubled, u) == pytest.approx(piecewise_linear(CORNER, u))
    assert piecewise_linear(CORNER, [-0.5, 1.5]) == pytest.approx(CORNER[[0, 2]])
    assert piecewise_linear(CORNER[:1], [0.0, 0.5]) == pytest.approx(CORNER[[0, 0]])


@given(polylines, st.integers(2, 50))
def test_resampling_is_even_keeps_the_ends_and_lies_on_the_polyline(points: np.ndarray, count: int) -> None:
    samples = resample(points, count)
    assert samples.shape == (count, 3)
    assert np.array_equal(samples[[0, -1]], points[[0, -1]])
    length = arc_lengths(points)[-1]
    # No chord is longer than its share of the arc, and all shares are the same.
    assert np.linalg.norm(np.diff(samples, axis=0), axis=1).max() <= length / (count - 1) * (1 + 1e-9) + 1e-12
    assert distance_to_polyline(samples, points)[0].max() <= 1e-9


def test_resampling_takes_uneven_vertices_out() -> None:
    t = np.sort(np.random.default_rng(1).random(4000) ** 3)
    t[0], t[-1] = 0.0, 1.0
    spacing = np.linalg.norm(np.diff(resample(np.c_[t, 2 * t, -t], 1000), axis=0), axis=1)
    assert spacing == pytest.approx(np.sqrt(6) / 999)


def test_resampling_a_point() -> None:
    assert np.array_equal(resample(np.ones((3, 3)), 5), np.ones((5, 3)))


def test_resampling_far_from_the_origin() -> None:
    offset = np.array([5e6, -5e6, 1e3])
    assert resample(helix(500) + offset, 300) - offset == pytest.approx(resample(helix(500), 300), abs=1e-8)


def test_distance_by_hand() -> None:
    points = np.array([[1.0, 2, 0], [-3, 4, 0], [4, 2, 0], [3.5, 0.25, 0], [3, 0, 2]])
    distance, segment, parameter = distance_to_polyline(points, CORNER)
    assert distance == pytest.approx([2, 5, np.sqrt(2), 0.5, 2])
    assert list(segment) == [0, 0, 1, 1, 0]
    assert parameter == pytest.approx([1 / 3, 0, 1, 0.25, 1])


@settings(deadline=None)
@given(polylines, hnp.arrays(float, (7, 3), elements=coordinates))
def test_distance_is_that_to_the_foot_point_and_the_least(points: np.ndarray, queries: np.ndarray) -> None:
    distance, segment, t = distance_to_polyline(queries, points)
    foot = points[segment] + t[:, None] * (points[segment + 1] - points[segment])
    assert np.linalg.norm(queries - foot, axis=1) == pytest.approx(distance, abs=1e-9)
    dense = np.concatenate([points, *(piecewise_linear(points[i : i + 2], np.linspace(0, 1, 200)) for i in segment)])
    sampled = np.linalg.norm(queries[:, None] - dense, axis=2).min(axis=1)
    assert (distance <= sampled + 1e-9).all()


@pytest.mark.parametrize("pairs", [2000, 1 << 17])
@pytest.mark.parametrize("together", [1, 7, 64, 10_000])
@pytest.mark.parametrize("order", ["along", "random"])
def test_leaving_out_far_segments_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, pairs: int, together: int, order: str
) -> None:
    rng = np.random.default_rng(0)
    queries = helix(300) + rng.normal(0, 0.05, (300, 3)) if order == "along" else rng.normal(size=(50, 3))
    curve = helix(1000)
    along = np.diff(curve, axis=0)
    t = np.clip(np.einsum("mkc,kc->mk", queries[:, None] - curve[:-1], along) / (along**2).sum(axis=1), 0, 1)
    every = np.linalg.norm(queries[:, None] - curve[:-1] - t[:, :, None] * along, axis=2)
    monkeypatch.setattr(module, "_PAIRS", pairs)
    monkeypatch.setattr(module, "_TOGETHER", together)
    distance, segment, parameter = distance_to_polyline(queries, curve)
    assert distance == pytest.approx(every.min(axis=1), abs=1e-12)
    foot = curve[segment] + parameter[:, None] * along[segment]
    assert np.linalg.norm(queries - foot, axis=1) == pytest.approx(distance, abs=1e-12)


def test_long_polylines_are_not_tried_pair_by_pair() -> None:
    # 50,000 by 50,000 pairs, twice, would take a minute.
    assert hausdorff(helix(50_000), helix(50_000) + np.array([0, 0, 0.001])) == pytest.approx(0.001, rel=0.05)


def test_distance_keeps_its_precision_far_from_the_origin() -> None:
    offset = np.array([5e6, 5e6, 0])
    queries = helix(100) + np.array([0.001, 0, 0])
    near = distance_to_polyline(queries, helix(300))[0]
    assert distance_to_polyline(queries + offset, helix(300) + offset)[0] == pytest.approx(near, abs=1e-8)


def test_distance_to_a_single_vertex_and_a_segment_without_length() -> None:
    for target in (np.zeros((1, 3)), np.zeros((3, 3))):
        distance, segment, parameter = distance_to_polyline([[3.0, 4, 0]], target)
        assert (distance[0], segment[0], parameter[0]) == (5.0, 0, 0.0)
    assert len(distance_to_polyline(np.empty((0, 3)), CORNER)[0]) == 0


def test_hausdorff_by_hand() -> None:
    a = np.array([[0.0, 0, 0], [10, 0, 0]])
    assert hausdorff(a, a) == pytest.approx(0, abs=1e-12)
    assert hausdorff(a, a[::-1] + np.array([0, 0, 2])) == pytest.approx(2)
    # One-sided distances differ: every point of the short one is on the long one.
    assert hausdorff(a, a * [0.5, 1, 1]) == pytest.approx(5)
    # The farthest point is inside a segment: the middle of the base lies 3 away from both legs.
    legs = np.array([[0.0, 0, 0], [0, 6, 0], [6, 6, 0], [6, 0, 0]])
    base = np.array([[0.0, 0, 0], [6, 0, 0]])
    assert hausdorff(base, legs) == pytest.approx(6)
    assert distance_to_polyline(resample(base, 1001), legs)[0].max() == pytest.approx(3)


@settings(deadline=None, max_examples=30)
@given(polylines, polylines)
def test_hausdorff_is_symmetric_and_knows_no_direction(a: np.ndarray, b: np.ndarray) -> None:
    expected = hausdorff(a, b)
    assert hausdorff(b, a) == expected
    assert hausdorff(a, b[::-1]) == pytest.approx(expected, abs=1e-2 * expected + 1e-9)
    # No better than the vertices allow, no worse than the whole of both.
    assert expected >= max(distance_to_polyline(a, b)[0].max(), distance_to_polyline(b, a)[0].max()) - 1e-12


def test_hausdorff_between_arc_and_chord_is_the_sagitta() -> None:
    half = np.radians(20)
    angle = np.linspace(-half, half, 2001)
    arc = np.c_[0.5 * np.cos(angle), 0.5 * np.sin(angle), 0 * angle]
    assert hausdorff(arc, arc[[0, -1]]) == pytest.approx(0.5 * (1 - np.cos(half)), rel=1e-9)


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.zeros(3), np.zeros((4, 2))])
def test_other_shapes_are_refused(points: np.ndarray) -> None:
    for call in (arc_lengths, lambda p: resample(p, 5), lambda p: distance_to_polyline(CORNER, p)):
        with pytest.raises(ValueError, match=r"shape \(K, 3\)"):
            call(points)


def test_fewer_than_two_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        resample(CORNER, 1)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coordinates_that_are_not_finite_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        hausdorff(CORNER, np.full((2, 3), value))
