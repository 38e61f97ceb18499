"""The refined fit against tubes with a known axis."""

import numpy as np
import pytest

from dlogen.errors import FitError
from dlogen.evaluation import shapes
from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.arc_length import arc_length_table, even_parameters
from dlogen.stages.refined.refine import refine

MM = 1e-3


def backbone(line, radius, seed, error=0.6, short=(1.5, -1.5)):
    """A rough backbone: smoothly wrong by `error` radii, ends that fall short (+) or go beyond (-) by radii."""
    rng = np.random.default_rng(seed)
    start, end = short[0] * radius / line.length, 1.0 - short[1] * radius / line.length
    s = np.linspace(start, end, int(line.length / (1.5 * radius)) + 2)
    inside = np.clip(s, 0.0, 1.0)
    points = line(inside) + line.tangents(inside) * ((s - inside) * line.length)[:, None]
    wave = np.zeros_like(points)
    for length in (8.0, 15.0, 40.0):
        phase = rng.uniform(0.0, 2.0 * np.pi, 3)
        wave += rng.normal(size=3) * np.sin(2.0 * np.pi * s[:, None] * line.length / (length * radius) + phase)
    return points + wave * error * radius / np.linalg.norm(wave, axis=1).max()


def fit(cloud, seed=0, guess=1.1, **options):
    return refine(cloud.points, backbone(cloud.truth, cloud.radius, seed), guess * cloud.radius, **options)


def errors(out, line):
    """Mean and largest distance to the axis (beyond its ends: to the axis going on straight), relative length."""
    points = out.skeleton(even_parameters(out.skeleton, 1000))
    s, distance = line.nearest(points)
    for end, beyond in ((0.0, s <= 0.0), (1.0, s >= 1.0)):
        offset = points[beyond] - line([end])
        tangent = line.tangents([end])[0]
        distance[beyond] = np.linalg.norm(offset - np.outer(offset @ tangent, tangent), axis=1)
    return distance.mean(), distance.max(), abs(out.skeleton.length / line.length - 1.0)


def random_line(seed, bend=0.1, **options):
    return shapes.random_centre_line(seed, min_bend_radius=bend, **({"clearance": min(bend, 0.06)} | options))


@pytest.fixture(scope="module")
def noisy():
    return sample_tube(random_line(1), 12 * MM, 5000, 1, noise=1 * MM)


@pytest.fixture(scope="module")
def noisy_fit(noisy):
    return fit(noisy)


CASES = {
    # name: line, radius, points, options, and the largest mean, maximum (mm) and relative length error
    "bent": (shapes.centre_line("bent"), 20, 5000, {}, (0.01, 0.1, 1e-3)),
    "straight": (shapes.centre_line("straight"), 20, 5000, {}, (0.01, 0.1, 1e-3)),
    "helical": (shapes.centre_line("helical"), 20, 5000, {}, (0.01, 0.1, 1e-3)),
    "noise": (random_line(2), 12, 5000, {"noise": 1 * MM}, (0.18, 0.8, 2e-3)),
    "one side": (random_line(3), 15, 5000, {"noise": 1 * MM, "side": (0.3, 0.2, -1.0)}, (0.4, 2.0, 5e-3)),
    "plane": (
        random_line(4, dimensions=2, clearance=0.09),
        20,
        5000,
        {"noise": 2 * MM, "side": (0, 0, -1)},
        (0.6, 3.0, 5e-3),
    ),
    "strays": (random_line(5), 12, 5000, {"noise": 0.5 * MM, "stray_fraction": 0.1}, (0.1, 0.6, 3e-3)),
    "gaps": (random_line(6), 12, 5000, {"noise": 0.5 * MM, "gaps": [(0.3, 0.34), (0.62, 0.66)]}, (0.15, 1.5, 2e-3)),
    "uneven": (random_line(7), 12, 5000, {"noise": 0.5 * MM, "density_ratio": 10.0}, (0.1, 0.8, 5e-3)),
    "crossing": (shapes.loop_centre_line(1.4, 60 * MM), 12, 5000, {"noise": 0.5 * MM}, (0.1, 0.8, 2e-3)),
    "touching": (shapes.loop_centre_line(1.4, 25.2 * MM), 12, 5000, {"noise": 0.5 * MM}, (0.1, 0.8, 2e-3)),
    "coil": (shapes.coil_centre_line(1.4, 25.2 * MM), 12, 5000, {"noise": 0.5 * MM}, (0.1, 0.8, 2e-3)),
    "wire": (random_line(8, clearance=0.05), 1.5, 5000, {"noise": 0.5 * MM}, (0.1, 0.6, 3e-3)),
    "few points": (random_line(9), 12, 300, {"noise": 0.5 * MM}, (0.35, 1.8, 1e-2)),
    "tight": (random_line(10, bend=0.036), 12, 5000, {"noise": 0.5 * MM}, (0.2, 1.0, 3e-3)),
    "caps": (random_line(11), 12, 5000, {"noise": 0.5 * MM, "caps": True}, (0.1, 0.8, 3e-3)),
    "many points": (random_line(12), 12, 60_000, {"noise": 1 * MM}, (0.06, 0.3, 1e-3)),
}


