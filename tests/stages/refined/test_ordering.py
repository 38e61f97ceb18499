"""Order of raw clouds against the truth: right order, near the axis, all of it; and what must not pass for a line."""

from __future__ import annotations

import numpy as np
import pytest
from places import DATA

from dlogen.errors import FitError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import centre_line, coil_centre_line, loop_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.quality.contacts import check_contacts, find_contacts
from dlogen.stages.refined.ordering import order

VIEW = [0.3, 0.2, -1.0]


def _line(seed, length=1.4, bend=0.1, dimensions=3):
    return random_centre_line(seed, length, bend, dimensions, clearance=min(0.06, bend))


def _crossing(angle: float, separation: float) -> CentreLine:
    """Two straight strands that cross at an angle (degrees), joined by an arc of radius 60 mm."""
    half, radius, count = np.radians(angle) / 2, 0.06, 60
    reach = radius / np.tan(half)
    there = np.linspace(-0.3, reach, count)[:, None] * [np.cos(half), np.sin(half)]
    centre = np.array([radius / np.sin(half), 0.0])
    start = np.arctan2(there[-1, 1], there[-1, 0] - centre[0])
    turn = np.linspace(start, -start, count)[1:-1]
    arc = centre + radius * np.c_[np.cos(turn), np.sin(turn)]
    flat = np.concatenate([there, arc, there[::-1] * [1.0, -1.0]])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flat, axis=0), axis=1))])
    even = np.linspace(0.0, s[-1], 150)
    height = separation * (np.clip((even - 0.3) / (s[-1] - 0.6), 0.0, 1.0) - 0.5)
    points = np.c_[np.interp(even, s, flat[:, 0]), np.interp(even, s, flat[:, 1]), height]
    for _ in range(6):
        points[1:-1] = 0.25 * (points[:-2] + 2.0 * points[1:-1] + points[2:])
    return from_points(points)


def _assert_right(found, cloud, off=0.7, covered=0.95):
    """Order of the vertices as on the true axis, no vertex far from it, (nearly) all of it covered."""
    dense = cloud.truth.points(8000)
    from scipy.spatial import cKDTree

    distance, index = cKDTree(dense).query(found.backbone)
    s = index / 7999.0
    steps = np.diff(s if s[0] < s[-1] else s[::-1])
    assert (steps > -0.3 * cloud.radius / cloud.truth.length).all()
    assert distance.max() < off * cloud.radius
    fine = np.concatenate([np.linspace(a, b, 12) for a, b in zip(found.backbone[:-1], found.backbone[1:], strict=True)])
    assert np.mean(cKDTree(fine).query(dense)[0] < cloud.radius) >= covered


def _codes(found, *severities):
    return [item.code for item in found.findings if item.severity in (severities or ("note", "doubtful", "bad"))]


@pytest.mark.parametrize("name", ["bent", "straight", "helical"])
def test_curves_of_the_paper(name):
    cloud = sample_tube(centre_line(name), 0.02, 5000, 21)
    found = order(cloud.points)
    _assert_right(found, cloud, off=0.2)
    assert found.findings == ()


@pytest.mark.parametrize(
    ("radius", "bend", "count", "options"),
    [
        (0.012, 0.1, 5000, {"noise": 0.001}),
        (0.015, 0.1, 5000, {"noise": 0.001, "side": VIEW}),
        (0.012, 0.1, 5000, {"noise": 0.0005, "density_ratio": 10.0}),
        (0.0015, 0.1, 5000, {"noise": 0.0005}),
        (0.012, 0.036, 5000, {"noise": 0.0005}),
        (0.05, 0.2, 5000, {"noise": 0.002}),
    ],
    ids=["noise", "one-sided", "uneven", "wire", "tight", "thick"],
)
@pytest.mark.parametrize("seed", [31, 32])
def test_good_clouds_raise_no_findings(radius, bend, count, options, seed):
    cloud = sample_tube(_line(seed, bend=bend), radius, count, seed, **options)
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert found.findings == ()


def test_few_points():
    cloud = sample_tube(_line(33), 0.012, 300, 33, noise=0.0005)
    _assert_right(order(cloud.points), cloud, off=1.5)


@pytest.mark.parametrize("side", [None, VIEW])
def test_strays_are_left_out_and_said(side):
    cloud = sample_tube(_line(34), 0.012, 5000, 34, noise=0.0005, stray_fraction=0.1, side=side)
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert _codes(found) == ["stray-points"]
    assert "%" in found.findings[0].message


