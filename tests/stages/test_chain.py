from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dlogen.evaluation.shapes import centre_line, hose_centre_line, random_centre_line
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.stages.chain import build_chain, deviation
from dlogen.stages.segmentation.joints import place_joints
from dlogen.types import Chain, Joints

Z = np.array([0.0, 0.0, 1.0])


def check(chain: Chain) -> None:
    """What every chain has to be (Eq. 1-2)."""
    rotation, centre = chain.transforms[:, :3, :3], chain.transforms[:, :3, 3]
    n = len(chain.lengths)
    assert chain.transforms.shape == (n, 4, 4)
    assert np.array_equal(chain.transforms[:, 3], np.tile([0, 0, 0, 1.0], (n, 1)))
    assert np.einsum("kij,kil->kjl", rotation, rotation) == pytest.approx(np.tile(np.eye(3), (n, 1, 1)), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(np.ones(n), abs=1e-12)  # right-handed
    assert centre == pytest.approx((chain.joints[:-1] + chain.joints[1:]) / 2, abs=1e-12)  # Eq. 2
    half = 0.5 * chain.lengths[:, None] * rotation[:, :, 0]  # x along the segment
    assert centre - half == pytest.approx(chain.joints[:-1], abs=1e-12)
    assert centre + half == pytest.approx(chain.joints[1:], abs=1e-12)
    assert chain.length == pytest.approx(np.linalg.norm(np.diff(chain.joints, axis=0), axis=1).sum())


def turns(chain: Chain) -> np.ndarray:
    """Rotation vector from each segment's frame to the next, in the frame of the first of the two: (n - 1, 3)."""
    rotation = chain.transforms[:, :3, :3]
    return Rotation.from_matrix(np.einsum("kji,kjl->kil", rotation[:-1], rotation[1:])).as_rotvec()


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.floats(0.02, 0.5))
def test_chains_of_random_lines(exact_line, seed: int, length: float) -> None:
    joints = place_joints(exact_line(random_centre_line(seed)), length)
    chain = build_chain(joints, 0.01)
    check(chain)
    assert np.array_equal(chain.joints, joints.positions)
    assert np.array_equal(chain.s, joints.s)
    assert chain.radius == 0.01
    # No twist: a joint turns about an axis across both of its segments only.
    assert turns(chain)[:, 0] == pytest.approx(np.zeros(len(chain.lengths) - 1), abs=1e-9)


def test_one_segment(straight) -> None:
    chain = build_chain(place_joints(straight([0, 0, 1], [0, 2, 1]), math.inf), 0.01)
    check(chain)
    assert chain.transforms[0] == pytest.approx(np.array([[0, -1, 0, 0], [1, 0, 0, 1], [0, 0, 1, 1], [0, 0, 0, 1]]))


@pytest.mark.parametrize(
    "direction", [[1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.1, 0, 1], [1e-9, 0, 1], [1, 1, 1]]
)
def test_the_first_frame(straight, direction) -> None:
    chain = build_chain(place_joints(straight([0, 0, 0], direction), math.inf), 0.01)
    check(chain)
    x, y, z = chain.transforms[0, :3, :3].T
    if abs(x[2]) < 0.9:  # z as near to the world's as can be, y level
        assert y[2] == pytest.approx(0, abs=1e-12)
        assert z[2] >= 0
    else:  # the world's x axis instead
        assert y[0] == pytest.approx(0, abs=1e-12)
        assert z[0] >= 0


def test_a_plane_curve_keeps_its_normal(exact_line) -> None:
    # The hose bends one way and then, weaker, on; `s` bends left and then right, where a Frenet frame would flip.
    for line in (exact_line(hose_centre_line()), exact_line(random_centre_line(4, dimensions=2))):
        chain = build_chain(place_joints(line, 0.05), 0.01)
        assert chain.transforms[:, :3, 2] == pytest.approx(np.tile(Z, (len(chain.lengths), 1)), abs=1e-12)
        angle = turns(chain)
        assert np.abs(angle[:, :2]).max() < 1e-9
    # There are bends to both sides on the second one, and the signs of the angles say so.
    assert angle[:, 2].min() < -0.05
    assert angle[:, 2].max() > 0.05
    tangent = chain.transforms[:, :3, 0]
    left = np.cross(tangent[:-1], tangent[1:])[:, 2]
    assert np.sign(angle[:, 2]) == pytest.approx(np.sign(left))


def test_a_turned_plane_curve_keeps_its_normal(exact_line) -> None:
    rotation = Rotation.from_rotvec([0.4, -0.7, 1.9]).as_matrix()
    line = exact_line(random_centre_line(4, dimensions=2).moved(rotation, np.array([1.0, 2, 3])))
    frames = build_chain(place_joints(line, 0.05), 0.01).transforms[:, :3, :3]
    normal = np.einsum("kji,j->ki", frames, rotation @ Z)
    assert normal == pytest.approx(np.tile(normal[0], (len(normal), 1)), abs=1e-12)


