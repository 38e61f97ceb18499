"""The models move as the objects would: MuJoCo against the elastica, a vibrating beam, free fall, and for 10 s.

Nothing in the MJCF is changed for a simulation: time step, solver, stiffness and masses are those of the file.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from configured import configured
from scipy.integrate import solve_bvp
from scipy.linalg import eigh
from scipy.optimize import root

from dlogen.config.presets import PRESETS
from dlogen.io.registry import model_format
from dlogen.multibody.build import multibody
from dlogen.multibody.model import MultibodyModel
from dlogen.stages.chain import build_chain
from dlogen.types import Joints

Array = np.ndarray
#: (preset, points, **joint settings) -> the multibody model and its MJCF, compiled.
Make = Callable[..., tuple[MultibodyModel, mujoco.MjModel]]

#: Outer radius of what the presets are meant for, metres; as in the configs folder.
RADIUS = {"vacuum-hose": 0.02, "network-cable": 0.003, "rope": 0.005, "silicone-tube": 0.006, "steel-wire": 0.0015}
SOFT, STIFF = "silicone-tube", "steel-wire"


def straight_line(count: int, last: float = 1.0) -> Array:
    """One metre along x in equal segments; the last is `last` times as long."""
    along = np.append(np.arange(count), count - 1 + last) / (count - 1 + last)
    return along[:, None] * [1.0, 0.0, 0.0]


def arc(count: int, last: float = 1.0) -> Array:
    """One metre of a quarter of a circle, lying flat. The object is bent when it is let go."""
    angle = 0.5 * np.pi * straight_line(count, last)[:, 0]
    return np.stack([np.sin(angle), 1.0 - np.cos(angle), np.zeros_like(angle)], axis=1) / (0.5 * np.pi)


def space_curve(count: int) -> Array:
    """Equal segments, bent to both sides and out of the plane."""
    s = np.linspace(0.0, 1.0, count)
    across, up = np.sin(2 * np.pi * s), 0.7 * np.sin(4.0 * s) * s
    steps = np.stack([np.cos(across) * np.cos(up), np.sin(across) * np.cos(up), np.sin(up)], axis=1)
    return np.vstack([np.zeros(3), np.cumsum(steps / count, axis=0)])


SHAPES = {"straight": straight_line, "arc": arc, "space": space_curve}


@pytest.fixture(scope="module")
def make(make_result, straight) -> Make:
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    @functools.cache
    def compiled(
        preset: str | None, shape: str, count: int, last: float = 1.0, length: float = 1.0, **joints: object
    ) -> tuple[MultibodyModel, mujoco.MjModel]:
        points = length * (SHAPES[shape](count) if last == 1.0 else SHAPES[shape](count, last))
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        placed = Joints(np.linspace(0, 1, count + 1), points, float(lengths[0]), float(lengths[-1]))
        radius = RADIUS.get(preset or "", 0.01)
        placed_result = replace(template, joints=placed, chain=build_chain(placed, radius))
        material = {"material": {"preset": preset}} if preset else {}
        result = configured(placed_result, r=radius, joints=joints, **material)
        (content,) = model_format("mjcf").write(result, "cable").values()
        return multibody(result), mujoco.MjModel.from_xml_string(content.decode())

    return compiled


def started(model: mujoco.MjModel, key: str | None = None, gravity: bool = True) -> mujoco.MjData:
    """At rest in the zero pose or in that of a keyframe."""
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.gravity[:] = [0.0, 0.0, -9.81 if gravity else 0.0]
    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    return data


def steps(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> Iterator[None]:
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        yield


def warned(data: mujoco.MjData) -> int:
    return sum(int(warning.number) for warning in data.warning)


class TestTenSeconds:
    """A cantilever of one metre is let go: in the zero pose, which is the scanned or the straight one."""

    @pytest.mark.parametrize("preset", [*PRESETS, None])
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    @pytest.mark.parametrize("shape", ["straight", "arc"])
    def test_energy_only_decreases(self, make: Make, preset: str | None, zero: str, shape: str) -> None:
        made, model = make(preset, shape, 20, zero=zero)
        assert model.opt.timestep == 0.002
        data = started(model)
        assert bool(data.energy[0] > 1e-9) == (preset is not None and shape == "arc" and zero == "scan")
        energy = [data.energy.sum(), *(data.energy.sum() for _ in steps(model, data, 10.0))]
        assert warned(data) == 0
        assert np.isfinite(data.qpos).all()
        scale = 9.81 * made.material.mass  # of all of it falling by one metre
        assert np.diff(energy).max() < 1e-9 * scale
        assert energy[-1] < energy[0] - 0.01 * scale

    def test_default_options(self, make: Make) -> None:
        """What the file leaves to MuJoCo is its integrator and solver."""
        opt, default = make(STIFF, "straight", 20, zero="scan")[1].opt, mujoco.MjSpec().compile().opt
        for name in ("integrator", "solver", "iterations", "tolerance", "timestep", "disableflags"):
            assert getattr(opt, name) == getattr(default, name)

    @pytest.mark.parametrize("dof", [2, 3])
    @pytest.mark.parametrize("preset", ["vacuum-hose", STIFF])
    def test_shorter_steps_where_2_ms_are_too_long(self, make: Make, preset: str, dof: int) -> None:
        """Of a short piece the vibrations are faster, and the time step is in the file."""
        _, model = make(preset, "arc", 10, length=0.1, dof=dof)
        assert 1e-5 < model.opt.timestep < 0.002
        data = started(model)
        energy = [data.energy.sum(), *(data.energy.sum() for _ in steps(model, data, 0.1))]
        assert warned(data) == 0
        assert np.diff(energy).max() < 1e-9 * energy[0]

    @pytest.mark.parametrize("dof", [2, 3])
    @pytest.mark.parametrize(("count", "last"), [(20, 0.02), (40, 0.001), (5, 0.05)])
    def test_last_segment_of_a_millimetre(self, make: Make, dof: int, count: int, last: float) -> None:
        """A stiff wire, bent in the scan: its tip is let go with more than MuJoCo's greatest acceleration."""
        _, model = make(STIFF, "arc", count, last, dof=dof)
        data = started(model)
        energy = [data.energy.sum(), *(data.energy.sum() for _ in steps(model, data, 1.0))]
        assert warned(data) == 0
        assert np.diff(energy).max() < 1e-9 * energy[0]

    def test_armature_only_where_the_last_segment_is_short(self, make: Make) -> None:
        """Half a segment is inert enough; a shorter one gets what it lacks, on the last joint only."""
        assert not make(STIFF, "straight", 20, dof=3)[1].dof_armature.any()
        assert not make(STIFF, "straight", 20, 0.51, dof=3)[1].dof_armature.any()
        assert not make(None, "straight", 20, 0.1, dof=3)[1].dof_armature.any()
        made, model = make(STIFF, "straight", 20, 0.1, dof=3)
        assert not model.dof_armature[:-3].any()
        mass, length, squares = (0.5 * made.bodies[0].mass, 0.5 * made.bodies[0].length, 0.0015**2)
        rod = np.array([mass * length**2 / 3 + mass * squares / 4] * 2 + [mass * squares / 2])
        mass, length = made.bodies[-1].mass, made.bodies[-1].length
        own = np.array([mass * length**2 / 3 + mass * squares / 4] * 2 + [mass * squares / 2])
        assert model.dof_armature[-3:] + own == pytest.approx(rod)


