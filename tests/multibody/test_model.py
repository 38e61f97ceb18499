"""The multibody model: forward kinematics, poses, and which bodies belong to one bend."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chains import arc, chain_of, random_chain, straightened
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.config.sections import JointSettings, Material
from dlogen.geometry.rotations import hinges
from dlogen.multibody.build import build_model
from dlogen.multibody.model import MultibodyModel, forward_kinematics
from dlogen.types import Pose


def model_of(count: int = 6, seed: int = 1, **settings: object) -> MultibodyModel:
    return build_model(random_chain(seed, count), JointSettings(**settings), Material())


def turned(axis: str, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis, by hand."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = math.cos(angle)
    out[j, i], out[i, j] = math.sin(angle), -math.sin(angle)
    return out


class TestForwardKinematics:
    @settings(deadline=None, max_examples=40)
    @given(st.integers(0, 1000), st.integers(1, 12), st.sampled_from([2, 3]), st.sampled_from(["scan", "straight"]))
    def test_by_products_of_matrices(self, seed: int, count: int, dof: int, zero: str) -> None:
        """Joint after joint as 4 x 4 matrices, each hinge about an axis that the ones before have turned."""
        model = model_of(count, seed, dof=dof, zero=zero)
        values = np.random.default_rng(seed).uniform(-math.pi, math.pi, (count - 1, dof))
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = model.base_rotation, model.base_position
        expected = [place]
        for joint, row in zip(model.joints, values, strict=True):
            origin = np.eye(4)
            origin[:3, :3], origin[0, 3] = joint.rotation, joint.offset
            for axis, angle in zip(joint.axes, row, strict=True):
                hinge = np.eye(4)
                hinge[:3, :3] = turned(axis, angle)
                origin = origin @ hinge
            place = place @ origin
            expected.append(place)
        assert model.frames(values) == pytest.approx(np.array(expected), abs=1e-12)
        tip = place @ [model.bodies[-1].length, 0.0, 0.0, 1.0]
        joints = np.vstack([np.array(expected)[:, :3, 3], tip[:3]])
        assert model.joint_positions(values) == pytest.approx(joints, abs=1e-12)
        assert forward_kinematics(model, values) == pytest.approx(joints, abs=1e-12)

    def test_values_may_be_lists(self) -> None:
        model = model_of()
        values = [[0.1 * i, -0.2 * i] for i in range(5)]
        np.testing.assert_array_equal(forward_kinematics(model, values), model.joint_positions(np.array(values)))

    def test_no_values_are_zeros(self) -> None:
        for zero in ("scan", "straight"):
            model = model_of(zero=zero)
            zeros = np.zeros((5, 2))
            np.testing.assert_array_equal(model.frames(), model.frames(zeros))
            np.testing.assert_array_equal(forward_kinematics(model), forward_kinematics(model, zeros))

    def test_segments_keep_their_lengths_whatever_the_values(self) -> None:
        model = model_of(dof=3)
        values = np.random.default_rng(3).normal(size=(5, 3))
        steps = np.linalg.norm(np.diff(forward_kinematics(model, values), axis=0), axis=1)
        assert steps == pytest.approx([body.length for body in model.bodies], rel=1e-12)

    def test_a_right_angle_by_hand(self) -> None:
        """A positive turn about z leads to the left, one about y down; x is along the segment."""
        chain = chain_of(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
        model = build_model(chain, JointSettings(), Material())
        left, up = model.base_rotation[:, 1], model.base_rotation[:, 2]
        for values, way in (([[0.0, math.pi / 2]], left), ([[math.pi / 2, 0.0]], -up)):
            assert forward_kinematics(model, values)[2] == pytest.approx(np.array([1.0, 0, 0]) + way, abs=1e-12)

    @pytest.mark.parametrize("shape", [(5,), (4, 2), (6, 2), (5, 3), (10,), (1, 5, 2)])
    def test_another_number_of_values(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(ValueError) as caught:
            forward_kinematics(model_of(), np.zeros(shape))
        assert str(shape) in str(caught.value) and "(5, 2)" in str(caught.value)

    def test_a_single_segment_has_nothing_to_set(self) -> None:
        model = model_of(1)
        expected = random_chain(1, 1).joints
        assert forward_kinematics(model) == pytest.approx(expected, abs=1e-12)
        assert forward_kinematics(model, np.zeros((0, 2))) == pytest.approx(expected, abs=1e-12)
        assert model.scanned.shape == model.straight.shape == (0, 2)


class TestPoses:
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_the_two_that_every_model_has(self, zero: str) -> None:
        chain = random_chain(2, 7)
        model = build_model(chain, JointSettings(zero=zero), Material())
        assert [pose.name for pose in model.poses] == ["scanned", "straight"]
        assert model.scan is model.poses[0]
        np.testing.assert_array_equal(model.scan.values, model.scanned)
        np.testing.assert_array_equal(model.poses[1].values, model.straight)
        assert model.joint_positions(model.scanned) == pytest.approx(chain.joints, abs=1e-12)
        assert model.joint_positions(model.straight) == pytest.approx(straightened(chain), abs=1e-12)

    def test_the_scan_comes_after_recorded_ones(self) -> None:
        seen = tuple(Pose(str(i), np.zeros(3), np.eye(3), np.zeros((5, 2)), float(i)) for i in range(3))
        model = build_model(random_chain(1, 6), JointSettings(), Material(), recorded=seen)
        assert model.scan.name == "scanned"

    @pytest.mark.parametrize("dof", [2, 3])
    def test_names_stand_in_the_order_of_the_values(self, dof: int) -> None:
        model = model_of(dof=dof)
        axes = ("y", "z", "x")[:dof]
        assert model.hinge_names == tuple(f"joint_0{i}_{axis}" for i in range(1, 6) for axis in axes)
        assert len(model.hinge_names) == model.scanned.size

    def test_hinges_turn_one_after_another(self) -> None:
        assert hinges(("y", "z", "x"), np.array([0.3, -0.4, 0.5])) == pytest.approx(
            turned("y", 0.3) @ turned("z", -0.4) @ turned("x", 0.5), abs=1e-15
        )


class TestClosePairs:
    def test_close_pairs(self) -> None:
        pairs = build_model(arc(10, 0.1, 0.0), JointSettings(), Material()).close_pairs()
        assert pairs == [(i, i + 1) for i in range(9)]
        # pi r = 31.4 mm is more than three segments between them.
        pairs = build_model(arc(8, 0.01, 0.0), JointSettings(), Material()).close_pairs()
        assert set(pairs) == {(i, j) for i in range(8) for j in range(i + 1, 8) if (j - i - 1) * 0.01 < math.pi * 0.01}
        assert build_model(arc(1, 0.1, 0.0), JointSettings(), Material()).close_pairs() == []