@pytest.mark.parametrize("side", [None, VIEW])
def test_gaps_are_bridged_and_reported(side):
    gaps = [(0.3, 0.34), (0.66, 0.70)]
    cloud = sample_tube(_line(35), 0.012, 5000, 35, noise=0.0005, gaps=gaps, side=side)
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert _codes(found) == ["gap", "gap"]
    assert len(found.pieces) == 3
    for bridge, finding in zip(found.joins, found.findings, strict=True):
        assert bridge.kind == "gap"
        assert bridge.gap == pytest.approx(0.04 * 1.4, abs=0.02)
        s, _ = cloud.truth.nearest(np.array([finding.position]))
        assert min(abs(s[0] - 0.32), abs(s[0] - 0.68)) < 0.01
        assert (
            min(abs(finding.s - 0.32), abs(finding.s - 0.68)) < 0.02
            or min(abs(1 - finding.s - 0.32), abs(1 - finding.s - 0.68)) < 0.02
        )


def test_a_large_gap_is_doubtful():
    cloud = sample_tube(_line(36), 0.012, 5000, 36, noise=0.0005, gaps=[(0.4, 0.5)])
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert _codes(found, "doubtful") == ["gap"]


@pytest.mark.parametrize("separation", [0.0252, 0.06])
@pytest.mark.parametrize("side", [None, VIEW])
def test_loop_that_crosses_itself(separation, side):
    cloud = sample_tube(loop_centre_line(1.4, separation), 0.012, 5000, 37, noise=0.0005, side=side)
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert _codes(found, "doubtful", "bad") == []
    contacts = find_contacts(found.backbone, found.radius)
    assert len(contacts) == (1 if separation < 0.03 else 0)
    told = check_contacts(found.backbone, found.backbone, found.radius)
    assert [item.code for item in told] == ["crossing"] * len(contacts)
    for contact in contacts:
        np.testing.assert_allclose(contact.position, [0.0, cloud.truth.points(9)[:, 1].max() / 2, 0], atol=0.2)


@pytest.mark.parametrize("angle", [90, 50, 30, 20])
@pytest.mark.parametrize("side", [None, VIEW])
def test_touching_strands_at_any_angle(angle, side):
    cloud = sample_tube(_crossing(angle, 0.0252), 0.012, 5000, 38, noise=0.0005, side=side)
    found = order(cloud.points)
    _assert_right(found, cloud)
    assert "bad" not in {item.severity for item in found.findings}


def test_strands_that_run_side_by_side_are_not_called_good():
    cloud = sample_tube(coil_centre_line(1.4, 0.0252), 0.012, 5000, 39, noise=0.0005)
    for found in (order(cloud.points), order(cloud.points, 0.012)):
        contacts = check_contacts(found.backbone, found.backbone, found.radius)
        touching = {item.code for item in contacts if item.severity != "note"}
        assert _codes(found, "bad") or touching & {"side-by-side", "branch"}


class TestSameForEveryOrder:
    def test_permutation(self):
        cloud = sample_tube(_line(41), 0.012, 20000, 41, noise=0.001, stray_fraction=0.05, gaps=[(0.4, 0.45)])
        first = order(cloud.points)
        for seed in range(3):
            again = order(np.random.default_rng(seed).permutation(cloud.points))
            np.testing.assert_array_equal(first.backbone, again.backbone)
            assert first.findings == again.findings
            assert first.joins == again.joins

    def test_reflection_turns_no_chain_around(self):
        """The end with the smaller coordinate comes first, wherever the seed of the cloud is."""
        cloud = sample_tube(_line(42), 0.012, 3000, 42)
        backbone = order(cloud.points).backbone
        difference = backbone[-1] - backbone[0]
        assert difference[np.argmax(np.abs(difference))] > 0
        mirrored = order(-cloud.points).backbone
        difference = mirrored[-1] - mirrored[0]
        assert difference[np.argmax(np.abs(difference))] > 0

    def test_another_sample_gives_the_same_line(self):
        line = _line(43)
        one, two = (order(sample_tube(line, 0.012, 5000, seed, noise=0.0005).points).backbone for seed in (1, 2))
        assert np.linalg.norm(one[0] - two[0]) < 0.02
        assert np.linalg.norm(one[-1] - two[-1]) < 0.02

    def test_motion(self):
        """Far from the origin, and turned."""
        cloud = sample_tube(_line(44), 0.012, 4000, 44, noise=0.0005)
        rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
        rotation *= np.linalg.det(rotation)
        moved = order(cloud.points @ rotation.T + 5e6).backbone
        dense = cloud.truth.points(4000) @ rotation.T + 5e6
        from scipy.spatial import cKDTree

        assert cKDTree(dense).query(moved)[0].max() < 0.5 * cloud.radius

    def test_units(self):
        points = sample_tube(_line(45), 0.012, 4000, 45, noise=0.0005).points
        np.testing.assert_allclose(
            order(1000.0 * points).backbone, 1000.0 * order(points).backbone, rtol=0.01, atol=5.0
        )


