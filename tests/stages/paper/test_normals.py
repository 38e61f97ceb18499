from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.paper.normals import choose_neighbours, estimate_normals, orient_normals, outwardness

UPWARDS = (0.0, 0.0, -1.0)  # the direction of a viewer that looks down


def angles(normals, true) -> np.ndarray:
    """Between two sets of unit vectors whatever their signs, degrees."""
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(true)), abs=1e-12)
    return np.degrees(np.arccos(np.clip(np.abs(np.einsum("ij,ij->i", normals, true)), 0, 1)))


def right_side(normals, true) -> float:
    """Share of the normals that point outward."""
    return float(np.mean(np.einsum("ij,ij->i", normals, true) > 0))


def oriented(cloud, **options) -> float:
    normals = estimate_normals(cloud.points, neighbours=choose_neighbours(cloud.points, cloud.radius))
    # All signs are wrong to begin with, or every other: neither must show.
    normals[::2] *= -1
    return right_side(orient_normals(cloud.points, normals, cloud.radius, **options), cloud.normals)


def test_plane_fits_are_exact_on_a_plane() -> None:
    rng = np.random.default_rng(0)
    normal = np.array([1.0, 2.0, 2.0]) / 3
    u, v = np.array([2.0, 1.0, -2.0]) / 3, np.array([2.0, -2.0, 1.0]) / 3
    points = rng.random((200, 1)) * u + rng.random((200, 1)) * v
    for options in ({"neighbours": 8}, {"radius": 0.2}):
        assert angles(estimate_normals(points, **options), np.tile(normal, (200, 1))).max() < 1e-5


@pytest.mark.parametrize("by", ["neighbours", "radius"])
def test_normals_of_full_tubes(tube, by: str) -> None:
    options = {"neighbours": choose_neighbours(tube.points, tube.radius)}
    if by == "radius":
        options = {"radius": 0.7 * tube.radius}
    error = angles(estimate_normals(tube.points, **options), tube.normals)
    assert np.median(error) < 5.5
    assert np.percentile(error, 95) < 13


@pytest.mark.parametrize("by", ["neighbours", "radius"])
def test_normals_of_one_sided_tubes(half_tube, by: str) -> None:
    options = {"neighbours": choose_neighbours(half_tube.points, half_tube.radius)}
    if by == "radius":
        options = {"radius": 0.7 * half_tube.radius}
    error = angles(estimate_normals(half_tube.points, **options), half_tube.normals)
    assert np.median(error) < 5.5
    # Plane fits at the edges lean inwards: their neighbours are on one side only.
    assert np.percentile(error, 95) < 26


def test_normals_of_the_papers_curves(bent) -> None:
    error = angles(estimate_normals(bent.points, neighbours=choose_neighbours(bent.points, 0.02)), bent.normals)
    assert np.median(error) < 10.5


def test_normals_of_a_tight_bend(circle) -> None:
    # A ring of a tube bent to 3 r, where the surface curves in both directions, towards one another inside the bend.
    radius, bend = 0.01, 0.03
    rng = np.random.default_rng(0)
    u, v = rng.uniform(0, 2 * np.pi, (2, 4000))
    out = np.stack([np.cos(u), np.sin(u), np.zeros_like(u)], axis=1)
    normals = np.cos(v)[:, None] * out + np.sin(v)[:, None] * np.array([0, 0, 1.0])
    points = bend * out + radius * normals
    estimated = estimate_normals(points, neighbours=choose_neighbours(points, radius))
    assert np.median(angles(estimated, normals)) < 5
    assert right_side(orient_normals(points, estimated, radius), normals) > 0.995


def test_more_points_and_less_noise_are_better() -> None:
    line = random_centre_line(5, clearance=0.08)

    def error(count: int, noise: float = 0.0) -> float:
        cloud = sample_tube(line, 0.015, count, 5, noise=noise)
        normals = estimate_normals(cloud.points, neighbours=choose_neighbours(cloud.points, 0.015))
        return float(np.median(angles(normals, cloud.normals)))

    clean = error(5000)
    assert error(12_000) < 0.75 * clean
    assert error(1000) > clean
    assert clean < error(5000, 0.001) < 10


