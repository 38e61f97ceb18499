from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dlogen.evaluation.shapes import centre_line, hose_centre_line, random_centre_line
from dlogen.geometry.tube_mesh import tube_mesh

trimesh = pytest.importorskip("trimesh")

LINES = {
    "hose": (lambda make: make.fitted(hose_centre_line()), 0.02),
    "bent": (lambda make: make.exact(centre_line("bent")), 0.02),
    "helical": (lambda make: make.exact(centre_line("helical")), 0.02),
    "helix": (lambda make: make.helix(0.1, 0.03, 12.0), 0.02),
    "tight circle": (lambda make: make.circle(0.05, 3.0), 0.04),
    "straight": (lambda make: make.straight([1, 2, 3], [2, 2.5, 3.1]), 0.01),
    "upright": (lambda make: make.straight([0, 0, 0], [0, 0, -1]), 0.01),
    "short": (lambda make: make.straight([0, 0, 0], [0, 0.001, 0]), 0.01),
    "wire": (lambda make: make.fitted(random_centre_line(8)), 0.0005),
}


@pytest.fixture(scope="module")
def make(circle, helix, straight, fitted, exact_line):
    class Make:
        pass

    made = Make()
    made.circle, made.helix, made.straight, made.fitted, made.exact = circle, helix, straight, fitted, exact_line
    return made


def built(make, case: str, **options):
    line, radius = LINES[case][0](make), LINES[case][1]
    tube = tube_mesh(line, radius, **options)
    return line, radius, tube, trimesh.Trimesh(tube.vertices, tube.faces, process=False)


def to_line(line, points: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(K,) distances of points to the line, by searching along it around s = near."""
    out = []
    for point, s in zip(points, near, strict=True):
        low, high = max(s - 0.05, 0.0), min(s + 0.05, 1.0)
        fine = np.linspace(low, high, 400)
        distance = np.linalg.norm(line(fine) - point, axis=1)
        k = int(np.argmin(distance))
        bounds = (fine[max(k - 1, 0)], fine[min(k + 1, 399)])
        found = minimize_scalar(
            lambda u, point=point: float(np.linalg.norm(line(u) - point)),
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-9},
        )
        out.append(min(found.fun, distance[k]))
    return np.array(out)


@pytest.mark.parametrize("case", LINES)
def test_closed_and_facing_outward(make, case: str) -> None:
    line, radius, tube, mesh = built(make, case)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2  # a sphere's: no holes, no handles, one piece
    assert mesh.volume > 0
    assert len(tube.vertices) == len(tube.s) * tube.sides + 2
    # Each face looks away from the line, those of the ends along it.
    ring = np.minimum(tube.faces.min(axis=1) // tube.sides, len(tube.s) - 1)
    centre, normal = mesh.triangles_center, mesh.face_normals
    tangents = line(tube.s, 1) / np.linalg.norm(line(tube.s, 1), axis=1, keepdims=True)
    caps = tube.faces.max(axis=1) >= len(tube.s) * tube.sides
    first = caps & (tube.faces.max(axis=1) == len(tube.s) * tube.sides)
    assert normal[first] == pytest.approx(np.tile(-tangents[0], (tube.sides, 1)), abs=1e-9)
    assert normal[caps & ~first] == pytest.approx(np.tile(tangents[-1], (tube.sides, 1)), abs=1e-9)
    middle = 0.5 * (line(tube.s[ring[~caps]]) + line(tube.s[ring[~caps] + 1]))
    outward = np.einsum("ij,ij->i", centre[~caps] - middle, normal[~caps])
    assert outward.min() > 0.8 * radius


@pytest.mark.parametrize("case", LINES)
def test_volume_and_area(make, case: str) -> None:
    # Pappus: a circle swept along any line has the volume pi r^2 L and the side 2 pi r L.
    line, radius, _, mesh = built(make, case, tolerance=0.001)
    assert mesh.volume == pytest.approx(math.pi * radius**2 * line.length, rel=5e-3)
    area = 2 * math.pi * radius * line.length + 2 * math.pi * radius**2
    assert mesh.area == pytest.approx(area, rel=5e-3)


@pytest.mark.parametrize("case", LINES)
def test_vertices_lie_on_the_tube(make, case: str) -> None:
    line, radius, tube, _ = built(make, case)
    rings = tube.vertices[:-2].reshape(len(tube.s), tube.sides, 3)
    out = rings - line(tube.s)[:, None]
    assert np.linalg.norm(out, axis=2) == pytest.approx(np.full(out.shape[:2], radius), rel=1e-9)
    tangents = line(tube.s, 1) / np.linalg.norm(line(tube.s, 1), axis=1, keepdims=True)
    assert np.abs(np.einsum("ijk,ik->ij", out, tangents)).max() < 1e-9 * radius
    assert tube.vertices[-2:] == pytest.approx(line([0.0, 1.0]), abs=1e-15)
    # Even around the circle.
    turn = np.einsum("ijk,ijk->ij", out, np.roll(out, 1, axis=1)) / radius**2
    assert turn == pytest.approx(np.full(turn.shape, math.cos(2 * math.pi / tube.sides)), abs=1e-9)
    # And no other part of the line is nearer than its own.
    some = np.arange(0, len(tube.s), max(1, len(tube.s) // 6))
    near = to_line(line, rings[some, some % tube.sides], tube.s[some])
    assert near == pytest.approx(np.full(len(some), radius), rel=1e-5)


@pytest.mark.parametrize("case", ["hose", "helix", "tight circle"])
@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_the_mesh_is_within_the_tolerance(make, case: str, tolerance: float) -> None:
    line, radius, tube, mesh = built(make, case, tolerance=tolerance)
    inside = mesh.triangles_center[: len(mesh.faces) - 2 * tube.sides]
    ring = tube.faces[: len(inside)].min(axis=1) // tube.sides
    some = np.arange(0, len(inside), len(inside) // 60)
    distance = to_line(line, inside[some], 0.5 * (tube.s[ring[some]] + tube.s[ring[some] + 1]))
    assert np.abs(distance - radius).max() < 2.5 * tolerance * radius


def test_no_twist(make) -> None:
    # A circle in a plane: rotation-minimising frames keep the direction across the plane.
    _, radius, tube, _ = built(make, "tight circle")
    rings = tube.vertices[:-2].reshape(len(tube.s), tube.sides, 3)
    heights = rings[:, :, 2]
    assert heights == pytest.approx(np.tile(heights[0], (len(heights), 1)), abs=1e-12)
    assert np.ptp(heights[0]) == pytest.approx(2 * radius)


def test_a_tube_bent_tighter_than_its_radius_is_closed_all_the_same(circle) -> None:
    tube = tube_mesh(circle(0.01, 2.0), 0.02)
    mesh = trimesh.Trimesh(tube.vertices, tube.faces, process=False)
    assert mesh.is_watertight
    assert np.isfinite(tube.vertices).all()


def test_far_away_relative_vertices_keep_their_digits(fitted) -> None:
    line = fitted(random_centre_line(8))
    offset = np.array([5e6, -4e6, 300.0])
    far = type(line)(line.basis, line.weights, line.offset + offset, line.length)
    here, there = tube_mesh(line, 0.01), tube_mesh(far, 0.01, origin=offset)
    assert there.vertices == pytest.approx(here.vertices, abs=2e-9)
    assert np.array_equal(there.faces, here.faces)
