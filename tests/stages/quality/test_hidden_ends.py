"""Ends that may not be those of the object: along the view, behind another strand, at the border of the image."""

from __future__ import annotations

import numpy as np
import pytest

import dlogen
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.vectors import unit
from dlogen.stages.quality.hidden_ends import ends_not_seen
from dlogen.stages.refined.refine import refine
from dlogen.types import Array, Finding, Skeleton

RADIUS, FAR = 0.006, 100.0
DOWN = np.array([0.0, 0.0, -1.0])


def seen(line: CentreLine, view: Array, seed: int = 0, count: int = 12_000) -> Array:
    """Points of a tube as a far viewer's pixels are: as dense in the view, and none on what is hidden."""
    rng = np.random.default_rng(seed)
    cloud = sample_tube(line, RADIUS, count, rng, noise=0.0002, side=view)
    return np.asarray(cloud.points[-cloud.normals @ view > rng.random(count)])


def without_hidden(points: Array, line: CentreLine, view: Array) -> Array:
    """The points before which there is no other part of the tube."""
    across = np.linalg.svd(view[None])[2][1:]
    axis = line.points(1500)
    near = np.linalg.norm((points @ across.T)[:, None] - (axis @ across.T)[None], axis=2) < RADIUS
    nearer = (axis @ view)[None] < (points @ view)[:, None] - 1.5 * RADIUS
    return points[~(near & nearer).any(axis=1)]


def line_of(points: Array, backbone: Array) -> tuple[Skeleton, Array]:
    fitted = refine(points, backbone, RADIUS, fixed_radius=True)
    return fitted.skeleton, fitted.inliers


def about(points: Array, backbone: Array, viewpoint: Array | None = None) -> list[Finding]:
    skeleton, inliers = line_of(points, backbone)
    return ends_not_seen(points, inliers, skeleton, RADIUS, viewpoint)


def turning_down(angle: float) -> CentreLine:
    """Around a quarter of a circle on a table, then around a bend, and on for 0.15 m, so many degrees downwards."""
    round_about = np.linspace(0.0, 0.5 * np.pi, 30)[:-1]
    table = np.stack([0.3 * np.sin(round_about), -0.3 * np.cos(round_about), 0.0 * round_about], axis=1)
    turn = np.radians(angle) * np.linspace(0.0, 1.0, 20)
    bend = np.stack([0.3 + 0.0 * turn, 0.06 * np.sin(turn), -0.06 * (1.0 - np.cos(turn))], axis=1)
    ahead = np.array([0.0, np.cos(turn[-1]), -np.sin(turn[-1])])
    return from_points(np.concatenate([table, bend, bend[-1] + np.linspace(0.01, 0.15, 12)[:, None] * ahead]))


class TestAlongTheView:
    @pytest.mark.parametrize("viewpoint", [None, -FAR * DOWN])
    @pytest.mark.parametrize("seed", range(2))
    def test_an_end_that_turns_away_is_named(self, seed: int, viewpoint: Array | None) -> None:
        line = turning_down(80.0)
        (found,) = about(seen(line, DOWN, seed), line.points(80), viewpoint)
        assert (found.code, found.severity, found.s) == ("end-not-seen", "doubtful", 1.0)
        assert "the last end runs along the view" in found.message and "lower bound" in found.message

    @pytest.mark.parametrize("angle", [5.0, 40.0])
    def test_ends_that_face_the_viewer_are_seen(self, angle: float) -> None:
        line = turning_down(angle)
        assert about(seen(line, DOWN), line.points(80)) == []

    def test_nothing_is_said_of_what_was_seen_from_all_sides(self) -> None:
        line = turning_down(80.0)
        points = sample_tube(line, RADIUS, 6000, 1).points
        # Fewer points on the last stretch, as there would be in a view from above.
        points = points[(points[:, 2] > -0.05) | (np.random.default_rng(1).random(len(points)) < 0.15)]
        for viewpoint in (None, -FAR * DOWN):
            assert about(points, line.points(80), viewpoint) == []


