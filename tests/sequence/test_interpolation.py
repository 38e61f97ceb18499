"""Poses over time: no twist, no jumps, forward kinematics as the formats have it, and what fills the holes."""

from __future__ import annotations

import numpy as np
import pytest
from moving import LENGTH, recorded

from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.rotations import hinges, smallest_rotations
from dlogen.sequence.interpolation import base_rotations, filled_in, hinge_values, smoothed
from dlogen.sequence.rigid_links import Shape, equal_links, fit_links

Array = np.ndarray


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def chains(name: str, seed: int = 0, count: int = 14, frames: int = 60, **noise: float) -> tuple[Array, Array, Array]:
    """(F, n + 1, 3) joints, links, times."""
    made = recorded(name, seed, frames, flips=False, **noise)
    curves = np.array([item.points for item in made.observed])
    lengths = np.array([item.length for item in made.observed])
    links = equal_links(LENGTH, count)
    return fit_links(Shape(curves, lengths, LENGTH, 0.5 * (LENGTH - lengths)), links), links, made.times


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


def follow(base: Array, zero: Array, values: Array) -> Array:
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
        joints, links, _ = chains(name, 2)
        d = np.diff(joints, axis=1) / links[:, None]
        own = minimal_rotation_frames(d[10])
        zero = np.swapaxes(own[:-1], 1, 2) @ own[1:]
        base = base_rotations(d[:, 0], own[0], 10)
        values = hinge_values(d, base, zero, dof, 10)
        assert values[10] == pytest.approx(0.0, abs=1e-9)
        for k in range(60):
            assert follow(base[k], zero, values[k]) == pytest.approx(d[k], abs=1e-9)

    def test_three_hinges_do_not_twist(self) -> None:
        joints, links, _ = chains("helix")
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
        """A joint that is bent on and on, by 5 degrees a frame; about z the two hinges are parallel at 90 degrees."""
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
            assert follow(np.eye(3), np.tile(np.eye(3), (2, 1, 1)), values[k]) == pytest.approx(d[k], abs=1e-9)

    def test_no_joints(self) -> None:
        d = np.tile([1.0, 0.0, 0.0], (4, 1, 1))
        assert hinge_values(d, np.tile(np.eye(3), (4, 1, 1)), np.zeros((0, 3, 3)), 2, 0).shape == (4, 0, 2)


class TestFilledIn:
    @pytest.mark.parametrize(("gap", "most"), [(1, 0.003), (3, 0.01)])
    def test_near_the_truth(self, gap: int, most: float) -> None:
        joints, links, times = chains("hose", 6)
        true, _, _ = chains("hose", 6, noise=0.0, end_noise=0.0)
        good = np.ones(60, dtype=bool)
        for k in range(8, 50, gap + 4):
            good[k : k + gap] = False
        hidden = joints.copy()
        hidden[~good] = np.nan
        filled = filled_in(hidden, links, times, good)
        assert np.linalg.norm(filled - true, axis=2)[~good].max() < most
        assert np.array_equal(filled[good], joints[good])
        assert np.linalg.norm(np.diff(filled, axis=1), axis=2) == pytest.approx(np.tile(links, (60, 1)), abs=1e-12)

    def test_uneven_times(self) -> None:
        joints, links, times = chains("hose", 6, frames=80, noise=0.0, end_noise=0.0)
        there = np.sort(np.random.default_rng(0).choice(80, 60, replace=False))
        good = np.ones(60, dtype=bool)
        good[[15, 30, 31, 47]] = False
        filled = filled_in(joints[there], links, times[there], good)
        assert np.linalg.norm(filled - joints[there], axis=2).max() < 0.003

    def test_rests_at_the_ends(self) -> None:
        joints, links, times = chains("rod")
        good = (np.arange(60) >= 3) & (np.arange(60) < 57)
        filled = filled_in(joints, links, times, good)
        assert np.all(filled[:3] == joints[3]) and np.all(filled[57:] == joints[56])

    def test_the_straight_way_across_a_long_gap(self) -> None:
        """A swing to and fro that nobody saw is not made up."""
        joints, links, times = chains("rod", noise=0.0, end_noise=0.0)
        good = (np.arange(60) < 20) | (np.arange(60) >= 40)
        filled = filled_in(joints, links, times, good)
        middle = filled[20:40].mean(axis=1)
        straight = 0.5 * (joints[19].mean(axis=0) + joints[40].mean(axis=0))
        assert np.linalg.norm(middle - straight, axis=1).max() < 0.01


class TestSmoothed:
    def test_less_noise(self) -> None:
        true, links, times = chains("loop", noise=0.0, end_noise=0.0)
        joints, _, _ = chains("loop")
        even = smoothed(joints, links, times, 0.006)
        before, after = (np.linalg.norm(made - true, axis=2)[2:-2].mean() for made in (joints, even))
        assert after < 0.8 * before
        assert np.linalg.norm(np.diff(even, axis=1), axis=2) == pytest.approx(np.tile(links, (60, 1)), abs=1e-12)
        assert np.array_equal(even[[0, 1, -2, -1]], joints[[0, 1, -2, -1]])

    def test_what_moves_fast_stays(self) -> None:
        joints, links, times = chains("whip", frames=12, noise=0.0, end_noise=0.0)
        even = smoothed(joints, links, times, 0.003)
        assert np.linalg.norm(even - joints, axis=2).max() <= 0.003
        changed = (even != joints).any(axis=(1, 2))
        assert not changed.all()

    def test_too_few(self) -> None:
        joints, links, times = chains("rod", frames=4)
        assert smoothed(joints, links, times, 1.0) is joints
