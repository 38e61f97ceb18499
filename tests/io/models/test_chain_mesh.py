"""The chain as a scene, read back by trimesh."""

from __future__ import annotations

import math

import numpy as np
import pytest
from read_meshes import FAR, load

from dlogen.evaluation.shapes import random_centre_line


@pytest.fixture(scope="module")
def result(fitted, make_result):
    return make_result(fitted(random_centre_line(8)), 0.02, 0.01)


@pytest.fixture(scope="module")
def far_result(fitted, make_result):
    line = fitted(random_centre_line(8))
    return make_result(type(line)(line.basis, line.weights, line.offset + FAR, line.length), 0.02, 0.01)


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
