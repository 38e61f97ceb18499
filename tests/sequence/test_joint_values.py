"""Poses over time: no twist, no jumps, and forward kinematics as the formats have it."""

from __future__ import annotations

import numpy as np
import pytest
from moving import fitted_chains

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.rotations import hinges, smallest_rotations
from dlogen.sequence.joint_values import base_rotations, hinge_values

Array = np.ndarray


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


class TestBase:
    def test_no_twist_in_either_direction_of_time(self) -> None:
        steps = 0.2 * np.random.default_rng(3).normal(size=(40, 3))
        d = unit(np.array([1.0, 0.0, 0.0]) + np.cumsum(steps, axis=0))
        first = minimal_rotation_frames(d[17:18])[0]
        out = base_rotations(d, first, 17)
        assert out[17] == pytest.approx(first)
        assert out[:, :, 0] == pytest.approx(d)
        for k in range(39):
            turn = out[k + 1] @ out[k].T
            # The axis of the rotation has no part along the link.
            axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            assert abs(axis @ d[k]) < 1e-9 and abs(axis @ d[k + 1]) < 1e-9


def link_directions(base: Array, zero: Array, values: Array) -> Array:
    """(n, 3) directions of the links by forward kinematics, as `dlogen.multibody.model` has it."""
    axes = ("y", "z", "x")[: values.shape[1]]
    rotation, out = base, [base[:, 0]]
    for turn, row in zip(zero, values, strict=True):
        rotation = rotation @ turn @ hinges(axes, row)
        out.append(rotation[:, 0])
    return np.array(out)


class TestHinges:
    @pytest.mark.parametrize("dof", [2, 3])
    @pytest.mark.parametrize("name", ["hose", "helix", "whip", "loop", "hairpin"])
    def test_forward_kinematics(self, name: str, dof: int) -> None:
        joints, links, _ = fitted_chains(name, 2)
        d = np.diff(joints, axis=1) / links[:, None]
        own = minimal_rotation_frames(d[10])
        zero = np.swapaxes(own[:-1], 1, 2) @ own[1:]
        base = base_rotations(d[:, 0], own[0], 10)
        values = hinge_values(d, base, zero, dof, 10)
        assert values[10] == pytest.approx(0.0, abs=1e-9)
        for k in range(60):
            assert link_directions(base[k], zero, values[k]) == pytest.approx(d[k], abs=1e-9)

    def test_three_hinges_do_not_twist(self) -> None:
        joints, links, _ = fitted_chains("helix")
        d = np.diff(joints, axis=1) / links[:, None]
        base = base_rotations(d[:, 0], minimal_rotation_frames(d[0])[0], 0)
        values = hinge_values(d, base, np.tile(np.eye(3), (13, 1, 1)), 3, 0)
        for k in (0, 20, 59):
            rotation = base[k]
            for i, row in enumerate(values[k]):
                turned = rotation @ hinges(("y", "z", "x"), row)
                expected = smallest_rotations(d[k, i][None], d[k, i + 1][None])[0] @ rotation
                assert turned == pytest.approx(expected, abs=1e-9)
                rotation = turned

    @pytest.mark.parametrize("plane", ["y", "z"])
    @pytest.mark.parametrize("dof", [2, 3])
    def test_continuous_beyond_a_right_angle_and_a_whole_turn(self, plane: str, dof: int) -> None:
        """A joint that is bent on and on, by 5 degrees a capture; about z the two hinges are parallel at 90 degrees."""
        angle = np.radians(5.0) * np.arange(100) - 1.0
        about = {"y": [np.cos(angle), 0 * angle, -np.sin(angle)], "z": [np.cos(angle), np.sin(angle), 0.01 + 0 * angle]}
        d = np.tile([1.0, 0.0, 0.0], (100, 3, 1))
        d[:, 1] = d[:, 2] = unit(np.stack(about[plane], axis=1))
        values = hinge_values(d, np.tile(np.eye(3), (100, 1, 1)), np.tile(np.eye(3), (2, 1, 1)), dof, 20)
        # Near parallel hinges, and as the smallest rotation turns over at half a turn, they move faster than the link.
        assert np.abs(np.diff(values[:, 0, :2], axis=0)).max() < (0.1 if plane == "y" else 2.5)
        if plane == "y":
            assert values[:, 0, 0] == pytest.approx(angle, abs=1e-9)
        for k in range(100):
            assert link_directions(np.eye(3), np.tile(np.eye(3), (2, 1, 1)), values[k]) == pytest.approx(d[k], abs=1e-9)

    def test_no_joints(self) -> None:
        d = np.tile([1.0, 0.0, 0.0], (4, 1, 1))
        assert hinge_values(d, np.tile(np.eye(3), (4, 1, 1)), np.zeros((0, 3, 3)), 2, 0).shape == (4, 0, 2)
