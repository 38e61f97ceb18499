from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from dlogen.errors import FitError
from dlogen.evaluation.shapes import centre_line, hose_centre_line
from dlogen.geometry.arc_length import arc_length
from dlogen.geometry.basis import CubicBSpline, InverseQuadratic
from dlogen.stages.segmentation.joints import place_joints
from dlogen.types import Joints, Skeleton


def random_line(seed: int, size: int, kind: str) -> Skeleton:
    """A curve that wanders about and comes back to where it was many times."""
    rng = np.random.default_rng(seed)
    basis = CubicBSpline(size + 3) if kind == "splines" else InverseQuadratic(size, size / rng.uniform(1, 6))
    weights = rng.normal(size=(basis.size, 3)) * [1, 1, rng.choice([0, 0.1, 1])]
    line = Skeleton(basis, weights, np.zeros(3), 0.0)
    return Skeleton(basis, weights, np.zeros(3), arc_length(line))


def by_brute_force(line: Skeleton, length: float, samples: int = 20_001) -> np.ndarray:
    """s of the joints: the first of many samples outside the sphere, then bisection."""
    s = np.linspace(0.0, 1.0, samples)
    points = line(s)
    found, first = [0.0], 1
    while True:
        centre = line(found[-1])
        outside = np.flatnonzero(np.linalg.norm(points[first:] - centre, axis=1) >= length)
        if len(outside) == 0:
            return np.array([*found, 1.0])
        first += int(outside[0])
        low, high = max(s[first - 1], found[-1]), s[first]
        for _ in range(40):
            middle = 0.5 * (low + high)
            if np.linalg.norm(line(middle) - centre) >= length:
                high = middle
            else:
                low = middle
        found.append(high)


def check(line: Skeleton, joints: Joints, length: float) -> None:
    """What Eq. 18-20 ask of joints, apart from being the first."""
    count = len(joints.s)
    assert joints.positions.shape == (count, 3)
    assert count >= 2
    assert joints.s[0] == 0.0
    assert joints.s[-1] == 1.0
    assert (np.diff(joints.s) > 0).all()
    assert joints.positions == pytest.approx(line(joints.s), abs=1e-12)  # Eq. 18
    chords = np.linalg.norm(np.diff(joints.positions, axis=0), axis=1)
    assert np.abs(chords[:-1] - length).max(initial=0.0) < 1e-9  # Eq. 19
    assert joints.last_segment_length == pytest.approx(chords[-1], abs=1e-12)
    assert chords[-1] <= length + 1e-9
    if count > 2:
        assert joints.segment_length == length


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 100_000),
    st.integers(4, 16),
    st.sampled_from(["splines", "inverse quadratic"]),
    st.floats(-2.0, -0.2),
)
def test_the_first_crossing_on_curves_that_fold_back(seed: int, size: int, kind: str, share: float) -> None:
    line = random_line(seed, size, kind)
    length = line.length * 10**share
    joints = place_joints(line, length)
    check(line, joints, length)
    expected = by_brute_force(line, length)
    # Within the spacing of its samples brute force may pass over an excursion, or a leftover of nothing.
    assume(len(expected) == len(joints.s) or 1 - joints.s[-2] > 1e-6)
    assert joints.s == pytest.approx(expected, abs=1e-6)


def test_figure_5b_several_crossings_of_the_sphere(exact_line) -> None:
    # Out along x, back and out again: f leaves the sphere around f(0) three times and enters it twice.
    folds = [0.0, 3.0, 1.0, 3.0, 1.0, 4.0]

    def curve(s, derivative):
        x = Polynomial.fit(np.linspace(0, 1, 6), folds, 5)
        y = Polynomial([0.0, 0.3])
        x, y = (x.deriv(derivative), y.deriv(derivative)) if derivative else (x, y)
        return np.stack([x(s), y(s), np.zeros_like(s)], axis=-1)

    line = exact_line(curve)
    distance = np.linalg.norm(line(np.linspace(0, 1, 10_001)), axis=1)
    crossings = np.flatnonzero(np.diff(np.sign(distance - 2.0)))
    assert len(crossings) == 5
    joints = place_joints(line, 2.0)
    check(line, joints, 2.0)
    assert joints.s[1] == pytest.approx(crossings[0] / 10_000, abs=1e-4)
    assert joints.s == pytest.approx(by_brute_force(line, 2.0), abs=1e-6)