def _branched(seed):
    rng = np.random.default_rng(seed)
    trunk = _line(seed, 1.2)
    s = rng.uniform(0.25, 0.75)
    arm = random_centre_line(seed + 100, rng.uniform(0.1, 0.4), 0.1)
    tangent, across = trunk.tangents([s])[0], rng.normal(size=3)
    across -= tangent * (across @ tangent)
    angle = np.radians(rng.uniform(30, 150))
    heading = np.cos(angle) * tangent + np.sin(angle) * across / np.linalg.norm(across)
    start = arm.tangents([0.0])[0]
    axis = np.cross(start, heading)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + cross + cross @ cross / (1 + start @ heading)
    arm = arm.moved(rotation, trunk([s])[0] - rotation @ arm([0.0])[0])
    return np.concatenate([sample_tube(trunk, 0.01, 4000, seed).points, sample_tube(arm, 0.01, 1200, seed).points])


def _ring(seed):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2 * np.pi, 300)
    radius = rng.uniform(0.08, 0.3) * (1 + 0.2 * np.cos(2 * t + rng.uniform(0, 6)))
    points = np.c_[radius * np.cos(t), radius * np.sin(t), 0.2 * radius * np.cos(3 * t)]
    return sample_tube(from_points(points), 0.01, 4000, seed, noise=0.0005).points


def _two(seed):
    one, two = (sample_tube(_line(seed + k, 0.6), 0.01, 2500, seed).points for k in (0, 50))
    return np.concatenate([one, two - two.mean(axis=0) + one.mean(axis=0) + [0.0, 0.0, 0.4]])


class TestNeverAConfidentWrongChain:
    @pytest.mark.parametrize("seed", range(5))
    def test_branch(self, seed):
        assert "branch" in _codes(order(_branched(seed)), "bad")

    @pytest.mark.parametrize("seed", range(5))
    def test_closed_ring(self, seed):
        assert "closed-ring" in _codes(order(_ring(seed)), "bad")

    def test_nearly_closed_ring_is_doubtful(self):
        t = np.linspace(0.0, 2 * np.pi * 0.95, 300)
        line = from_points(np.c_[0.2 * np.cos(t), 0.2 * np.sin(t), np.zeros(300)])
        assert _codes(order(sample_tube(line, 0.01, 4000, 1).points)) == ["closed-ring"]

    def test_ends_side_by_side_are_no_ring(self):
        turn = np.linspace(-np.pi / 2, np.pi / 2, 60)
        leg = np.linspace(0.0, 0.29, 59)
        bow = np.c_[0.3 + 0.035 / 2 * np.cos(turn), 0.035 / 2 * np.sin(turn)]
        flat = np.concatenate([np.c_[leg, np.full(59, bow[0, 1])], bow, np.c_[leg[::-1], np.full(59, bow[-1, 1])]])
        cloud = sample_tube(from_points(np.c_[flat, np.zeros(len(flat))]), 0.01, 20000, 1)
        assert "closed-ring" not in _codes(order(cloud.points, 0.01))

    @pytest.mark.parametrize("seed", range(5))
    def test_several_objects(self, seed):
        codes = _codes(order(_two(seed)), "bad")
        assert "several-objects" in codes or "branch" in codes

    def test_parallel_objects(self):
        points = sample_tube(centre_line("straight"), 0.02, 3000, 1).points
        assert _codes(order(np.concatenate([points, points + np.array([0.1, 0.0, 0.0])])), "bad")

    @pytest.mark.parametrize("seed", range(4))
    def test_plane_ball_and_box(self, seed):
        rng = np.random.default_rng(seed)
        plane = np.c_[rng.uniform(0, 1, 4000), rng.uniform(0, rng.uniform(0.2, 1), 4000), rng.normal(0, 0.002, 4000)]
        ball = rng.normal(size=(4000, 3))
        ball *= 0.1 / np.linalg.norm(ball, axis=1, keepdims=True)
        box = rng.uniform(-0.1, 0.1, size=(4000, 3))
        box[np.arange(4000), rng.integers(0, 3, 4000)] = 0.1
        for points in (plane, ball, ball[ball[:, 2] > 0], box):
            try:
                assert _codes(order(points), "bad")
            except FitError as error:
                assert error.hint

    @pytest.mark.parametrize("name", ["test_cloud.pcd", "test_cloud_occluded.pcd", "wireHarness.txt"])
    def test_harness(self, name):
        path = DATA / "harness" / name
        if not path.exists():
            pytest.skip("test data are not there")
        skip = 0
        if path.suffix == ".pcd":
            skip = 1 + next(i for i, text in enumerate(path.read_text().splitlines()) if text.startswith("DATA"))
        assert "branch" in _codes(order(np.loadtxt(path, skiprows=skip)[:, :3]), "bad")


