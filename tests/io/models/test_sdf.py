"""SDF: what it says, by its own text; and in Drake where that is installed."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from configured import configured
from scipy.spatial.transform import Rotation

from dlogen.io.models.sdf import write
from dlogen.multibody.build import multibody
from dlogen.types import FitData


@pytest.fixture
def result(make_result, helix) -> FitData:
    return make_result(helix(0.3, 0.05, 4.0), 0.01, 0.005)


def with_settings(result: FitData, material: dict[str, object] | None = None, **joints: object) -> FitData:
    return configured(result, joints=joints, material=material or {})


def parsed(result: FitData, stem: str = "cable") -> ElementTree.Element:
    (name, content), *others = write(result, stem).items()
    assert name == f"{stem}.sdf"
    assert not others
    root = ElementTree.fromstring(content)
    assert (root.tag, root.get("version")) == ("sdf", "1.7")
    return root.find("model")


def pose(element: ElementTree.Element) -> np.ndarray:
    x, y, z, *angles = (float(number) for number in element.findtext("pose").split())
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_euler("xyz", angles).as_matrix(), (x, y, z)
    return out


@pytest.mark.parametrize("dof", [2, 3])
@pytest.mark.parametrize("zero", ["scan", "straight"])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_poses_by_its_own_frames(result, dof: int, zero: str, base: str) -> None:
    result = with_settings(result, dof=dof, zero=zero, base=base)
    model, sdf = multibody(result), parsed(result)
    joints = {joint.get("name"): joint for joint in sdf.findall("joint")}
    links = {link.get("name"): link for link in sdf.findall("link")}
    assert list(links) == [body.name for body in model.bodies]
    at, expected = {}, model.frames()
    for i, (name, link) in enumerate(links.items()):
        relative = link.find("pose").get("relative_to")
        if relative is None:
            at[name] = pose(link)
        else:
            joint = joints[relative]
            parent = joint.find("pose").get("relative_to")
            assert parent == joint.findtext("parent")
            assert joint.findtext("child") == name
            at[name] = at[parent] @ pose(joint) @ pose(link)
        assert at[name] == pytest.approx(expected[i], abs=1e-9)
    tip = sdf.find("frame[@name='tip']")
    assert at[tip.get("attached_to")] @ pose(tip) @ [0, 0, 0, 1] == pytest.approx(
        [*model.joint_positions()[-1], 1], abs=1e-9
    )
    fixed = [joint for joint in joints.values() if joint.get("type") == "fixed"]
    assert [(joint.findtext("parent"), joint.findtext("child")) for joint in fixed] == (
        [("world", model.bodies[0].name)] if base == "fixed" else []
    )
    kinds = {joint.get("type") for joint in joints.values()} - {"fixed"}
    assert kinds == {"universal" if dof == 2 else "ball"}


@pytest.mark.parametrize("zero", ["scan", "straight"])
@pytest.mark.parametrize("rest", ["scan", "straight"])
def test_universal_joints_have_springs_damping_and_limits(result, zero: str, rest: str) -> None:
    result = with_settings(result, {"preset": "rope"}, zero=zero, rest=rest, min_bend_radius=0.1)
    found = {joint.get("name"): joint for joint in parsed(result).findall("joint[@type='universal']")}
    model = multibody(result)
    assert list(found) == [joint.name for joint in model.joints]
    for joint in model.joints:
        for k, tag in enumerate(("axis", "axis2")):
            axis = found[joint.name].find(tag)
            assert [float(value) for value in axis.findtext("xyz").split()] == ([0, 1, 0], [0, 0, 1])[k]
            said = [
                float(axis.findtext(path))
                for path in (
                    "limit/lower",
                    "limit/upper",
                    "dynamics/damping",
                    "dynamics/spring_reference",
                    "dynamics/spring_stiffness",
                )
            ]
            expected = [joint.lower, joint.upper, joint.damping, joint.rest, joint.stiffness]
            assert said == [float(values[k]) for values in expected]


def test_no_springs_without_a_modulus(result) -> None:
    axis = parsed(with_settings(result)).find("joint[@type='universal']/axis")
    assert axis.find("dynamics/spring_stiffness") is None
    assert float(axis.findtext("dynamics/damping")) > 0


def test_bodies(result) -> None:
    result = with_settings(result, {"density": 1000, "inner_radius": 0.005})
    for link, body in zip(parsed(result).findall("link"), multibody(result).bodies, strict=True):
        inertial = link.find("inertial")
        assert float(inertial.findtext("mass")) == pytest.approx(1000 * math.pi * (1e-4 - 2.5e-5) * body.length)
        assert float(inertial.findtext("inertia/ixx")) == body.axial_inertia
        assert float(inertial.findtext("inertia/iyy")) == float(inertial.findtext("inertia/izz"))
        assert pose(inertial)[:3, 3] == pytest.approx([body.length / 2, 0, 0])
        for kind, (begin, end, radius) in (("visual", (0, body.length, 0.01)), ("collision", body.collision)):
            cylinder = link.find(f"{kind}/geometry/cylinder")
            half = float(cylinder.findtext("length")) / 2
            ends = [(pose(link.find(kind)) @ [0, 0, sign * half, 1])[:3] for sign in (-1, 1)]
            assert np.array(ends) == pytest.approx(np.array([[begin, 0, 0], [end, 0, 0]]), abs=1e-12)
            assert float(cylinder.findtext("radius")) == radius


@pytest.mark.parametrize(
    ("stem", "name"), [("a::b", "a_b"), ("__x__", "x"), ("____", "model"), ("größe <1>", "größe <1>")]
)
def test_names_that_sdformat_keeps_for_itself(result, stem: str, name: str) -> None:
    assert parsed(result, stem).get("name") == name


@pytest.mark.oracle
def test_contact_in_drake(result) -> None:
    """Collision bodies of neighbours neither overlap nor touch, in the pose that Drake loads."""
    plants = pytest.importorskip("pydrake.multibody.plant")
    parsing = pytest.importorskip("pydrake.multibody.parsing")
    framework = pytest.importorskip("pydrake.systems.framework")
    builder = framework.DiagramBuilder()
    plant, scene = plants.AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    (content,) = write(result, "cable").values()
    parsing.Parser(plant).AddModelsFromString(content.decode(), "sdf")
    plant.Finalize()
    diagram = builder.Build()
    context = scene.GetMyContextFromRoot(diagram.CreateDefaultContext())
    query = scene.get_query_output_port().Eval(context)
    assert scene.model_inspector().num_geometries() > len(result.chain.lengths)
    assert not query.HasCollisions()