def test_the_twist_on_a_helix_is_that_of_parallel_transport(helix) -> None:
    # Against the Frenet frame, a rotation-minimising frame turns back by the torsion: tau = b / (a^2 + b^2) a metre.
    a, b, angle = 0.3, 0.1, 6 * np.pi
    line = helix(a, b, angle)
    chain = build_chain(place_joints(line, 0.01), 0.001)
    # The principal normal at a segment's middle points to the helix's axis.
    tangent, y, z = (chain.transforms[:, :3, i] for i in range(3))
    centre = chain.transforms[:, :3, 3]
    normal = -centre * [1, 1, 0]
    normal -= np.einsum("ij,ij->i", normal, tangent)[:, None] * tangent
    phase = np.unwrap(np.arctan2(np.einsum("ij,ij->i", normal, z), np.einsum("ij,ij->i", normal, y)))
    torsion = b / (a * a + b * b)
    along = np.cumsum(chain.lengths) - chain.lengths / 2
    expected = torsion * (along - along[0])
    assert phase[:-1] - phase[0] == pytest.approx(expected[:-1], rel=2e-3, abs=1e-3)
    assert phase[-2] - phase[0] > 5  # almost a whole turn


def test_long_chains_stay_orthonormal() -> None:
    rng = np.random.default_rng(0)
    tangents = np.cumsum(rng.normal(scale=0.2, size=(5000, 3)), axis=0) + np.array([0.3, 0.2, 0.1])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    frames = minimal_rotation_frames(tangents)
    assert np.abs(np.einsum("kij,kil->kjl", frames, frames) - np.eye(3)).max() < 1e-12
    assert np.array_equal(frames[:, :, 0], tangents)


@pytest.mark.parametrize("bend", [np.pi, np.pi - 1e-7, np.pi - 1e-3, np.pi / 2, 1e-9, 0.0])
def test_sharp_bends(bend: float) -> None:
    # A hairpin from one joint to the next: no frame is the right one at exactly 180 degrees, but it must be a frame.
    tangents = np.array([[1.0, 0, 0], [math.cos(bend), math.sin(bend), 0], [math.cos(bend), math.sin(bend), 0]])
    frames = minimal_rotation_frames(tangents)
    assert np.einsum("kij,kil->kjl", frames, frames) == pytest.approx(np.tile(np.eye(3), (3, 1, 1)), abs=1e-12)
    assert np.linalg.det(frames) == pytest.approx(np.ones(3))
    assert np.abs(frames[:, 2, 2]) == pytest.approx(np.ones(3), abs=1e-6)
    assert np.array_equal(frames[1], frames[2])


def by_brute_force(line, joints: Joints) -> float:
    worst = 0.0
    for i in range(len(joints.s) - 1):
        points = line(np.linspace(joints.s[i], joints.s[i + 1], 1001))
        start, along = joints.positions[i], joints.positions[i + 1] - joints.positions[i]
        t = np.clip((points - start) @ along / (along @ along), 0, 1)
        worst = max(worst, np.linalg.norm(points - start - np.outer(t, along), axis=1).max())
    return worst


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.floats(0.02, 0.5))
def test_deviation_is_that_of_brute_force(exact_line, seed: int, length: float) -> None:
    line = exact_line(random_centre_line(seed))
    joints = place_joints(line, length)
    distance, s = deviation(line, joints)
    expected = by_brute_force(line, joints)
    assert distance == pytest.approx(expected, rel=1e-4, abs=1e-9)
    # And it is where it says.
    i = min(int(np.searchsorted(joints.s, s, side="right")) - 1, len(joints.s) - 2)
    start, along = joints.positions[i], joints.positions[i + 1] - joints.positions[i]
    point = line(s)
    t = np.clip((point - start) @ along / (along @ along), 0, 1)
    assert np.linalg.norm(point - start - t * along) == pytest.approx(distance, rel=1e-6, abs=1e-12)


def test_deviation_of_a_circle_is_the_sagitta(circle) -> None:
    line = circle(0.145, 3.0)
    distance, _ = deviation(line, place_joints(line, 0.1059))
    assert distance == pytest.approx(0.145 - math.sqrt(0.145**2 - (0.1059 / 2) ** 2), rel=1e-6)


def test_deviation_of_a_straight_line_is_nothing(straight) -> None:
    line = straight([5, 6, 7], [1, 1, 1])
    assert deviation(line, place_joints(line, 0.3))[0] < 1e-12


def test_each_piece_is_measured_against_its_own_segment(exact_line) -> None:
    # A hairpin within one segment: another segment may be nearer, but is not the one that stands for it.
    line = exact_line(centre_line("bent"))
    whole = Joints(np.array([0.0, 1.0]), line([0.0, 1.0]), 4.0, 4.0)
    distance, s = deviation(line, whole)
    assert distance == pytest.approx(1.0)
    assert s == pytest.approx(0.5, abs=1e-3)


def test_what_sticks_out_beyond_a_segment_counts(exact_line) -> None:
    # Out to x = 3.27 and back to x = 1 within one segment, which ends there: 2.27 m from the farthest point.
    def curve(s, derivative):
        x = (12 * s - 11 * s**2, 12 - 22 * s, np.full_like(s, -22.0))[derivative]
        return np.stack([x, np.zeros_like(s), np.zeros_like(s)], axis=-1)

    line = exact_line(curve)
    distance, s = deviation(line, Joints(np.array([0.0, 1.0]), line([0.0, 1.0]), 1.0, 1.0))
    assert distance == pytest.approx(36 / 11 - 1, rel=1e-4)
    assert s == pytest.approx(6 / 11, abs=1e-2)
