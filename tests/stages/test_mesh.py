"""Meshes: their faces are sampled where their vertices do not cover the surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from swept_meshes import elbow

import dlogen
from dlogen.evaluation.synthetic import SyntheticCloud
from dlogen.stages.mesh import surface_points
from dlogen.types import Cloud, Mesh


def read(folder: Path, data: bytes) -> Cloud:
    (folder / "mesh.ply").write_bytes(data)
    return dlogen.read_cloud(folder / "mesh.ply")


@pytest.mark.parametrize(
    ("radius", "straight", "bend"), [(0.02, 0.5, 0.1), (0.005, 0.3, 0.05), (0.002, 0.4, 0.02), (0.05, 1.5, 0.25)]
)
@pytest.mark.parametrize("corners", [8, 12, 32])
def test_a_pipe_with_vertices_at_ends_and_bends_only(
    tmp_path: Path, radius: float, straight: float, bend: float, corners: int
) -> None:
    pipe = elbow(radius, straight, bend, corners)
    result = dlogen.fit(read(tmp_path, pipe.ply()))
    assert result.skeleton.length == pytest.approx(pipe.length, rel=2e-3)
    # The corners are on the surface, the faces are inside: of eight corners by 5 % on average.
    assert result.chain.radius == pytest.approx(radius, rel=5e-3)
    assert result.quality.verdict == "good"
    assert [finding.code for finding in result.quality.findings if finding.code != "noise"] == ["mesh-sampled"]


def test_closed_ends_and_few_rings(tmp_path: Path) -> None:
    pipe = elbow(0.02, 0.5, 0.1, caps=True, rings=3)
    result = dlogen.fit(read(tmp_path, pipe.ply()))
    assert result.skeleton.length == pytest.approx(pipe.length, rel=0.01)
    assert result.chain.radius == pytest.approx(pipe.radius, rel=0.03)


def test_a_given_radius_stays(tmp_path: Path) -> None:
    result = dlogen.fit(read(tmp_path, elbow(0.02, 0.5, 0.1, corners=8).ply()), {"r": 0.0195})
    assert result.chain.radius == 0.0195


@pytest.mark.parametrize("units", ["mm", "cm"])
def test_units_and_a_place_far_away(tmp_path: Path, units: str) -> None:
    scale = {"mm": 1000.0, "cm": 100.0}[units]
    pipe = elbow(0.02, 0.5, 0.1, corners=12)
    cloud = read(tmp_path, pipe.ply())
    assert cloud.mesh is not None
    place = np.array([4e5, 5e6, 100.0])
    large = Cloud(
        scale * (cloud.points + place), mesh=Mesh(scale * (cloud.mesh.vertices + place), cloud.mesh.triangles)
    )
    result = dlogen.fit(large, {"units": units})
    assert result.skeleton.length == pytest.approx(pipe.length, rel=2e-3)
    assert result.chain.radius == pytest.approx(pipe.radius, rel=5e-3)


def test_what_to_use_can_be_said(tmp_path: Path, tube: SyntheticCloud) -> None:
    sparse = read(tmp_path, elbow(0.02, 0.5, 0.1).ply())
    used, said = surface_points(sparse, "vertices")
    assert used.points is sparse.points and used.mesh is None and not said
    assert "mesh-sampled" not in [f.code for f in dlogen.fit(sparse, {"mesh": "vertices"}).quality.findings]
    plain = Cloud(tube.points)
    assert surface_points(plain, "sample") == (plain, [])


@pytest.mark.parametrize("sides", [24, 48])
def test_a_dense_mesh_stays_as_it_is(sides: int) -> None:
    x, around = np.linspace(0.0, 1.0, 300)[:, None], 2 * np.pi * np.arange(sides) / sides
    y = 0.1 * np.sin(5 * x) + 0.02 * np.cos(around)
    vertices = np.stack([x + 0 * y, y, 0 * x + 0.02 * np.sin(around)], axis=2).reshape(-1, 3)
    ring, place = np.divmod(np.arange(299 * sides), sides)
    a, b = ring * sides + place, ring * sides + (place + 1) % sides
    triangles = np.concatenate([np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)])
    cloud = Cloud(vertices, mesh=Mesh(vertices, triangles))
    used, said = surface_points(cloud)
    assert used.points is cloud.points and used.mesh is None and not said
    sampled, said = surface_points(cloud, "sample")
    assert len(sampled) >= 10_000 and len(said) == 1 and sampled.mesh is cloud.mesh


def test_damaged_faces_are_left_out() -> None:
    pipe = elbow(0.02, 0.5, 0.1)
    triangles = np.array([(a, b, c) for a, b, c, _ in pipe.polygons] + [(a, c, d) for a, _, c, d in pipe.polygons])
    vertices = np.vstack([pipe.vertices, [[np.nan] * 3, [1e30] * 3]])
    count = len(pipe.vertices)
    wrong = np.array([[0, 1, count], [0, 1, count + 1], [0, 1, count + 2], [0, 1, -1], [0, 0, 0]])
    clean = Cloud(pipe.vertices, mesh=Mesh(pipe.vertices, np.vstack([triangles, wrong[4:]])))
    odd = Cloud(np.vstack([pipe.vertices, [[1e30] * 3]]), mesh=Mesh(vertices, np.vstack([triangles, wrong])))
    assert np.array_equal(surface_points(odd)[0].points, surface_points(clean)[0].points)
    none = Cloud(pipe.vertices, mesh=Mesh(vertices, wrong))
    assert surface_points(none, "sample")[0].points is none.points


def test_the_same_points_every_time(tmp_path: Path) -> None:
    cloud = read(tmp_path, elbow(0.02, 0.5, 0.1).ply())
    assert np.array_equal(surface_points(cloud)[0].points, surface_points(cloud)[0].points)