def around_the_origin(exact_line, turns: float, *radius) -> Skeleton:
    """A plane curve by its distance from the origin as a function of s (and two derivatives), turning evenly."""

    def curve(s, derivative):
        r, w = [function(s) for function in radius], 1j * turns
        z = (r[0], r[1] + w * r[0], r[2] + 2 * w * r[1] + w**2 * r[0])[derivative] * np.exp(w * s)
        return np.stack([z.real, z.imag, np.zeros_like(s)], axis=-1)

    return exact_line(curve)


@pytest.mark.parametrize("height", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
def test_a_very_short_excursion_between_the_grid(exact_line, height: float) -> None:
    # Distance from f(0): up to 1 + height near s = 0.3137, down to 0.7, and out of the sphere for good at 0.86.
    # The excursion is as short as 2e-6 of s; the grid of the search is 5e-4.
    top = 0.3137
    rows = np.vander([0.0, top, 0.6, 1.0], 5, increasing=True)
    rows = np.vstack([rows, [0, 1, 2 * top, 3 * top**2, 4 * top**3]])

    def second_joint(highest: float) -> float:
        radius = Polynomial(np.linalg.solve(rows, [0, highest, 0.7, 2.0, 0.0]))
        line = around_the_origin(exact_line, 2.0, radius, radius.deriv(), radius.deriv(2))
        return float(place_joints(line, 1.0).s[1])

    # The radius is 1 + height - c (s - top)^2 there, with c about 7.
    assert top - 2 * math.sqrt(height / 7) - 1e-6 < second_joint(1 + height) < top
    assert second_joint(1 - height) > 0.8


def test_three_crossings_close_together(exact_line) -> None:
    # Out, in and out again within 4e-4 of s, less than an interval of the grid: the first one counts.
    roots = 0.50003 + np.array([-2e-4, 0, 2e-4])
    wiggle = Polynomial.fromroots(roots)
    radius = 1 - wiggle / wiggle(0)
    joints = place_joints(around_the_origin(exact_line, 1.0, radius, radius.deriv(), radius.deriv(2)), 1.0)
    assert joints.s[1] == pytest.approx(roots[0], abs=1e-6)


def test_a_curve_that_runs_along_the_sphere_is_quick(exact_line) -> None:
    # Inside by 1e-5 from s = 0.2 to 0.8, then out: the distance from f(0) is (1 - 1e-5) (1 - (1 - s)^60) + s^60.
    a, n = 1 - 1e-5, 60
    line = around_the_origin(
        exact_line,
        6.0,
        lambda s: a * (1 - (1 - s) ** n) + s**n,
        lambda s: n * (a * (1 - s) ** (n - 1) + s ** (n - 1)),
        lambda s: n * (n - 1) * (s ** (n - 2) - a * (1 - s) ** (n - 2)),
    )
    start = time.perf_counter()
    joints = place_joints(line, 1.0)
    assert time.perf_counter() - start < 1.0
    assert joints.s[1] == pytest.approx(1e-5 ** (1 / n), abs=1e-3)
    assert joints.s == pytest.approx(by_brute_force(line, 1.0), abs=1e-6)


def test_chords_of_a_circle(circle) -> None:
    line = circle(0.3, 4.0)
    joints = place_joints(line, 0.2)
    angle = 2 * math.asin(0.2 / 2 / 0.3)
    count = int(4.0 / angle)
    assert joints.s[:-1] == pytest.approx(np.arange(count + 1) * angle / 4.0, abs=1e-9)
    assert joints.last_segment_length == pytest.approx(0.6 * math.sin((4.0 - count * angle) / 2), abs=1e-9)


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-9, 1e-12])
def test_the_far_side_of_a_circle(circle, short: float) -> None:
    # l just below the diameter touches the circle at the antipode only.
    joints = place_joints(circle(0.3, 5.0), 0.6 * (1 - short))
    assert len(joints.s) == 3
    assert joints.s[1] == pytest.approx(2 * math.asin(1 - short) / 5.0, abs=1e-6)