def test_curled_rope():
    path = DATA / "harness" / "curledRope.txt"
    if not path.exists():
        pytest.skip("test data are not there")
    found = order(np.loadtxt(path))
    assert "too-few-points" in _codes(found)
    assert "gap" in _codes(found)
    # From the curl in the front (y = -0.13) along the table to the other side of the gap (y = 0.2).
    y = found.backbone[:, 1]
    assert len(y) >= 26
    assert y[0] < -0.12
    assert y[-1] > 0.19
    turn = int(np.argmin(y))
    assert (np.diff(y[: turn + 1]) < 0).all()
    # Only the last two steps bend back.
    assert (np.diff(y[turn:-2]) > 0).all()


def test_beads_on_a_string_in_any_order():
    t = np.linspace(0.0, 3.0, 40)
    beads = np.c_[t, np.sin(2 * t), 0.1 * t]
    found = order(np.random.default_rng(1).permutation(beads))
    np.testing.assert_array_equal(found.backbone, beads)
    assert _codes(found) == ["too-few-points"]


def test_given_radius_is_used():
    cloud = sample_tube(_line(46), 0.012, 4000, 46, noise=0.0005)
    found = order(cloud.points, 0.012)
    assert found.radius == 0.012
    _assert_right(found, cloud, off=0.2)


def test_a_radius_that_is_somewhat_wrong_does_no_harm():
    cloud = sample_tube(_line(47), 0.012, 4000, 47, noise=0.0005)
    for radius in (0.010, 0.0145):
        _assert_right(order(cloud.points, radius), cloud, off=0.5)


def test_backbone_is_about_evenly_spaced():
    cloud = sample_tube(_line(48), 0.012, 5000, 48, noise=0.0005, gaps=[(0.5, 0.55)])
    found = order(cloud.points)
    steps = np.linalg.norm(np.diff(found.backbone, axis=0), axis=1)
    assert (0.5 * found.radius < steps).all()
    assert (steps < 2.0 * found.radius).all()


def _coil(pitch, seed):
    angle = np.linspace(0.0, 10.0 * np.pi, 1200)
    turns = from_points(np.c_[0.06 * np.cos(angle), 0.06 * np.sin(angle), pitch * angle / (2.0 * np.pi)])
    return sample_tube(turns, 0.01, 6000, seed)


def test_close_turns_of_a_coil_with_a_given_radius():
    # Neighbourhoods in it are not longer than wide; that is no reason to refuse it where the radius is known.
    cloud = _coil(0.035, 5)
    found = order(cloud.points, 0.01)
    _assert_right(found, cloud, off=0.4)
    assert _codes(found, "bad", "doubtful") == []


def test_close_turns_without_a_radius_are_refused_with_a_hint():
    with pytest.raises(FitError, match="longer than wide") as refused:
        order(_coil(0.028, 5).points)
    assert "give r" in refused.value.hint


@pytest.mark.parametrize("length", [0.08, 0.12])
def test_short_branches_of_a_long_line(length):
    line = _line(8, 6.0, 0.2)
    cloud = sample_tube(line, 0.01, 24000, 8)
    root, tangent = line([0.4])[0], line.tangents([0.4])[0]
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    twig = from_points(root + np.linspace(0.0, length, 20)[:, None] * across)
    found = order(np.concatenate([cloud.points, sample_tube(twig, 0.01, int(4000 * length), 9).points]))
    assert "branch" in _codes(found, "bad")


def test_points_on_the_axis_have_no_radius():
    line = _line(3)
    with pytest.raises(FitError, match="no width"):
        order(line.points(1000))


def test_a_short_stub_is_no_line():
    cloud = sample_tube(from_points(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.08]])), 0.02, 3000, 1)
    try:
        assert "not-a-line" in _codes(order(cloud.points), "bad")
    except FitError as error:
        assert error.hint


def test_hundred_points():
    """Two points for each radius of length."""
    cloud = sample_tube(centre_line("straight"), 0.02, 100, 3)
    _assert_right(order(cloud.points), cloud, off=1.5, covered=0.9)
