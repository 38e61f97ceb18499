"""Bodies, limits and collision shapes of a model made of a chain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.config.sections import JointSettings, Material
from dlogen.errors import ConfigError
from dlogen.multibody.build import build_model, multibody
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

    def test_close_pairs(self) -> None:
        pairs = build_model(arc(10, 0.1, 0.0), JointSettings(), Material()).close_pairs()
        assert pairs == [(i, i + 1) for i in range(9)]
        # pi r = 31.4 mm is more than three segments between them.
        pairs = build_model(arc(8, 0.01, 0.0), JointSettings(), Material()).close_pairs()
        assert set(pairs) == {(i, j) for i in range(8) for j in range(i + 1, 8) if (j - i - 1) * 0.01 < math.pi * 0.01}
        assert build_model(arc(1, 0.1, 0.0), JointSettings(), Material()).close_pairs() == []


def test_of_a_result(make_result, circle) -> None:
    result = make_result(circle(0.5, 2.0))
    model = multibody(result)
    assert model.name == "cable"
    assert model.joint_positions() == pytest.approx(result.chain.joints, abs=1e-12)
    assert multibody(result, "other").name == "other"
