"""The multibody model: kinematics, mass, stiffness and limits against what they must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dlogen.config.sections import JointSettings, Material
from dlogen.multibody.build import build_model
from dlogen.stages.chain import build_chain
from dlogen.types import Chain, Joints


def chain_of(points: np.ndarray, radius: float = 0.01) -> Chain:
    points = np.asarray(points, dtype=float)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    joints = Joints(np.linspace(0, 1, len(points)), points, float(lengths[0]), float(lengths[-1]))
    return build_chain(joints, radius)


def arc(count: int, length: float, bend: float, radius: float = 0.01) -> Chain:
    """Equal segments in a plane, each turned by `bend` against the one before."""
    angle = bend * np.arange(count)
    steps = length * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    return chain_of(np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), radius)


def random_chain(seed: int, count: int, bend: float = 0.5) -> Chain:
    """Equal segments but the last, in random directions that differ by up to about `bend` each time."""
    rng = np.random.default_rng(seed)
    directions = np.cumsum(np.vstack([rng.normal(size=3), bend * rng.normal(size=(count - 1, 3))]), axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = np.full(count, 0.05)
    lengths[-1] *= rng.uniform(0.1, 1.0)
    start = rng.normal(size=3)
    return chain_of(np.vstack([start, start + np.cumsum(lengths[:, None] * directions, axis=0)]))


def straightened(chain: Chain) -> np.ndarray:
    """The joints when the chain is straight along its first segment."""
    along = np.concatenate([[0.0], np.cumsum(chain.lengths)])
    return chain.joints[0] + along[:, None] * chain.transforms[0, :3, 0]


class TestKinematics:
    @given(
        st.integers(0, 1000),
        st.integers(1, 30),
        st.floats(0, 3),
        st.sampled_from([2, 3]),
        st.sampled_from(["scan", "straight"]),
    )
    def test_both_poses(self, seed: int, count: int, bend: float, dof: int, zero: str) -> None:
        chain = random_chain(seed, count, bend)
        assume(np.all(np.linalg.norm(np.diff(chain.transforms[:, :3, 0], axis=0), axis=1) < 1.9999))
        model = build_model(chain, JointSettings(dof=dof, zero=zero), Material())
        assert model.joint_positions(model.scanned) == pytest.approx(chain.joints, abs=1e-12)
        assert model.joint_positions(model.straight) == pytest.approx(straightened(chain), abs=1e-12)
        expected = chain.joints if zero == "scan" else straightened(chain)
        assert model.joint_positions() == pytest.approx(expected, abs=1e-12)
        assert not (model.scanned if zero == "scan" else model.straight).any()

    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_three_hinges_reproduce_the_frames_of_the_chain(self, zero: str) -> None:
        chain = random_chain(1, 20)
        model = build_model(chain, JointSettings(dof=3, zero=zero), Material())
        assert model.frames(model.scanned)[:, :3, :3] == pytest.approx(chain.transforms[:, :3, :3], abs=1e-12)

    def test_bend_about_one_axis_is_one_angle(self) -> None:
        model = build_model(arc(5, 0.1, 0.3), JointSettings(zero="straight"), Material())
        # The z axis of the first segment is up: a left turn is positive about z.
        assert model.scanned == pytest.approx(np.tile([0.0, 0.3], (4, 1)), abs=1e-14)

    @pytest.mark.parametrize("direction", [[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    @pytest.mark.parametrize("dof", [2, 3])
    def test_right_angles(self, direction: list[float], dof: int) -> None:
        chain = chain_of(np.array([[0, 0, 0], [1, 0, 0], np.add([1, 0, 0], direction)]))
        for zero in ("scan", "straight"):
            model = build_model(chain, JointSettings(dof=dof, zero=zero), Material())
            assert model.joint_positions(model.scanned) == pytest.approx(chain.joints, abs=1e-15)
            assert model.joint_positions(model.straight) == pytest.approx(straightened(chain), abs=1e-15)

    def test_zero_convention_does_not_change_the_springs(self) -> None:
        """The moments of the springs in the scanned pose, as vectors, agree to second order in the bend."""
        chain = random_chain(4, 6, 0.05)
        moments = []
        for zero in ("scan", "straight"):
            model = build_model(chain, JointSettings(zero=zero), Material(preset="rope"))
            frames = model.frames(model.scanned)[1:, :3, :3]
            pull = np.array([j.stiffness * (j.rest - j.scanned) for j in model.joints])
            moments.append(np.einsum("ijk,ik->ij", frames[:, :, 1:], pull))
        tangents = chain.transforms[:, :3, 0]
        axis = np.cross(tangents[:-1], tangents[1:])  # sin(bend) about the axis of the bend
        stiffness = np.array([j.stiffness[0] for j in model.joints])
        for moment in moments:
            assert moment == pytest.approx(-stiffness[:, None] * axis, abs=0.02 * np.abs(moment).max())


class TestNames:
    @pytest.mark.parametrize(("count", "first"), [(1, "segment_01"), (99, "segment_01"), (100, "segment_001")])
    def test_padded_so_that_they_sort(self, count: int, first: str) -> None:
        model = build_model(arc(count, 0.1, 0.01), JointSettings(dof=3), Material())
        names = [body.name for body in model.bodies]
        assert names == sorted(names)
        assert names[0] == first
        assert len(model.joints) == count - 1
        for i, joint in enumerate(model.joints):
            assert (joint.parent, joint.child) == (names[i], names[i + 1])
            assert joint.hinge_names == tuple(f"{joint.name}_{axis}" for axis in "yzx")