@functools.cache
def elastica(stiffness: float, weight: float, length: float) -> tuple[float, float]:
    """(x, z) of the tip of a heavy cantilever: E I phi'' = w (L - s) cos(phi), x' = cos(phi), z' = sin(phi).

    Clamped horizontally at s = 0, free of moment at s = L (Bisshopp & Drucker 1945, Large deflection of cantilever
    beams, with the beam's own weight as load). The load is raised in steps, each from the solution of the one before.
    """
    s, y = np.linspace(0.0, length, 201), np.zeros((4, 201))
    for load in np.geomspace(min(weight, stiffness / length**3), weight, 8):
        solution = solve_bvp(
            lambda s, y, load=load: np.vstack(
                [y[1], load * (length - s) * np.cos(y[0]) / stiffness, np.cos(y[0]), np.sin(y[0])]
            ),
            lambda start, end: np.array([start[0], end[1], start[2], start[3]]),
            s,
            y,
            tol=1e-9,
            max_nodes=100_000,
        )
        assert solution.success
        s, y = solution.x, solution.y
    return float(y[2, -1]), float(y[3, -1])


def hanging_tip(model: mujoco.MjModel) -> Array:
    """(3,) tip where all forces of the model are in balance. Its weight is raised in steps."""
    data = started(model)

    def forces(values: Array, weight: float) -> Array:
        model.opt.gravity[:] = [0.0, 0.0, -9.81 * weight]
        data.qpos[:], data.qvel[:] = values, 0.0
        mujoco.mj_forward(model, data)
        return data.qfrc_passive - data.qfrc_bias

    values = model.key("straight").qpos
    for weight in np.linspace(0.1, 1.0, 10):
        values = root(forces, values, args=(weight,), tol=1e-12).x
    assert np.abs(forces(values, 1.0)).max() < 1e-9
    return data.site("tip").xpos.copy()