def test_neighbour_counts_follow_the_density() -> None:
    line = centre_line("straight")

    def count(points: int, radius: float) -> int:
        return choose_neighbours(sample_tube(line, radius, points, 0).points, radius)

    # 5,000 points on a tube of L = 1.044 m: M / (2 pi r L) pi (0.7 r)^2 = 0.245 M r / L points on the patch.
    for radius in (0.01, 0.02, 0.04):
        assert count(5000, radius) == pytest.approx(0.245 * 5000 * radius / line.length, rel=0.15)
    assert count(500, 0.005) == 6
    assert count(50_000, 0.02) == 60


def test_neighbours_do_not_depend_on_the_units() -> None:
    cloud = sample_tube(centre_line("straight"), 0.02, 2000, 0)
    assert choose_neighbours(cloud.points, 0.02) == choose_neighbours(1000 * cloud.points, 20.0)
    a = estimate_normals(cloud.points, neighbours=12)
    b = estimate_normals(1000 * cloud.points, neighbours=12)
    assert angles(a, b).max() < 1e-4


def test_the_two_kinds_of_neighbourhoods_agree_where_they_are_the_same() -> None:
    rng = np.random.default_rng(1)
    points = rng.random((50, 3))
    everything = {"neighbours": 50}, {"radius": 2.0}
    a, b = (estimate_normals(points, **options) for options in everything)
    assert angles(a, b).max() < 1e-5
    # All neighbourhoods are the whole cloud: the normals are those of one plane fit.
    centred = points - points.mean(axis=0)
    assert angles(a, np.tile(np.linalg.svd(centred)[2][2], (50, 1))).max() < 1e-5


def test_lonely_points_use_their_three_nearest() -> None:
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = estimate_normals(corner, radius=0.1)
    assert angles(normals, np.tile([0, 0, 1.0], (3, 1))).max() < 1e-5


def test_blocks_do_not_show(tube, monkeypatch) -> None:
    whole_k = estimate_normals(tube.points, neighbours=14)
    whole_r = estimate_normals(tube.points, radius=0.01)
    monkeypatch.setattr("dlogen.stages.paper.normals._BLOCK", 1000)
    assert np.array_equal(estimate_normals(tube.points, neighbours=14), whole_k)
    assert angles(estimate_normals(tube.points, radius=0.01), whole_r).max() < 1e-4


@pytest.mark.parametrize("options", [{}, {"neighbours": 5, "radius": 1.0}])
def test_one_kind_of_neighbourhood_has_to_be_given(options) -> None:
    with pytest.raises(ValueError, match="either neighbours or radius"):
        estimate_normals(np.zeros((10, 3)), **options)


def test_outwardness_of_true_normals(tube, half_tube) -> None:
    full = outwardness(tube.points, tube.normals, tube.radius)
    # Two radii do not reach the far side: the centroid is a third of a radius off the axis.
    assert np.median(full) == pytest.approx(0.7, abs=0.05)
    assert full.min() > 0.4
    half = outwardness(half_tube.points, half_tube.normals, half_tube.radius)
    assert half.min() > 0.2
    assert np.median(half[half_tube.normals[:, 2] > 0.99]) == pytest.approx(1 - 2 / np.pi, abs=0.05)
    assert np.median(half[half_tube.normals[:, 2] < 0.05]) == pytest.approx(0.7, abs=0.05)
    assert outwardness(tube.points, -tube.normals, tube.radius) == pytest.approx(-full)


@pytest.mark.parametrize("name", ["bent", "straight", "helical"])
def test_orientation_on_the_papers_curves(name: str) -> None:
    assert oriented(sample_tube(centre_line(name), 0.02, 5000, 2)) > 0.995


@pytest.mark.parametrize(
    "viewpoint", [None, (0, 0, 0), (0.02, -0.01, 0.03), (0, 0, 5), (0, 0, 1e6)], ids=lambda v: f"viewpoint={v}"
)
def test_no_viewpoint_spoils_a_full_tube(tube, viewpoint) -> None:
    # Far away, in the midst of the cloud, or the all-zero one of files that know none.
    viewpoint = None if viewpoint is None else np.array(viewpoint, dtype=float)
    assert oriented(tube, viewpoint=viewpoint) > 0.995
    on_the_axis = tube.truth.points(3)[1]
    assert oriented(tube, viewpoint=on_the_axis) > 0.995
    on_a_point = tube.points[17]
    assert oriented(tube, viewpoint=on_a_point) > 0.995


