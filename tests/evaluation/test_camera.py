"""The simulated depth camera against the geometry of what it looks at, and the noise that its source states."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest

from dlogen.errors import UsageError
from dlogen.evaluation.camera import KINECT_V1, Camera, Capture, capture, hose_capture
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import centre_line, hose_centre_line, loop_centre_line

#: The Kinect's optics without its noise.
EXACT = Camera("exact", 640, 480, 585.0, 0.0, 0.0, 0.0, 0.5, 5.0)
RADIUS = 0.02


def bar(*points: tuple[float, float, float]) -> CentreLine:
    return from_points(points)


@pytest.fixture(scope="module")
def hose() -> Capture:
    return hose_capture(1)


@pytest.fixture(scope="module")
def exact_hose() -> Capture:
    return capture(hose_centre_line(), RADIUS, np.random.default_rng(0), EXACT)


def test_an_organised_cloud_whose_points_lie_on_their_pixels_rays(hose: Capture) -> None:
    scene = hose.scene
    assert (scene.width, scene.height, len(scene.points)) == (640, 480, 640 * 480)
    assert scene.viewpoint is not None
    np.testing.assert_array_equal(scene.viewpoint, [0, 0, 0, 1, 0, 0, 0])
    image = scene.points.reshape(480, 640, 3)
    seen = np.isfinite(image).all(axis=2)
    row, column = np.nonzero(seen)
    x, y, z = image[seen].T
    np.testing.assert_allclose(585 * x / z, column - 319.5, atol=1e-9)
    np.testing.assert_allclose(585 * y / z, row - 239.5, atol=1e-9)


def test_exact_points_are_on_the_tube_or_on_the_table(exact_hose: Capture) -> None:
    points, on_tube = exact_hose.scene.points, exact_hose.is_object
    assert np.isfinite(points).all()
    assert (points[~on_tube, 2] == 0.8).all()
    s, distance = exact_hose.line.nearest(points[on_tube])
    inner = (s > 0) & (s < 1)
    # The row of spheres is within 1e-3 radii of the tube.
    assert np.abs(distance[inner] - RADIUS).max() < 1e-3 * RADIUS
    # The tube rests on the table, whose depth is 0.8 m: its top is at 0.76 m.
    assert exact_hose.line.points(10)[:, 2] == pytest.approx(0.78)
    assert points[:, 2].min() == pytest.approx(0.76, abs=1e-4)


def test_only_surfaces_that_face_the_camera_are_seen(exact_hose: Capture) -> None:
    points = exact_hose.scene.points[exact_hose.is_object][::7]
    s, _ = exact_hose.line.nearest(points)
    normals = points - exact_hose.line(s)
    assert (np.einsum("ij,ij->i", normals, points) < 1e-3 * RADIUS).all()


def test_the_upper_strand_hides_the_lower_one() -> None:
    seen = capture(loop_centre_line(1.2, 0.06), RADIUS, np.random.default_rng(0), EXACT, 1.0)
    points = seen.scene.points[seen.is_object][::10]
    s, distance = seen.line.nearest(points)
    # On the outer side of a bend the spheres are farther apart.
    assert np.abs(distance - RADIUS)[(s > 0) & (s < 1)].max() < 2e-3 * RADIUS
    # No ray passes through the tube on its way.
    for share in (0.93, 0.96, 0.99):
        assert seen.line.nearest(share * points)[1].min() > 0.99 * RADIUS


def test_ends_are_flat_discs() -> None:
    line = bar((-0.3, -0.1, 0.0), (0.0, 0.0, 0.0), (0.25, 0.2, 0.0))
    seen = capture(line, RADIUS, np.random.default_rng(0), EXACT, 0.8)
    points = seen.scene.points[seen.is_object]
    for s_end, direction in ((0.0, -1.0), (1.0, 1.0)):
        outward = direction * seen.line.tangents([s_end])[0]
        beyond = (points - seen.line([s_end])) @ outward
        assert beyond.max() < 1e-9


def test_an_end_that_faces_the_camera_is_seen_as_a_disc() -> None:
    # It stands upright, leaning by 20 degrees: the camera looks down on its upper end.
    lean = np.radians(20.0)
    line = bar((0.0, 0.0, 0.0), (0.1 * np.sin(lean), 0.0, 0.1 * np.cos(lean)))
    seen = capture(line, RADIUS, np.random.default_rng(0), EXACT, 0.8)
    points = seen.scene.points[seen.is_object]
    end, outward = seen.line([1.0])[0], seen.line.tangents([1.0])[0]
    height, across = (points - end) @ outward, np.linalg.norm(np.cross(points - end, outward), axis=1)
    assert height.max() < 1e-9 and across.max() < RADIUS * 1.001
    on_disc = np.abs(height) < 1e-9
    # Nothing is seen inside the tube, as it would be if the disc were missing.
    assert (np.abs(across[~on_disc] - RADIUS) < 1e-3 * RADIUS).all()
    # Area of a pixel at depth z is (z / f)^2, of the disc seen at the cosine c it is c times its own.
    middle = end / np.linalg.norm(end)
    expected = np.pi * RADIUS**2 * abs(outward @ middle) / (end[2] / 585) ** 2
    assert on_disc.sum() == pytest.approx(expected, rel=0.05)


def test_another_strand_beyond_the_plane_of_an_end_is_still_seen() -> None:
    # A hook whose end points at its own shank, whose surface is 25 mm away.
    line = bar(
        (-0.2, 0, 0), (0.0, 0, 0), (0.15, 0.05, 0), (0.15, 0.15, 0), (0.05, 0.18, 0), (0.0, 0.12, 0), (0, 0.045, 0)
    )
    seen = capture(line, RADIUS, np.random.default_rng(0), EXACT, 0.8)
    points = seen.scene.points[seen.is_object]
    s, _ = seen.line.nearest(points)
    end = seen.line([1.0])[0]
    shank = points[(s < 0.5) & (np.linalg.norm(points[:, :2] - end[:2], axis=1) < 0.09)]
    top = shank[:, 2].min()
    assert top == pytest.approx(0.76, abs=5e-4)
    # Across the shank it is seen from side to side, less what perspective hides.
    assert np.ptp(shank[np.abs(shank[:, 0] - end[0]) < 2e-3][:, 1]) > 1.8 * RADIUS


def test_depth_steps_and_noise_are_those_of_the_source(hose: Capture) -> None:
    z = hose.background.points[:, 2]
    levels = np.unique(z)
    np.testing.assert_allclose(np.diff(levels), 2.85e-3 * levels[:-1] * levels[1:], rtol=1e-9)
    assert np.diff(levels) == pytest.approx([2.85e-3 * 0.64] * (len(levels) - 1), rel=0.03)
    assert z.std() == pytest.approx(1.425e-3 * 0.64, rel=0.05)
    assert z.mean() == pytest.approx(0.8, abs=1e-4)


@pytest.mark.parametrize("distance", [1.5, 3.0])
def test_noise_grows_with_the_square_of_the_distance(distance: float) -> None:
    seen = capture(hose_centre_line(), RADIUS, np.random.default_rng(2), distance=distance)
    z = seen.background.points[:, 2]
    # What rounding adds depends on where between two steps the depth lies.
    assert z.std() == pytest.approx(1.425e-3 * distance**2, rel=0.08)


def test_noisy_points_are_on_the_tube_or_on_the_table_within_the_noise(hose: Capture, exact_hose: Capture) -> None:
    np.testing.assert_array_equal(hose.is_object, exact_hose.is_object)
    seen = np.isfinite(hose.scene.points[:, 2])
    error = (hose.scene.points[:, 2] - exact_hose.scene.points[:, 2])[seen]
    assert error.std() == pytest.approx(1.425e-3 * 0.64, rel=0.05)
    assert np.abs(error).max() < 5 * 1.425e-3 * 0.64
    assert abs(error.mean()) < 1e-4


def test_grazing_pixels_of_the_object_are_nan_and_no_others(hose: Capture, exact_hose: Capture) -> None:
    lost = ~np.isfinite(hose.scene.points).all(axis=1)
    assert 0.005 < lost[hose.is_object].mean() < 0.05
    assert not lost[~hose.is_object].any()
    points = exact_hose.scene.points[hose.is_object]
    s, _ = exact_hose.line.nearest(points)
    normals = points - exact_hose.line(s)
    cosine = -np.einsum("ij,ij->i", normals, points) / np.linalg.norm(normals, axis=1) / np.linalg.norm(points, axis=1)
    inner = (s > 0) & (s < 1)
    assert cosine[inner & lost[hose.is_object]].max() < KINECT_V1.grazing + 0.05
    assert cosine[inner & ~lost[hose.is_object]].min() > KINECT_V1.grazing - 0.05


def test_the_background_has_no_object_and_its_own_noise(hose: Capture) -> None:
    assert np.isfinite(hose.background.points).all()
    z = hose.background.points[:, 2]
    assert np.abs(z - 0.8).max() < 5 * 1.425e-3 * 0.64
    table = ~hose.is_object
    assert abs(np.corrcoef(z[table], hose.scene.points[table, 2])[0, 1]) < 0.02


def test_the_picture_is_not_mirrored() -> None:
    # From above: x to the right, y up. In the image x is to the right as well and y down.
    line = bar((-0.2, -0.1, 0.0), (0.2, -0.1, 0.0), (0.25, 0.0, 0.0), (0.25, 0.15, 0.0))
    seen = capture(line, RADIUS, np.random.default_rng(0), EXACT, 0.8)
    image = seen.is_object.reshape(480, 640)
    assert image[:200, 400:].any() and image[280:, 400:].any() and image[280:, :240].any()
    assert not image[:200, :240].any()


@pytest.mark.parametrize(
    ("line", "radius", "distance"),
    [
        (hose_centre_line(), 0.02, 0.6),
        (centre_line("straight"), 0.02, 0.8),
        (centre_line("helical"), 0.05, 0.9),
        (bar((0, 0, 0), (0.05, 0, 0)), 0.02, 0.2),
        (bar((0, 0, 0), (0.02, 0, 0.9)), 0.02, 0.8),
    ],
)
def test_what_does_not_fit_is_refused_with_a_distance_that_does(
    line: CentreLine, radius: float, distance: float
) -> None:
    with pytest.raises(UsageError, match="does not see the whole object") as caught:
        capture(line, radius, np.random.default_rng(0), EXACT, distance)
    found = re.search(r"distance of ([\d.]+) m", caught.value.hint or "")
    assert found
    enough = float(found.group(1))
    seen = capture(line, radius, np.random.default_rng(0), EXACT, enough)
    image = seen.is_object.reshape(480, 640)
    assert image.any()
    # Whole: nothing of it touches the border.
    assert not (image[0].any() or image[-1].any() or image[:, 0].any() or image[:, -1].any())


@pytest.mark.parametrize(
    ("line", "radius", "distance", "words"),
    [
        (centre_line("bent"), 0.2, 4.0, "too large"),
        (hose_centre_line(), 0.02, 6.0, "does not see the table"),
        (hose_centre_line(), 0.0005, 1.0, "thinner than a pixel"),
    ],
)
def test_other_bad_views(line: CentreLine, radius: float, distance: float, words: str) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        capture(line, radius, np.random.default_rng(0), KINECT_V1, distance)
    assert caught.value.hint


def test_seeds_reproduce_and_differ() -> None:
    line = bar((0, 0, 0), (0.2, 0, 0))
    first, again, other = (capture(line, RADIUS, np.random.default_rng(seed)).scene.points for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_rendering_is_fast() -> None:
    start = time.process_time()
    hose_capture(0)
    assert time.process_time() - start < 2.5