def test_segments_of_a_straight_line(straight) -> None:
    line = straight([1, 2, 3], [1, 2, 4])
    joints = place_joints(line, 0.3)
    assert joints.positions[:, 2] == pytest.approx([3, 3.3, 3.6, 3.9, 4], abs=1e-9)
    assert joints.last_segment_length == pytest.approx(0.1, abs=1e-9)
    # What is left over by rounding is no segment.
    for count in (1, 2, 4, 10, 64):
        joints = place_joints(line, 1.0 / count)
        assert len(joints.s) == count + 1
        assert joints.last_segment_length == pytest.approx(1.0 / count, abs=1e-9)


@pytest.mark.parametrize("length", [0.9, 5.0, 1e300, math.inf])
def test_segments_longer_than_the_curve_give_one(circle, straight, length: float) -> None:
    line = circle(0.3, 2.0)  # end to end 0.505 m
    joints = place_joints(line, length)
    assert len(joints.s) == 2
    chord = 0.6 * math.sin(1.0)
    assert joints.segment_length == joints.last_segment_length == pytest.approx(chord)
    assert joints.positions == pytest.approx(line([0.0, 1.0]))
    line = straight([1, 2, 3], [1.3, 2, 3.4])
    joints = place_joints(line, max(length, 0.6))
    assert joints.segment_length == joints.last_segment_length == pytest.approx(0.5)


def test_ends_that_nearly_meet(circle) -> None:
    # The last joints are near the first one: they must not be taken for its neighbours.
    line = circle(0.3, 2 * np.pi - 0.01)
    joints = place_joints(line, 0.1)
    check(line, joints, 0.1)
    assert joints.s == pytest.approx(by_brute_force(line, 0.1), abs=1e-6)
    assert len(joints.s) == int((2 * np.pi - 0.01) / (2 * math.asin(1 / 6))) + 2


def test_a_loop_that_no_segment_can_resolve_is_refused(circle) -> None:
    with pytest.raises(FitError, match="starts and ends in one place") as error:
        place_joints(circle(0.3, 2 * np.pi), 0.7)
    assert error.value.hint is not None
    assert "e_max" in error.value.hint


@pytest.mark.parametrize("length", [1e-6, 1e-300, 0.0])
def test_absurdly_short_segments_are_refused(circle, length: float) -> None:
    with pytest.raises(FitError, match="100000 segments"):
        place_joints(circle(0.3, 2.0), length)


def test_many_segments_keep_their_length(exact_line) -> None:
    line = exact_line(centre_line("bent"))
    joints = place_joints(line, 0.002)
    check(line, joints, 0.002)
    assert len(joints.s) == pytest.approx(line.length / 0.002, abs=2)


def test_the_papers_hose(exact_line) -> None:
    line = exact_line(hose_centre_line())
    joints = place_joints(line, 0.1059)
    check(line, joints, 0.1059)
    assert len(joints.s) - 1 in (16, 17)


def test_far_from_the_origin(fitted) -> None:
    line = fitted(hose_centre_line())
    moved = Skeleton(line.basis, line.weights, np.array([5e6, -3e6, 100.0]), line.length)
    here, there = place_joints(line, 0.1), place_joints(moved, 0.1)
    assert there.s == pytest.approx(here.s, abs=1e-7)
    chords = np.linalg.norm(np.diff(there.positions, axis=0), axis=1)
    assert chords[:-1] == pytest.approx(np.full(len(chords) - 1, 0.1), abs=4e-9)  # the last digit of 5e6 is 1e-9
