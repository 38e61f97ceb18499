"""The tube as GLB, OBJ and PLY, read back by trimesh."""

from __future__ import annotations

import math

import numpy as np
import pytest
from read_meshes import FAR, load

from dlogen.evaluation.shapes import random_centre_line
from dlogen.geometry.tube_mesh import tube_mesh

TUBES = {"glb": 1e-7, "obj": 1e-9, "ply-mesh": 0.0}


@pytest.fixture(scope="module")
def result(fitted, make_result):
    return make_result(fitted(random_centre_line(8)), 0.02, 0.01)


@pytest.fixture(scope="module")
def far_result(fitted, make_result):
    line = fitted(random_centre_line(8))
    return make_result(type(line)(line.basis, line.weights, line.offset + FAR, line.length), 0.02, 0.01)


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
