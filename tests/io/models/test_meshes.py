"""The tube and the chain as meshes, read back by trimesh."""

from __future__ import annotations

import io
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from dlogen.evaluation.shapes import hose_centre_line, random_centre_line
from dlogen.geometry.tube_mesh import tube_mesh
from dlogen.io.registry import model_format

trimesh = pytest.importorskip("trimesh")

FAR = np.array([5e6, -4e6, 300.0])
TUBES = {"glb": 1e-7, "obj": 1e-9, "ply-mesh": 0.0}


@pytest.fixture(scope="module")
def result(fitted, make_result):
    return make_result(fitted(random_centre_line(8)), 0.02, 0.01)


@pytest.fixture(scope="module")
def far_result(fitted, make_result):
    line = fitted(random_centre_line(8))
    return make_result(type(line)(line.basis, line.weights, line.offset + FAR, line.length), 0.02, 0.01)


def written(name: str, result) -> bytes:
    (path, content), *others = model_format(name).write(result, "cable").items()
    assert not others
    assert (path,) == model_format(name).files("cable")
    return content


def load(name: str, result):
    suffix = model_format(name).suffixes[0].rpartition(".")[2]
    return trimesh.load(io.BytesIO(written(name, result)), file_type=suffix)


@pytest.mark.parametrize("name", TUBES)
@pytest.mark.parametrize("place", ["here", "far"])
def test_tube(name: str, place: str, request: pytest.FixtureRequest) -> None:
    result = request.getfixturevalue("result" if place == "here" else "far_result")
    mesh = load(name, result)
    if name == "glb":
        assert list(mesh.graph.nodes_geometry) == ["tube"]
        mesh = mesh.to_geometry()
    expected = tube_mesh(result.skeleton, result.chain.radius)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(mesh.faces) == len(expected.faces)
    # trimesh may sort the vertices in another way.
    order, expected_order = (np.lexsort(np.round(v, 6).T) for v in (mesh.vertices, expected.vertices))
    tolerance = TUBES[name] + (1e-9 if place == "far" else 0.0)
    assert mesh.vertices[order] == pytest.approx(expected.vertices[expected_order], rel=0, abs=tolerance)
    mesh.apply_translation(-result.chain.joints[0])  # far away the sums behind a volume lose their digits
    assert mesh.volume == pytest.approx(math.pi * 0.02**2 * result.skeleton.length, rel=0.01)


def test_glb_normals_point_outward(result) -> None:
    mesh = load("glb", result).geometry["tube"]
    assert "vertex_normals" in mesh._cache.cache  # from the file
    tube = tube_mesh(result.skeleton, result.chain.radius, origin=result.chain.joints[0])
    assert mesh.vertices == pytest.approx(tube.vertices, abs=1e-6)
    centres = np.repeat(result.skeleton(tube.s) - result.chain.joints[0], tube.sides, axis=0)
    out = (tube.vertices[:-2] - centres) / 0.02
    inner = slice(tube.sides, -tube.sides)
    assert np.einsum("ij,ij->i", mesh.vertex_normals[:-2], out)[inner].min() > 0.99


@pytest.mark.parametrize("place", ["here", "far"])
def test_chain_scene_has_the_transforms_of_the_chain(place: str, request: pytest.FixtureRequest) -> None:
    result = request.getfixturevalue("result" if place == "here" else "far_result")
    scene, chain = load("chain-glb", result), result.chain
    n = len(chain.lengths)
    segments = [f"segment_{i + 1:02d}" for i in range(n)]
    joints = [f"joint_{i:02d}" for i in range(n + 1)]
    assert set(scene.graph.nodes_geometry) == {*segments, *joints}
    for name, transform, length in zip(segments, chain.transforms, chain.lengths, strict=True):
        matrix, geometry = scene.graph[name]
        assert matrix == pytest.approx(transform, rel=0, abs=1e-12)
        mesh = scene.geometry[geometry]
        assert mesh.is_watertight
        half = [length / 2, 0.02, 0.02]  # x along the segment, the frame in its centre
        assert mesh.bounds == pytest.approx(np.array([np.negative(half), half]), abs=1e-6)
        assert mesh.volume == pytest.approx(math.pi * 0.02**2 * length, rel=0.01)
    for name, position in zip(joints, chain.joints, strict=True):
        matrix, geometry = scene.graph[name]
        assert matrix[:3, 3].tolist() == position.tolist()
        assert matrix[:3, :3].tolist() == np.eye(3).tolist()
        assert np.abs(scene.geometry[geometry].bounds) == pytest.approx(np.full((2, 3), 1.15 * 0.02), rel=1e-3)


def test_chain_scene_of_many_segments(straight, make_result) -> None:
    from dataclasses import replace

    from dlogen.stages.chain import build_chain
    from dlogen.stages.segmentation.joints import place_joints

    result = make_result(straight([0, 0, 0], [1, 0, 0]), 0.01)
    joints = place_joints(result.skeleton, 1 / 99.5)
    scene = load("chain-glb", replace(result, joints=joints, chain=build_chain(joints, 0.01)))
    names = sorted(name for name in scene.graph.nodes_geometry if name.startswith("segment"))
    assert (len(names), names[0], names[-1]) == (100, "segment_001", "segment_100")
    assert "joint_000" in scene.graph.nodes_geometry


def test_one_straight_segment(straight, make_result) -> None:
    result = make_result(straight([1, 2, 3], [1, 2, 4]), 0.01)
    assert load("glb", result).to_geometry().is_watertight
    assert set(load("chain-glb", result).graph.nodes_geometry) == {"segment_01", "joint_00", "joint_01"}


def test_the_same_bytes_in_every_process() -> None:
    # Sets of names inside trimesh are ordered by hashes, which differ from process to process.
    code = (
        "import sys, hashlib, dlogen; from dlogen.evaluation.synthetic import *;"
        "from dlogen.evaluation.shapes import centre_line;"
        "from dlogen.io.registry import model_format;"
        "import numpy as np;"
        "c = sample_tube(centre_line('straight'), 0.02, 2000, np.random.default_rng(0));"
        "r = dlogen.fit(c.points, {'r': 0.02});"
        "d = [w for n in ('glb', 'obj', 'ply-mesh', 'chain-glb') for w in model_format(n).write(r, 'x').values()];"
        "print(hashlib.sha256(b''.join(d)).hexdigest())"
    )
    found = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONHASHSEED": value},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for value in ("0", "4242")
    ]
    assert found[0] == found[1]


def test_pillow_is_not_needed(fitted, make_result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    result = make_result(fitted(hose_centre_line()), 0.02, 0.01)
    assert written("glb", result).startswith(b"glTF")
    assert written("chain-glb", result).startswith(b"glTF")