@pytest.mark.parametrize("count", [1000, 5000, 12_000])
def test_orientation_for_densities(count: int) -> None:
    line = random_centre_line(0, clearance=0.08)
    assert oriented(sample_tube(line, 0.015, count, 0)) > 0.995
    assert oriented(sample_tube(line, 0.015, count, 0, density_ratio=10)) > 0.98


def test_orientation_of_one_sided_tubes(half_tube) -> None:
    above = np.array([0, 0, 1e4])
    assert oriented(half_tube) > 0.995
    assert oriented(half_tube, method="outward", viewpoint=-above) > 0.995
    for viewpoint in (above, np.array([0, 0, 2.0]), np.zeros(3), -above):
        assert oriented(half_tube, viewpoint=viewpoint) > 0.995
    assert oriented(half_tube, viewpoint=above, method="viewpoint") > 0.995
    # Told to believe a wrong viewpoint, it does.
    assert oriented(half_tube, viewpoint=-above, method="viewpoint") < 0.005


def test_a_viewpoint_helps_with_noise_and_may_be_45_degrees_off() -> None:
    line = random_centre_line(0, dimensions=2, clearance=0.08)
    noisy = sample_tube(line, 0.015, 5000, 0, side=UPWARDS, noise=0.003)
    by_shape = oriented(noisy)
    true = oriented(noisy, viewpoint=np.array([0, 0, 1e4]))
    assert by_shape < 0.95  # what there is to gain
    assert true > 0.99
    clean = sample_tube(line, 0.015, 5000, 0, side=UPWARDS)
    for direction in np.radians(np.arange(0, 360, 60)):
        off = 1e4 * np.array([np.cos(direction), np.sin(direction), 1.0])
        assert oriented(clean, viewpoint=off) > 0.995


def test_more_than_half_of_a_tube_with_a_viewpoint() -> None:
    # Two cameras saw 200 degrees together and the file names one of them: the normals that face away from it are right.
    line = random_centre_line(1, dimensions=2, clearance=0.08)
    full = sample_tube(line, 0.015, 10_000, 1)
    seen = full.normals[:, 2] > np.cos(np.radians(100))
    points, true = full.points[seen], full.normals[seen]
    normals = orient_normals(points, true, 0.015, viewpoint=np.array([0, 0, 1e4]))
    assert right_side(normals, true) > 0.999


def test_orientation_does_not_depend_on_the_signs_given(tube) -> None:
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], (len(tube.points), 1))
    for normals in (tube.normals, -tube.normals, signs * tube.normals):
        assert right_side(orient_normals(tube.points, normals, tube.radius), tube.normals) == 1.0
    flipped = orient_normals(tube.points, -tube.normals, tube.radius)
    assert flipped == pytest.approx(tube.normals)


def test_normals_follow_a_permutation(half_tube) -> None:
    order = np.random.default_rng(4).permutation(len(half_tube.points))
    for options in ({"neighbours": 14}, {"radius": 0.01}):

        def made(points, options=options):
            normals = estimate_normals(points, **options)
            return orient_normals(points, normals, half_tube.radius, viewpoint=np.array([0.3, 0, 2.0]))

        straight, permuted = made(half_tube.points), made(half_tube.points[order])
        same = np.einsum("ij,ij->i", permuted, straight[order])
        assert same.min() > 1 - 1e-9


def test_normals_turn_with_the_cloud(half_tube) -> None:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    viewpoint, shift = np.array([0.3, 0, 2.0]), np.array([1.0, -2.0, 0.5])

    def made(points, viewpoint):
        normals = estimate_normals(points, neighbours=20)
        return orient_normals(points, normals, half_tube.radius, viewpoint=viewpoint)

    here = made(half_tube.points, viewpoint)
    there = made(half_tube.points @ rotation.T + shift, rotation @ viewpoint + shift)
    # Cells of the centroids are those of a fixed grid: the sides are the same, not the last bit.
    assert np.einsum("ij,ij->i", there, here @ rotation.T).min() > 1 - 1e-6


def test_what_cannot_be_done_is_refused(tube) -> None:
    with pytest.raises(ValueError, match="no viewpoint"):
        orient_normals(tube.points, tube.normals, tube.radius, method="viewpoint")
    with pytest.raises(ValueError, match="unknown method"):
        orient_normals(tube.points, tube.normals, tube.radius, method="inward")