@pytest.mark.parametrize("name", CASES)
def test_axis_length_and_radius(name):
    line, radius, count, options, (mean, largest, length) = CASES[name]
    cloud = sample_tube(line, radius * MM, count, 7, **options)
    out = fit(cloud)
    found = errors(out, line)
    assert found[0] < mean * MM
    assert found[1] < largest * MM
    assert found[2] < length
    assert out.radius == pytest.approx(cloud.radius, rel=0.04 if "side" in options else 0.01)
    assert out.radius_identifiable
    assert out.used == count
    # Strays are told from the tube's points, but for those that happen to lie on it.
    assert np.mean(out.inliers[~cloud.is_stray]) > 0.95
    if cloud.is_stray.any():
        assert np.mean(out.inliers[cloud.is_stray]) < 0.1
    # Coordinates run along the object, from the first end of the backbone.
    on = out.inliers & ~cloud.is_stray
    assert np.mean(np.abs(out.s[on] - cloud.s[on]) < 0.02) > 0.99


@pytest.mark.parametrize("noise, tolerance", [(0.0, 0.05), (1 * MM, 0.15)])
def test_largest_curvature(noise, tolerance):
    deviations = []
    for seed in (21, 22, 23):
        cloud = sample_tube(random_line(seed), 12 * MM, 5000, seed, noise=noise)
        out = fit(cloud, seed)
        deviations.append(out.max_curvature / cloud.truth.max_curvature() - 1.0)
        assert abs(deviations[-1]) < 4.0 * out.curvature_std / out.max_curvature + 0.02
    assert np.median(np.abs(deviations)) < tolerance


def test_parameter_is_arc_length(noisy_fit):
    s, length = arc_length_table(noisy_fit.skeleton)
    assert length[-1] == pytest.approx(noisy_fit.skeleton.length, rel=1e-6)
    assert np.abs(length / length[-1] - s).max() < 1e-4


def test_gaps_are_found_where_they_are(noisy_fit):
    cloud = sample_tube(random_line(6), 12 * MM, 5000, 8, noise=0.5 * MM, gaps=[(0.3, 0.34), (0.62, 0.66)])
    out = fit(cloud)
    assert np.allclose(out.gaps, [(0.3, 0.34), (0.62, 0.66)], atol=0.004)
    assert noisy_fit.gaps == ()
    assert noisy_fit.findings == ()


def test_order_of_the_points_does_not_matter(noisy, noisy_fit):
    order = np.random.default_rng(0).permutation(len(noisy.points))
    out = refine(noisy.points[order], backbone(noisy.truth, noisy.radius, 0), 1.1 * noisy.radius)
    assert np.allclose(out.skeleton.weights, noisy_fit.skeleton.weights, rtol=0, atol=1e-9)
    assert np.array_equal(out.inliers, noisy_fit.inliers[order])
    assert np.allclose(out.residuals, noisy_fit.residuals[order], rtol=0, atol=1e-9)


def test_backwards(noisy, noisy_fit):
    out = refine(noisy.points, backbone(noisy.truth, noisy.radius, 0)[::-1], 1.1 * noisy.radius)
    s = np.linspace(0.0, 1.0, 200)
    assert np.abs(out.skeleton(1.0 - s) - noisy_fit.skeleton(s)).max() < 0.05 * MM


@pytest.mark.parametrize("scale, shift", [(1.0, (5e6, -4e6, 100.0)), (1000.0, (0.0, 0.0, 0.0))])
def test_place_and_units_do_not_matter(noisy, noisy_fit, scale, shift):
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))

    def moved(points):
        return scale * points @ turn + shift

    start = backbone(noisy.truth, noisy.radius, 0)
    out = refine(moved(noisy.points), moved(start), scale * 1.1 * noisy.radius)
    s = np.linspace(0.0, 1.0, 200)
    # A subset that is chosen by coordinates differs, by less than matters.
    assert np.abs(out.skeleton(s) - moved(noisy_fit.skeleton(s))).max() < 0.05 * MM * scale
    assert out.radius == pytest.approx(scale * noisy_fit.radius, rel=1e-3)


