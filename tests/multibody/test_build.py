"""From a chain to its model: poses, names, mass, stiffness and limits against what they must be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from chains import arc, chain_of, random_chain, straightened
from hypothesis import assume, given
from hypothesis import strategies as st

from dlogen.config.defaults import ROOT_LINK
from dlogen.config.sections import JointSettings, Material
from dlogen.errors import ConfigError
from dlogen.multibody.build import build_model, multibody
from dlogen.types import Chain, Frame, Pose


class TestPoses:
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


class TestDynamics:
    def test_mass_and_inertia_of_a_tube(self) -> None:
        chain = arc(4, 0.1, 0.1, radius=0.02)
        material = Material(density=1000, wall_thickness=0.005)
        model = build_model(chain, JointSettings(), material)
        mass = 1000 * math.pi * (0.02**2 - 0.015**2) * 0.1
        for body in model.bodies:
            assert body.mass == pytest.approx(mass)
            assert body.axial_inertia == pytest.approx(mass / 2 * (0.02**2 + 0.015**2))
            assert body.transverse_inertia == pytest.approx(mass / 12 * (3 * (0.02**2 + 0.015**2) + 0.1**2))
        assert build_model(chain, JointSettings(), Material(mass=0.7)).bodies[0].mass == pytest.approx(0.7 / 4)

    def test_stiffness_of_each_joint(self) -> None:
        points = np.array([[0, 0, 0], [0.2, 0, 0], [0.4, 0, 0], [0.6, 0, 0], [0.65, 0, 0]])
        model = build_model(chain_of(points), JointSettings(dof=3), Material(youngs_modulus=3e6, shear_modulus=2e6))
        bending, torsion = 3e6 * math.pi / 4 * 1e-8, 2e6 * math.pi / 2 * 1e-8
        # Half of each neighbour, but all of the first and of the last segment.
        spans = [0.2 + 0.1, 0.1 + 0.1, 0.1 + 0.05]
        for joint, span in zip(model.joints, spans, strict=True):
            assert joint.stiffness == pytest.approx([bending / span, bending / span, torsion / span])
            assert joint.damping / joint.stiffness == pytest.approx(np.full(3, joint.damping[0] / joint.stiffness[0]))
        # A constant moment turns the tip by M L / (E I), however the object is cut.
        assert sum(1 / joint.stiffness[0] for joint in model.joints) == pytest.approx(0.65 / bending)

    def test_two_segments_have_one_joint_for_all(self) -> None:
        model = build_model(arc(2, 0.1, 0.1), JointSettings(), Material(youngs_modulus=1e6))
        assert model.joints[0].stiffness == pytest.approx(np.full(2, 1e6 * math.pi / 4 * 1e-8 / 0.2))

    def test_no_springs_without_a_modulus(self) -> None:
        model = build_model(arc(3, 0.1, 0.1), JointSettings(), Material())
        assert all(joint.stiffness is None for joint in model.joints)
        assert all((joint.damping > 0).all() for joint in model.joints)

    @pytest.mark.parametrize("zero", ["scan", "straight"])
    @pytest.mark.parametrize("rest", ["scan", "straight"])
    def test_rest_shape(self, zero: str, rest: str) -> None:
        chain = random_chain(2, 8)
        model = build_model(chain, JointSettings(zero=zero, rest=rest), Material(preset="rope"))
        relaxed = model.joint_positions(np.array([joint.rest for joint in model.joints]))
        assert relaxed == pytest.approx(chain.joints if rest == "scan" else straightened(chain), abs=1e-12)


class TestLimits:
    def test_unknown_is_half_a_turn(self) -> None:
        for joint in build_model(random_chain(3, 5), JointSettings(dof=3), Material()).joints:
            assert joint.bend_limit is None
            assert (joint.lower == -math.pi).all()
            assert (joint.upper == math.pi).all()

    def test_chords_of_a_circle_are_just_allowed(self) -> None:
        """A chain inscribed in a circle of the smallest radius uses the limit up; one a little tighter is refused."""
        bend = 2 * math.asin(0.1 / (2 * 0.3))
        chain = arc(6, 0.1, bend)
        for zero in ("scan", "straight"):
            model = build_model(chain, JointSettings(zero=zero, min_bend_radius=0.3), Material())
            for joint in model.joints:
                assert joint.bend_limit == pytest.approx(bend)
                assert joint.upper - joint.straight == pytest.approx([bend, bend])
                assert joint.straight - joint.lower == pytest.approx([bend, bend])
        with pytest.raises(ConfigError, match=r"min_bend_radius = 0.31 m, but the scan is bent to 0.3 m at joint \d"):
            build_model(chain, JointSettings(min_bend_radius=0.31), Material())

    @pytest.mark.parametrize("last", [0.02, 0.05, 0.1])
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_chords_of_unlike_length_on_a_circle_are_just_allowed(self, last: float, zero: str) -> None:
        """The last segment of most chains is shorter: its chord turns by less against the one before."""
        lengths = np.array([0.1, 0.1, 0.1, last])
        ends = np.concatenate([[0.0], np.cumsum(2.0 * np.arcsin(lengths / (2 * 0.3)))])
        chain = chain_of(0.3 * np.stack([np.cos(ends), np.sin(ends), 0.0 * ends], axis=1))
        assert chain.lengths == pytest.approx(lengths)
        model = build_model(chain, JointSettings(zero=zero, min_bend_radius=0.3), Material())
        for joint, here, there in zip(model.joints, chain.transforms[:-1], chain.transforms[1:], strict=True):
            bend = math.acos(here[:3, 0] @ there[:3, 0])
            assert joint.bend_limit == pytest.approx(bend, rel=1e-6)
            assert joint.upper - joint.straight == pytest.approx([bend, bend], rel=1e-6)

    @given(st.integers(0, 100), st.sampled_from(["scan", "straight"]), st.sampled_from([2, 3]))
    def test_both_poses_are_inside(self, seed: int, zero: str, dof: int) -> None:
        settings = JointSettings(dof, "fixed", zero, "straight", 0.005)
        model = build_model(random_chain(seed, 10, 0.3), settings, Material())
        for joint in model.joints:
            for values in (joint.scanned, joint.straight):
                assert (joint.lower <= values).all()
                assert (values <= joint.upper).all()

    def test_a_very_small_radius_limits_nothing(self) -> None:
        model = build_model(arc(4, 0.1, 0.2), JointSettings(min_bend_radius=0.001), Material())
        assert model.joints[0].bend_limit == pytest.approx(math.pi)
        assert model.joints[0].upper == pytest.approx([math.pi, math.pi])


def surface(start: np.ndarray, frame: np.ndarray, collision: tuple[float, float, float]) -> np.ndarray:
    """Points in and on a collision cylinder, (K, 3)."""
    begin, end, radius = collision
    x, angle, r = np.meshgrid(np.linspace(begin, end, 12), np.linspace(0, 2 * np.pi, 48), radius * np.array([0.5, 1.0]))
    local = np.stack([x.ravel(), (r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()], axis=1)
    return start + local @ frame.T


class TestCollision:
    @pytest.mark.parametrize(
        "chain",
        [
            arc(12, 0.1, 0.1),
            arc(12, 0.1, 1.2, radius=0.02),
            arc(20, 0.01, 0.3, radius=0.02),  # segments shorter than thick, as small e_max makes them
            arc(20, 0.02, 1.0, radius=0.02),  # bent as tightly as its radius
            random_chain(5, 20, 0.4),
        ],
        ids=["long", "bent", "short", "tight", "random"],
    )
    @pytest.mark.parametrize("pose", ["scanned", "straight"])
    def test_bodies_of_one_bend_do_not_touch(self, chain: Chain, pose: str) -> None:
        model = build_model(chain, JointSettings(), Material())
        frames = model.frames(getattr(model, pose))
        for i, j in model.close_pairs():
            for a, b in ((i, j), (j, i)):
                points = surface(frames[a, :3, 3], frames[a, :3, :3], model.bodies[a].collision)
                local = (points - frames[b, :3, 3]) @ frames[b, :3, :3]
                begin, end, radius = model.bodies[b].collision
                inside = (local[:, 0] > begin) & (local[:, 0] < end) & (np.hypot(local[:, 1], local[:, 2]) < radius)
                assert not inside.any()

    def test_cylinders_stay_in_their_segments(self) -> None:
        for chain in (arc(12, 0.1, 1.2), arc(20, 0.02, 1.5, radius=0.02), arc(1, 0.1, 0)):
            for body in build_model(chain, JointSettings(), Material()).bodies:
                begin, end, radius = body.collision
                assert 0 < begin < end < body.length
                assert 0 < radius <= body.radius


def test_of_a_result(make_result, circle) -> None:
    result = make_result(circle(0.5, 2.0))
    model = multibody(result)
    assert model.name == "cable"
    assert model.joint_positions() == pytest.approx(result.chain.joints, abs=1e-12)
    assert multibody(result, "other").name == "other"


def test_the_root_has_the_name_of_the_frame_only_if_one_was_given(make_result, circle) -> None:
    result = make_result(circle(0.5, 2.0))
    assert multibody(result).root == ROOT_LINK
    named = replace(result, config=result.config.resolved({"frame.name": "camera"}), frame=Frame("camera"))
    assert multibody(named).root == "camera"


def test_limits_allow_what_was_recorded() -> None:
    # Neither at the origin nor along its axes.
    chain = chain_of(arc(4, 0.1, 0.2).joints[:, [1, 2, 0]] + 1.0)
    seen = Pose("late", np.zeros(3), np.eye(3), np.array([[0.1, 2.0], [-1.9, 0.0], [0.0, 0.0]]), 1.0)
    model = build_model(chain, JointSettings(min_bend_radius=0.2), Material(), recorded=(seen,))
    alone = build_model(chain, JointSettings(min_bend_radius=0.2), Material())
    assert model.joints[0].upper[1] == 2.0 > alone.joints[0].upper[1]
    assert model.joints[1].lower[0] == -1.9 < alone.joints[1].lower[0]
    np.testing.assert_array_equal(model.joints[2].upper, alone.joints[2].upper)
    # Its base is where each pose says.
    assert not model.base_position.any()
    np.testing.assert_array_equal(model.base_rotation, np.eye(3))
    assert [pose.name for pose in model.poses] == ["late", "scanned", "straight"]
    assert model.poses[0] is seen


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_base_is_where_the_scan_began(base: str) -> None:
    chain = random_chain(3, 5)
    model = build_model(chain, JointSettings(base=base), Material())
    assert model.floating is (base == "floating")
    np.testing.assert_array_equal(model.base_position, chain.joints[0])
    np.testing.assert_array_equal(model.base_rotation, chain.transforms[0, :3, :3])
