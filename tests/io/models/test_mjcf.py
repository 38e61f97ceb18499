"""MJCF in MuJoCo: what the file says beyond kinematics, and that it simulates as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from configured import configured

from dlogen.config.presets import PRESETS
from dlogen.errors import FitError
from dlogen.io.models.mjcf import MOST_SEGMENTS, write
from dlogen.multibody.build import multibody
from dlogen.multibody.model import MultibodyModel
from dlogen.stages.chain import build_chain
from dlogen.types import FitData, Joints

mujoco = pytest.importorskip("mujoco")

#: Radii of the presets' usual specimens, metres.
RADII = {"vacuum-hose": 0.02, "network-cable": 0.003, "rope": 0.005, "silicone-tube": 0.006, "steel-wire": 0.0015}

Make = Callable[..., FitData]


@pytest.fixture(scope="module")
def arc(make_result, straight) -> Make:
    """A horizontal chain of equal segments, 1 m long, that turns left and up by `bend` in all."""
    template = make_result(straight([0, 0, 0], [1, 0, 0]))

    def make(
        count: int = 20, bend: float = 0.0, radius: float = 0.005, length: float = 1.0, **settings: Any
    ) -> FitData:
        angle = np.linspace(0, bend, count)
        steps = np.stack([np.cos(angle), 0.8 * np.sin(angle), 0.6 * np.sin(angle)], axis=1) * length / count
        points = np.cumsum(np.vstack([[0, 0, 1], steps]), axis=0)
        joints = Joints(np.linspace(0, 1, count + 1), points, length / count, length / count)
        chosen = {"joints": {}, "material": {}} | settings
        chain = build_chain(joints, radius)
        return configured(replace(template, joints=joints, chain=chain), **chosen)

    return make


@pytest.fixture
def load(monkeypatch, tmp_path):
    """A model and its data; what MuJoCo has to complain about is an error."""
    monkeypatch.chdir(tmp_path)

    def load_it(result: FitData):
        (content,) = write(result, "cable").values()
        model = mujoco.MjModel.from_xml_string(content.decode())
        assert not list(tmp_path.iterdir())
        return model, mujoco.MjData(model)

    return load_it


def hinge_values(model: MultibodyModel, name: str) -> np.ndarray:
    return np.array([getattr(joint, name) for joint in model.joints]).ravel()


@pytest.mark.parametrize("dof", [2, 3])
@pytest.mark.parametrize("zero", ["scan", "straight"])
@pytest.mark.parametrize("rest", ["scan", "straight"])
def test_mass_springs_damping_and_limits(arc, load, dof: int, zero: str, rest: str) -> None:
    joints = {"dof": dof, "zero": zero, "rest": rest, "min_bend_radius": 0.05}
    result = arc(count=8, bend=1.5, radius=0.006, joints=joints, material={"preset": "silicone-tube"})
    expected = multibody(result)
    model, _ = load(result)
    bends = np.arange(model.njnt) % dof < 2
    assert model.jnt_stiffness == pytest.approx(hinge_values(expected, "stiffness"), rel=1e-12)
    assert model.dof_damping.ravel()[: model.nv] == pytest.approx(hinge_values(expected, "damping"), rel=1e-12)
    assert model.qpos_spring == pytest.approx(hinge_values(expected, "rest"), abs=1e-12)
    assert (model.jnt_limited.astype(bool) == bends).all()
    assert model.jnt_range[bends, 0] == pytest.approx(hinge_values(expected, "lower")[bends])
    assert model.jnt_range[bends, 1] == pytest.approx(hinge_values(expected, "upper")[bends])
    assert model.body_mass[1:] == pytest.approx([body.mass for body in expected.bodies])
    assert model.body_inertia[1:, 0] == pytest.approx([body.axial_inertia for body in expected.bodies])
    assert model.body_inertia[1:, 2] == pytest.approx([body.transverse_inertia for body in expected.bodies])
    assert model.body_ipos[1:, 0] == pytest.approx([body.length / 2 for body in expected.bodies])


def test_without_a_modulus_there_are_no_springs(arc, load) -> None:
    model, _ = load(arc())
    assert not model.jnt_stiffness.any()
    assert not model.jnt_limited.any()


def test_capsules_span_the_segments(arc, load) -> None:
    result = arc(count=10, radius=0.006)
    model, data = load(result)
    mujoco.mj_forward(model, data)
    assert (model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE).all()
    assert model.geom_size[:, 0] == pytest.approx(np.full(10, 0.006))
    assert 2 * (model.geom_size[:, 0] + model.geom_size[:, 1]) == pytest.approx(result.chain.lengths)
    assert data.geom_xpos == pytest.approx(result.chain.transforms[:, :3, 3], abs=1e-12)
    assert np.abs(data.geom_xmat.reshape(-1, 3, 3)[:, :, 2]) == pytest.approx(
        np.abs(result.chain.transforms[:, :3, 0]), abs=1e-9
    )


@pytest.mark.parametrize(
    ("count", "bend", "radius"), [(10, 0.5, 0.02), (10, 5.0, 0.02), (100, 5.0, 0.02), (1, 0, 0.02)]
)
@pytest.mark.parametrize("pose", ["scanned", "straight"])
def test_nothing_touches(arc, load, count: int, bend: float, radius: float, pose: str) -> None:
    model, data = load(arc(count=count, bend=bend, radius=radius))
    mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_strands_that_meet_do_touch(arc, load) -> None:
    """More than a turn: beyond the bend, contact is real."""
    model, data = load(arc(count=40, bend=9.0, radius=0.02))
    mujoco.mj_forward(model, data)
    assert data.ncon > 0


def run(model, data, seconds: float, pose: str) -> np.ndarray:
    """Simulate from a pose; the total energy every 20 ms."""
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    energy = []
    for step in range(round(seconds / model.opt.timestep)):
        if step % 10 == 0:
            mujoco.mj_forward(model, data)
            energy.append(data.energy.sum())
        mujoco.mj_step(model, data)
    assert sum(warning.number for warning in data.warning) == 0
    assert np.isfinite(data.qpos).all()
    return np.array(energy)


@pytest.mark.parametrize("preset", [*PRESETS, "none"])
@pytest.mark.parametrize(("zero", "dof"), [("scan", 2), ("straight", 3)])
def test_cantilever_of_every_preset_at_the_default_time_step(arc, load, preset: str, zero: str, dof: int) -> None:
    result = arc(
        bend=1.0, radius=RADII.get(preset, 0.01), joints={"zero": zero, "dof": dof}, material={"preset": preset}
    )
    model, data = load(result)
    assert model.opt.timestep == 0.002
    energy = run(model, data, 4.0, "scanned")
    assert np.diff(energy).max() < 1e-3 * np.ptp(energy)  # energy does not grow
    assert np.abs(data.qvel).max() < 50


@pytest.mark.parametrize("preset", ["rope", "steel-wire"])
@pytest.mark.parametrize("zero", ["scan", "straight"])
def test_at_rest_in_the_rest_shape(arc, load, preset: str, zero: str) -> None:
    result = arc(bend=1.0, radius=RADII[preset], joints={"zero": zero, "rest": "scan"}, material={"preset": preset})
    model, data = load(result)
    model.opt.gravity[:] = 0
    run(model, data, 2.0, "scanned")
    assert data.xpos[1:] == pytest.approx(result.chain.joints[:-1], abs=1e-9)


def test_a_short_stiff_wire_gets_a_shorter_step(arc, load) -> None:
    result = arc(bend=0.05, radius=0.0015, length=0.2, material={"preset": "steel-wire"})
    model, data = load(result)
    assert 1e-5 < model.opt.timestep < 0.002
    energy = run(model, data, 0.5, "scanned")
    assert np.diff(energy).max() < 1e-3 * np.ptp(energy)
    # With the default it would not do: this is what the shorter step is for.
    model.opt.timestep = 0.002
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    assert sum(warning.number for warning in data.warning) > 0


def test_floating_base_falls(arc, load) -> None:
    result = arc(bend=1.0, joints={"base": "floating"}, material={"preset": "rope"})
    model, data = load(result)
    assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    mujoco.mj_forward(model, data)
    before = data.subtree_com[1].copy()
    run(model, data, 0.2, "scanned")
    mujoco.mj_forward(model, data)
    assert data.subtree_com[1] - before == pytest.approx([0, 0, -0.5 * 9.81 * 0.2**2], abs=0.003)


def test_more_segments_than_mujoco_reads(arc, load) -> None:
    model, _ = load(arc(count=MOST_SEGMENTS))
    assert model.nbody == MOST_SEGMENTS + 1
    with pytest.raises(FitError, match="nested 496 deep") as caught:
        write(arc(count=MOST_SEGMENTS + 1), "cable")
    assert "e_max" in caught.value.hint