class TestSag:
    def error(self, make: Make, preset: str, count: int, last: float = 1.0, shape: str = "straight", **joints) -> float:
        """Of the sag, as a part of it."""
        made, model = make(preset, shape, count, last, **joints)
        props = made.material
        _, z = elastica(props.bending_stiffness, 9.81 * props.mass_per_length, 1.0)
        return float(hanging_tip(model)[2] / z - 1.0)

    def test_reference(self) -> None:
        """Small loads sag by w L^4 / (8 E I), and what has hardly any stiffness hangs down."""
        assert elastica(1.0, 1e-3, 1.0) == pytest.approx((1.0, -1e-3 / 8), rel=1e-6)
        assert -1.0 < elastica(1e-3, 1.0, 1.0)[1] < -0.9

    @pytest.mark.parametrize("preset", PRESETS)
    def test_elastica(self, make: Make, preset: str) -> None:
        """3 % with 20 segments; the error falls with the square of the segment length."""
        errors = np.abs([self.error(make, preset, count) for count in (10, 20, 40)])
        assert errors[1] < 0.03
        assert (errors[:-1] / errors[1:] > 2.7).all()

    @pytest.mark.parametrize("preset", [SOFT, STIFF])
    def test_short_last_segment(self, make: Make, preset: str) -> None:
        assert abs(self.error(make, preset, 20, 0.2)) < 0.03

    @pytest.mark.parametrize("preset", [SOFT, STIFF])
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    @pytest.mark.parametrize("dof", [2, 3])
    def test_scanned_shape_does_not_matter(self, make: Make, preset: str, zero: str, dof: int) -> None:
        """A straight object that was bent when it was scanned.

        With the zero pose in the scan, the first hinge of a straightened joint stands askew by the bend of the joint,
        here 0.08 rad: it is stiffer by 1 / cos^2.
        """
        assert self.error(make, preset, 20, shape="arc", zero=zero, dof=dof) == pytest.approx(
            self.error(make, preset, 20), abs=0.008
        )


def test_slowest_vibration_of_a_cantilever(make: Make) -> None:
    """3.516 sqrt(E I / (m' L^4)) (Blevins), with the damping ratio that was asked for."""
    made, model = make(STIFF, "straight", 20)
    data = started(model, gravity=False)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    squares, modes = eigh(np.diag(model.jnt_stiffness), mass)
    props = made.material
    omega = 3.516 * np.sqrt(props.bending_stiffness / props.mass_per_length)
    assert np.sqrt(squares[:2]) == pytest.approx([omega, omega], rel=0.02)
    damping = modes[:, 0] @ (model.dof_damping * modes[:, 0])
    assert damping / (2.0 * np.sqrt(squares[0])) == pytest.approx(props.damping_ratio, rel=0.02)


class TestRestShape:
    @pytest.mark.parametrize("preset", [SOFT, STIFF])
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    @pytest.mark.parametrize("dof", [2, 3])
    def test_scanned_shape_stays_at_rest(self, make: Make, preset: str, zero: str, dof: int) -> None:
        _, model = make(preset, "space", 20, rest="scan", zero=zero, dof=dof)
        data = started(model, "scanned", gravity=False)
        start = data.qpos.copy()
        assert start.any() == (zero == "straight")
        assert max(np.abs(data.qpos - start).max() for _ in steps(model, data, 5.0)) < 1e-6
        assert warned(data) == 0

    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_straight_rest_shape_is_returned_to(self, make: Make, zero: str) -> None:
        made, model = make("vacuum-hose", "space", 20, rest="straight", zero=zero)
        data = started(model, "scanned", gravity=False)
        for _ in steps(model, data, 20.0):
            pass
        assert data.qpos == pytest.approx(made.straight.ravel(), abs=1e-3)


class TestFreeFall:
    def fallen(self, model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> Array:
        """(3,) way of the centre of mass."""
        start = data.subtree_com[0].copy()
        for _ in steps(model, data, seconds):
            pass
        mujoco.mj_forward(model, data)
        return data.subtree_com[0] - start

    @pytest.mark.parametrize("preset", [SOFT, STIFF])
    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_as_one_body(self, make: Make, preset: str, zero: str) -> None:
        _, model = make(preset, "space", 20, base="floating", rest="scan", zero=zero)
        data = started(model, "scanned")
        places, turns = data.xpos[1:].copy(), data.xquat.copy()
        way = self.fallen(model, data, 1.0)
        # Semi-implicit Euler is half a step ahead of g t^2 / 2.
        time, step = data.time, model.opt.timestep
        assert way == pytest.approx([0.0, 0.0, -0.5 * 9.81 * time * (time + step)], abs=1e-6)
        assert data.xpos[1:] - places == pytest.approx(np.tile(way, (20, 1)), abs=1e-6)
        assert data.xquat == pytest.approx(turns, abs=1e-6)

    @pytest.mark.parametrize("zero", ["scan", "straight"])
    def test_inner_forces_do_not_move_the_centre_of_mass(self, make: Make, zero: str) -> None:
        """While it falls, it straightens."""
        _, model = make("rope", "space", 20, base="floating", rest="straight", zero=zero)
        data = started(model, "scanned")
        bent = data.qpos[7:].copy()
        assert self.fallen(model, data, 1.0) == pytest.approx([0.0, 0.0, -0.5 * 9.81], abs=0.02)
        assert np.abs(data.qpos[7:] - bent).max() > 0.05
        assert warned(data) == 0