def test_given_radius_is_kept(noisy):
    out = fit(noisy, guess=1.0, fixed_radius=True)
    assert out.radius == noisy.radius
    assert out.radius_std == 0.0
    assert out.radius_identifiable
    assert errors(out, noisy.truth)[0] < 0.18 * MM


@pytest.mark.parametrize("guess", [0.7, 1.35])
def test_wrong_guess_of_the_radius(noisy, noisy_fit, guess):
    out = fit(noisy, guess=guess)
    assert out.radius == pytest.approx(noisy_fit.radius, rel=1e-3)
    assert errors(out, noisy.truth)[0] < 0.18 * MM


def test_residuals_are_distances_to_the_surface(noisy_fit, noisy):
    assert noisy_fit.noise == pytest.approx(1 * MM, rel=0.05)
    # True normals: a sign or a radius that is wrong would show at once.
    outward = noisy.points - noisy.truth(noisy.s)
    along = np.einsum("ij,ij->i", outward, noisy.normals) - noisy.radius
    assert np.std(noisy_fit.residuals - along) < 0.3 * MM
    # E|p - f| = r + sigma^2 / (2 r)
    assert np.mean(noisy_fit.residuals[noisy_fit.inliers]) == pytest.approx(1.0 / 24.0 * MM, abs=0.06 * MM)


def test_noise_hides_the_radius():
    cloud = sample_tube(random_line(5, clearance=0.05), 1.5 * MM, 5000, 3, noise=1.2 * MM)
    out = fit(cloud, guess=1.0)
    assert not out.radius_identifiable
    assert out.radius == cloud.radius
    assert "radius-unknown" in [finding.code for finding in out.findings]
    assert errors(out, cloud.truth)[0] < 0.3 * MM


def test_ends_have_an_error_as_large_as_reported():
    off, std = [], []
    for seed in range(12):
        line = shapes.centre_line("straight")
        cloud = sample_tube(line, 20 * MM, 2000, seed, noise=0.5 * MM)
        out = refine(cloud.points, line.points(30), cloud.radius)
        ends = np.einsum("ij,ij->i", out.skeleton([0.0, 1.0]) - line([0.0, 1.0]), line.tangents([0.0, 1.0]))
        off += [-ends[0], ends[1]]
        std += out.end_std
    assert abs(np.mean(off)) < 3.0 * np.mean(std) / np.sqrt(len(off))
    assert 0.5 < np.sqrt(np.mean(np.square(off))) / np.mean(std) < 1.6


def _curl(angle, past):
    """A strand that turns back over itself at an angle (degrees), touching, and ends `past` radii behind its axis."""
    radius, bend = 10 * MM, 120 * MM
    turn = np.linspace(0.0, np.pi + np.radians(angle), 500)
    arc = bend * np.c_[np.sin(turn), 1.0 - np.cos(turn)]
    heading = np.array([np.cos(turn[-1]), np.sin(turn[-1])])
    tail = arc[-1] + np.linspace(0.0, past * radius - arc[-1, 1] / heading[1], 300)[1:, None] * heading
    flat = np.concatenate([np.c_[np.linspace(-0.4, 0.0, 200), np.zeros(200)], arc[1:], tail])
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(flat, axis=0), axis=1)))
    rise = np.clip((s - 0.4) / (s[-1] - 0.5), 0.0, 1.0)
    return from_points(np.c_[flat, 2.1 * radius * rise**2 * (3.0 - 2.0 * rise)][::5])


@pytest.mark.parametrize(
    ("angle", "past", "noise", "side", "seed"),
    [
        (90, 0, 1.0, None, 1),
        (90, -1, 1.0, None, 1),
        (45, 0, 1.0, None, 2),
        (45, -1, 0.5, [0.2, 0.1, -1.0], 1),
        (45, 0, 0.5, [0.2, 0.1, -1.0], 2),
        (15, 3, 0.0, None, 1),
    ],
)
def test_an_end_that_touches_another_strand_is_where_it_is(angle, past, noise, side, seed):
    line = _curl(angle, past)
    cloud = sample_tube(line, 10 * MM, 5000, seed, noise=noise * MM, side=side)
    out = fit(cloud, guess=1.0)
    ends, truth = out.skeleton([0.0, 1.0]), line([0.0, 1.0])
    assert np.linalg.norm(ends - truth, axis=1).max() < 0.1 * cloud.radius


def test_nothing_near_the_backbone(noisy):
    with pytest.raises(FitError, match="near the line"):
        refine(noisy.points, noisy.truth.points(50) + 10.0, noisy.radius)
    with pytest.raises(FitError, match="radius of 0 m"):
        refine(noisy.points, noisy.truth.points(50), 0.0)