class TestBehindAStrand:
    def coming_back(self, height: float, beyond: float) -> CentreLine:
        """A loop whose last part passes over its first one at x = 0, or ends `beyond` there, at another height."""
        angle = np.linspace(0.0, 1.5 * np.pi, 60)
        loop = np.stack([0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle), height * angle / angle[-1]], axis=1)
        first = np.linspace([-0.2, 0.0, 0.0], [-0.005, 0.0, 0.0], 30)
        start = np.linspace([loop[-1, 0], 0.095, height], [loop[-1, 0], beyond, height], 20)
        return from_points(np.concatenate([first, loop, start]))

    @pytest.mark.parametrize("seed", range(2))
    def test_an_end_below_another_strand_may_go_on_there(self, seed: int) -> None:
        # The last part comes from behind to below the first one, and is hidden there: it ends 4 mm beyond its axis.
        line = self.coming_back(-0.03, -0.002)
        points = without_hidden(seen(line, DOWN, seed), line, DOWN)
        backbone = line.points(200)
        visible = backbone[:-3]
        for viewpoint in (None, -FAR * DOWN):
            (found,) = about(points, visible, viewpoint)
            assert (found.severity, found.s) == ("doubtful", 1.0)
            assert "is behind another strand" in found.message

    def test_one_that_ends_on_top_of_it_or_well_before_is_seen(self) -> None:
        for height, beyond in ((0.03, -0.002), (-0.03, 0.04)):
            line = self.coming_back(height, beyond)
            points = without_hidden(seen(line, DOWN), line, DOWN)
            assert about(points, line.points(200)) == [], (height, beyond)


class TestBorder:
    def pixels(self, angle: float, border: float, pitch: float = 1e-3) -> tuple[Array, CentreLine]:
        """Pixels of a camera at the origin that see a straight tube half a metre away, up to a column of its image."""
        ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
        line = from_points(np.array([-0.2, 0.0, 0.2])[:, None] * ahead + [0.0, 0.0, 0.5])
        column, row = np.meshgrid(np.arange(-500, 500), np.arange(-500, 500))
        rays = np.stack([column.ravel() * pitch, row.ravel() * pitch, np.ones(column.size)], axis=1)
        # Where each ray meets the cylinder: a quadratic in the depth.
        start, across = np.array([0.0, 0.0, 0.5]), rays - (rays @ ahead)[:, None] * ahead
        a, b = (across**2).sum(axis=1), -2.0 * across @ start
        root = b**2 - 4.0 * a * (start @ start - RADIUS**2)
        depth = np.where(root > 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / (2.0 * a), np.nan)
        points = rays * depth[:, None]
        kept = (np.abs((points - start) @ ahead) < 0.2) & (rays[:, 0] <= border * pitch)
        points = points[kept]
        points[:, :] *= 1.0 + 0.0004 * np.random.default_rng(1).standard_normal((len(points), 1))
        return points, line

    def test_an_end_that_the_image_cuts_obliquely_is_named(self) -> None:
        points, line = self.pixels(np.radians(40.0), 200)
        backbone = line.points(100)
        backbone = backbone[backbone[:, 0] / backbone[:, 2] < 0.2]
        (found,) = about(points, backbone, np.zeros(3))
        assert (found.severity, found.s) == ("doubtful", 1.0) and "border of the image" in found.message
        # Without the camera's place nothing is known of its image.
        assert about(points, backbone) == []

    @pytest.mark.parametrize("degrees", [0.0, 5.0, 40.0])
    def test_square_ends_within_the_image_are_none(self, degrees: float) -> None:
        points, line = self.pixels(np.radians(degrees), 500)
        assert about(points, line.points(100), np.zeros(3)) == []


def test_a_fit_says_so_and_a_known_length_settles_it() -> None:
    line = turning_down(80.0)
    points = seen(line, DOWN)
    severities = {
        known: [item.severity for item in dlogen.fit(points, {"length": known}).quality.findings if _is_it(item)]
        for known in ("auto", line.length, 1.2 * line.length)
    }
    assert list(severities.values()) == [["doubtful"], ["note"], ["doubtful"]]


def test_few_points_say_nothing() -> None:
    line = turning_down(80.0)
    skeleton, _ = line_of(seen(line, DOWN), line.points(80))
    points = seen(line, DOWN)[:90]
    assert ends_not_seen(points, np.ones(90, dtype=bool), skeleton, RADIUS, None) == []


def test_the_view_is_found_from_the_points() -> None:
    # An end that runs along the view whatever that is.
    rng = np.random.default_rng(4)
    for _ in range(3):
        view = unit(rng.normal(size=3))
        turn = np.linalg.qr(np.column_stack([view, rng.normal(size=(3, 2))]))[0]
        basis = np.column_stack([turn[:, 1], turn[:, 2], -view])
        line = from_points(turning_down(80.0).points(200) @ basis.T)
        (found,) = about(seen(line, view), line.points(80))
        assert found.s == 1.0


def _is_it(item: Finding) -> bool:
    return item.code == "end-not-seen"
