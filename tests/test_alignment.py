"""Rows that belong together stay together, from the file to every output.

A point and its normal, a point and its coordinate, a joint and its segment, a frame and its error: they travel as rows
of arrays side by side. Nothing fails when one of these arrays is reversed, rolled by one or thinned out differently;
the numbers are all still there, beside the wrong ones. So what belongs together is found anew here, by the geometry of
an object that is known (`by_hand`), and compared with what stands side by side in the outputs.

Everything goes by the command line and the files, whatever the package looks like inside.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import by_hand
import numpy as np
import pytest
from by_command import run, run_apart
from by_hand import arc_lengths, at, columns, evenly, feet, read_csv, read_dump, same_rows, vectors
from odd_clouds import with_defects, write_pcd
from scipy.spatial.transform import Rotation

import dlogen
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import loop_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube

Array = np.ndarray

RADIUS = 0.015
#: Vertices of a known axis: on a cable of a metre the chords between them are off by less than 0.1 micrometres.
FINE = 4001


# From a cloud to what the stages made of it.


@contextlib.contextmanager
def most_points(count: int) -> Iterator[None]:
    """Clouds of more points than this are thinned out."""
    dlogen.fit  # noqa: B018 - loads the module that says how many are too many
    loaded = [module for name, module in sys.modules.items() if name.partition(".")[0] == "dlogen"]
    holders = [module for module in loaded if "MOST_POINTS" in vars(module)]
    assert holders
    with contextlib.ExitStack() as stack:
        for module in holders:
            stack.enter_context(mock.patch.object(module, "MOST_POINTS", count))
        yield


@dataclass(frozen=True)
class Scan:
    """A file of a known object, in millimetres and far from the origin, with rows that have to be left out.

    Attributes:
        path: of the file.
        points: (M, 3) the points that have to be left, metres.
        axis: (FINE, 3) of the object, even in arc length, metres.
        gap: where there are no points, as shares of the length.
    """

    path: Path
    points: Array
    axis: Array
    gap: tuple[float, float]


OFFSET = np.array([412.0, -73.0, 20.0])


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Scan:
    """Denser towards the end, with noise, strays and a gap: no row is like another, no end like the other.

    The stored normals point from the axis to their point; so do those of strays, and in no other row would they. Some
    points are so far away that the fit leaves them out.
    """
    path = tmp_path_factory.mktemp("scan") / "scan.pcd"
    line, gap = random_centre_line(3, clearance=0.08), (0.5, 0.53)
    tube = sample_tube(line, RADIUS, 3000, 3, noise=0.0006, stray_fraction=0.01, gaps=[gap], density_ratio=3.0)
    axis = line.points(FINE) + OFFSET
    points = np.round(tube.points + OFFSET, 8)
    rows = with_defects(points, feet(points, axis).outward, 4)
    before = np.array([0, 1, 700, 701, 702, 1999, 2500])
    far = np.arange(1, 8)[:, None] * np.array([1e12, 2e12, -3e12])
    place = np.insert(1e3 * rows.points, before, far, axis=0)
    normal = np.insert(rows.normals, before, [0.0, 0.0, 1.0], axis=0)
    write_pcd(path, place, normal, "binary", shape=(len(place), 1))
    return Scan(path, points, axis, gap)


@dataclass(frozen=True)
class Fitted:
    """The files of `dlogen fit`.

    Attributes:
        folder: that they are in.
        turn: (3, 3) from the cloud's frame to that of the output.
        shift: (3,) what is added then, metres.
        scan: that was fitted.
        options: that it was fitted with.
    """

    folder: Path
    turn: Array
    shift: Array
    scan: Scan
    options: tuple[str, ...]

    def there(self, points: Array) -> Array:
        """Points of the cloud in the frame of the output."""
        return points @ self.turn.T + self.shift

    def dump(self, name: str) -> dict[str, Array]:
        """What a stage made, by columns."""
        (path,) = self.folder.glob(f"scan.[0-9]_{name}.*")
        return read_dump(path) if path.suffix == ".ply" else columns(path)

    @cached_property
    def chain(self) -> dict[str, Any]:
        data: dict[str, Any] = json.loads((self.folder / "scan.json").read_text(encoding="utf-8"))
        return data

    @cached_property
    def report(self) -> dict[str, Any]:
        data: dict[str, Any] = json.loads((self.folder / "scan.report.json").read_text(encoding="utf-8"))
        return data

    @cached_property
    def axis(self) -> Array:
        """The true one in the frame of the output."""
        return self.there(self.scan.axis)

    @cached_property
    def line(self) -> tuple[Array, Array]:
        """Coordinates s and points of the skeleton line."""
        table = self.dump("skeleton")
        return table["s"], vectors(table)

    @cached_property
    def joints(self) -> Array:
        return np.array(self.chain["joints"])

    def on_line(self, s: Array) -> Array:
        """f(s) between the dumped points: (K,) -> (K, 3)."""
        return at(s, *self.line)


#: Settings by case; those of the frame are `TURNED`.
CASES: dict[str, tuple[bool, int | None, tuple[str, ...]]] = {
    # name: (turned, points that are left after thinning, settings)
    "paper": (False, None, ("profile=paper", "r=0.015", "normals.orientation=stored", "e_max=0.01")),
    "paper-turned": (
        True,
        1500,
        ("profile=paper", "r=0.015", "normals.orientation=stored", "joints.zero=straight", "e_max=0.006"),
    ),
    "paper-estimated": (True, None, ("profile=paper", "joints.base=floating")),
    "refined": (False, 1500, ("segmentation.criterion=paper", "joints.zero=straight", "joints.dof=3")),
    "refined-turned": (True, None, ("segmentation.placement=minimax", "material.mass=0.3")),
}
TURNED = {"x": 1.5, "y": -0.5, "z": 0.25, "roll": 0.3, "pitch": -0.2, "yaw": 2.0}
PAPER = [name for name in CASES if name.startswith("paper")]
REFINED = [name for name in CASES if name.startswith("refined")]


@pytest.fixture(scope="module")
def all_fitted(scan: Scan, tmp_path_factory) -> dict[str, Fitted]:
    """Every case, fitted by the command line."""
    made = {}
    for name, (turned, most, settings) in CASES.items():
        folder = tmp_path_factory.mktemp(name)
        turn, shift, options = np.eye(3), np.zeros(3), ["units=mm", "report.timings=false", *settings]
        if turned:
            # REP 103: x of ROS is z of a camera, y is -x, z is -y. Then roll, pitch and yaw about fixed axes.
            optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
            angles = [TURNED["roll"], TURNED["pitch"], TURNED["yaw"]]
            turn = Rotation.from_euler("xyz", angles).as_matrix() @ optical
            shift = np.array([TURNED["x"], TURNED["y"], TURNED["z"]])
            options += ["frame.convention=optical-to-ros", *(f"frame.{key}={value}" for key, value in TURNED.items())]
        wanted = ["--format", "urdf,json,json-plain,csv,mjcf,sdf,srdf", "--dump", folder, "-o", folder]
        with most_points(most) if most else contextlib.nullcontext():
            run("fit", scan.path, *wanted, *(word for option in options for word in ("--set", option)))
        made[name] = Fitted(folder, turn, shift, scan, tuple(options))
    return made


@pytest.fixture
def fitted(request, all_fitted: dict[str, Fitted]) -> Fitted:
    return all_fitted[request.param]


every_case = pytest.mark.parametrize("fitted", CASES, indirect=True)
paper_cases = pytest.mark.parametrize("fitted", PAPER, indirect=True)
refined_cases = pytest.mark.parametrize("fitted", REFINED, indirect=True)


def test_the_cases_are_what_they_are_for(all_fitted: dict[str, Fitted], scan: Scan) -> None:
    """Far points, duplicates and missing ones were there to be dropped, large clouds were thinned out."""
    for name, (_, most, _) in CASES.items():
        report, provenance = all_fitted[name].report, all_fitted[name].chain["provenance"]
        assert provenance["points"] == len(scan.points) + 7  # far ones are left out by the fit, not on reading
        assert min(provenance["dropped"].values()) > 50
        assert "stray-points" in {item["code"] for item in report["quality"]["findings"]}
        used = report["points_used"]
        assert used == len(scan.points) if most is None else 0.8 * most < used < 1.2 * most


@every_case
def test_every_point_of_the_cloud_is_in_the_dump_once(fitted: Fitted) -> None:
    names = ("sorted", "unreached") if fitted.chain["profile"] == "paper" else ("tube", "off_tube")
    whole = np.vstack([vectors(fitted.dump(name)) for name in names])
    if fitted.chain["profile"] == "paper":
        assert same_rows(whole, vectors(fitted.dump("projected")), 1e-12)
        whole = vectors(fitted.dump("normals"))
    expected = fitted.there(fitted.scan.points)
    if len(whole) < len(expected):
        distance, index = by_hand.nearest(whole, expected)
        assert len(np.unique(index)) == len(whole) == fitted.report["points_used"]
        assert distance.max() < 1e-9
    else:
        assert same_rows(whole, expected, 1e-9)


@paper_cases
def test_dumped_normals_are_those_of_their_points(fitted: Fitted) -> None:
    table = fitted.dump("normals")
    points, normals = vectors(table), vectors(table, "n")
    true = feet(points, fitted.axis)
    outwards = (normals * true.outward).sum(axis=1)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    own = feet(points, fitted.line[1])
    inside = (own.place > 15) & (own.place < 984) & (own.distance < 1.3 * RADIUS)
    assert inside.sum() > 0.95 * len(points)
    across, away = np.abs((normals * own.tangent).sum(axis=1))[inside], (normals * own.outward).sum(axis=1)[inside]
    if "normals.orientation=stored" in fitted.options:
        # Each one, strays included: they were made so.
        assert outwards.min() > 1 - 1e-9
        assert away.min() > 0.99
        assert np.quantile(across, 0.99) < 0.1
    else:
        # Estimates scatter; in other rows half of them would point inwards.
        assert np.mean(outwards > 0.8) > 0.97
        assert np.mean(away > 0.8) > 0.97
        assert np.quantile(across, 0.9) < 0.3


@paper_cases
def test_projected_points_are_those_of_the_same_row_less_the_radius(fitted: Fitted) -> None:
    table = fitted.dump("normals")
    expected = vectors(table) - fitted.chain["radius"] * vectors(table, "n")
    assert np.abs(vectors(fitted.dump("projected")) - expected).max() < 1e-9


@paper_cases
def test_sorted_points_have_their_own_coordinate(fitted: Fitted) -> None:
    table = fitted.dump("sorted")
    points, s = vectors(table), table["s"]
    assert (np.diff(s) >= 0).all()
    line = feet(points, fitted.line[1])
    assert np.abs(np.interp(line.place, np.arange(1000), fitted.line[0]) - s).max() < 0.015
    true = feet(points, fitted.axis).place / (FINE - 1)
    assert min(np.abs(true - s).max(), np.abs(1 - true - s).max()) < 0.015
    # Row by row: from one point to the next s grows by as much as the way along the line. One row off, and the steps
    # are those of others.
    along, steps = (np.diff(points, axis=0) * line.tangent[:-1]).sum(axis=1), np.diff(s)
    assert np.corrcoef(along, steps)[0, 1] > 0.8
    assert np.corrcoef(along[1:], steps[:-1])[0, 1] < 0.3
    assert np.corrcoef(along[:-1], steps[1:])[0, 1] < 0.3


@refined_cases
def test_points_of_the_tube_have_their_own_coordinate_and_residual(fitted: Fitted) -> None:
    table = fitted.dump("tube")
    assert (np.diff(table["s"]) >= 0).all()
    line = feet(vectors(table), fitted.line[1])
    inside = (line.place > 0) & (line.place < 999)
    assert inside.mean() > 0.99
    assert table["residual"].std() > 3e-4
    assert np.abs(line.distance - fitted.chain["radius"] - table["residual"])[inside].max() < 1e-5
    # A tenth of the usual distance from one point to the next.
    place = np.interp(line.place, np.arange(1000), fitted.line[0])
    assert np.quantile(np.abs(place - table["s"])[inside], 0.9) < 3e-5
    assert np.abs(place - table["s"])[inside].max() < 1e-3
    true = feet(vectors(table), fitted.axis).place / (FINE - 1)
    assert min(np.abs(true - table["s"]).max(), np.abs(1 - true - table["s"]).max()) < 0.003


@refined_cases
def test_points_off_the_tube_have_their_own_residual(fitted: Fitted) -> None:
    table = fitted.dump("off_tube")
    line = feet(vectors(table), fitted.line[1])
    # The tube goes on beyond its ends for those that lie there.
    inside = (line.place > 0) & (line.place < 999)
    assert inside.sum() > 5
    assert np.abs(line.distance - fitted.chain["radius"] - table["residual"])[inside].max() < 1e-5


@refined_cases
def test_the_order_of_the_backbone_is_that_of_the_line(fitted: Fitted) -> None:
    place = feet(vectors(fitted.dump("ordering")), fitted.line[1]).place
    assert (np.diff(place) > -1.0).all()
    assert place[0] < 30 < 970 < place[-1]


@every_case
def test_colours_are_those_of_the_coordinate_beside_them(fitted: Fitted) -> None:
    table = fitted.dump("sorted" if fitted.chain["profile"] == "paper" else "tube")
    stops = np.array([[48, 18, 92], [38, 130, 142], [253, 231, 37]])
    for name, values in zip(("red", "green", "blue"), stops.T, strict=True):
        assert np.abs(table[name] - np.interp(table["s"], [0.0, 0.5, 1.0], values)).max() <= 0.5 + 1e-9


@every_case
def test_residuals_of_the_report_are_of_the_points(fitted: Fitted) -> None:
    if fitted.chain["profile"] == "refined":
        points = vectors(fitted.dump("tube"))
    else:
        points = vectors(fitted.dump("normals"))
    line = feet(points, fitted.line[1])
    error = np.abs(line.distance - fitted.chain["radius"])
    # Strays are the last in the order of their errors.
    assert fitted.report["residual"]["median"] == pytest.approx(np.median(error), rel=0.03)


@every_case
def test_findings_are_where_they_say(fitted: Fitted) -> None:
    (gap,) = [item for item in fitted.report["quality"]["findings"] if item["code"] == "gap"]
    assert gap in fitted.chain["quality"]["findings"]
    (place,) = feet(np.array([gap["position"]]), fitted.axis).place / (FINE - 1)
    assert fitted.scan.gap[0] < place < fitted.scan.gap[1]
    # The coordinate is that of the place, along this line.
    assert np.linalg.norm(fitted.on_line(np.array([gap["s"]]))[0] - gap["position"]) < RADIUS


# The line, the error, the joints.


@every_case
def test_rows_of_the_skeleton_agree(fitted: Fitted) -> None:
    """Two tables of different spacing and the JSON file have one line in one direction."""
    coarse, table = fitted.line, columns(fitted.folder / "scan.skeleton.csv")
    points = vectors(table)
    assert points == pytest.approx(np.array(fitted.chain["skeleton"]["points"]), abs=1e-12)
    assert np.abs(at(table["s"], *coarse) - points).max() < 1e-5
    along = arc_lengths(points)
    assert np.abs(along - table["arc_length"]).max() < 1e-4
    assert along[-1] == pytest.approx(fitted.chain["skeleton"]["length"], rel=1e-5)
    tangents = np.gradient(points, along, axis=0)
    assert np.abs(tangents - vectors(table, "t"))[1:-1].max() < 1e-3
    bent = np.linalg.norm(np.gradient(tangents, along, axis=0), axis=1)
    assert np.abs(bent - table["curvature"])[3:-3].max() < 0.02 * bent.max()
    dumped = fitted.dump("skeleton")
    bent = np.interp(dumped["s"], table["s"], table["curvature"])
    assert np.abs(bent - dumped["curvature"]).max() < 0.02 * bent.max()
    # And it is the object's.
    axis = feet(points, fitted.axis)
    assert axis.distance.max() < 0.006
    assert np.abs(np.abs(np.diff(axis.place)).sum() - (axis.place.max() - axis.place.min())) < 1.0


@every_case
def test_rows_of_the_error_are_those_of_their_pairs(fitted: Fitted) -> None:
    table = fitted.dump("mdtw")
    first, second = table["skeleton_index"].astype(int), table["chain_index"].astype(int)
    skeleton, chain = np.array(fitted.chain["skeleton"]["points"]), evenly(fitted.joints, 1000)
    assert (first != second).any()
    distance = np.linalg.norm(skeleton[first] - chain[second], axis=1)
    assert np.abs(distance - table["error"]).max() < 1e-9
    # The other way round they would be others.
    assert np.abs(np.linalg.norm(skeleton[second] - chain[first], axis=1) - table["error"]).max() > 1e-6
    assert np.abs(first / 999 - table["s"]).max() < 1e-12
    pairs = np.stack([first, second], axis=1)
    assert pairs[[0, -1]].tolist() == [[0, 0], [999, 999]]
    assert {tuple(step) for step in np.diff(pairs, axis=0).tolist()} <= {(0, 1), (1, 0), (1, 1)}
    report = fitted.report["mdtw"]
    assert np.array_equal(report["error"], table["error"])
    assert np.array_equal(report["s"], table["s"])


@every_case
def test_the_largest_deviation_is_where_it_is_said_to_be(fitted: Fitted) -> None:
    made, s = fitted.report["segmentation"], np.array(fitted.chain["joint_s"])
    place = fitted.on_line(np.array([made["deviation_s"]]))
    piece = int(np.clip(np.searchsorted(s, made["deviation_s"], side="right") - 1, 0, len(s) - 2))
    # To the segment of its piece; of a joint beside the line, to the joint.
    joints = fitted.joints[s == made["deviation_s"]]
    here = [by_hand.to_segment(place, *fitted.joints[piece : piece + 2])[0], *np.linalg.norm(joints - place, axis=1)]
    assert max(here) == pytest.approx(fitted.chain["max_deviation"], abs=1e-5)
    assert made["deviation"] == fitted.chain["max_deviation"] == fitted.report["max_deviation"]


@every_case
def test_joints_lie_at_their_coordinates(fitted: Fitted) -> None:
    table = fitted.dump("joints")
    assert np.array_equal(vectors(table), fitted.joints)
    assert np.array_equal(table["s"], fitted.chain["joint_s"])
    apart = np.linalg.norm(fitted.on_line(table["s"]) - fitted.joints, axis=1)
    beside = "segmentation.placement=minimax" in fitted.options
    assert apart.max() < (fitted.chain["e_max"] if beside else 1e-5)
    # At their coordinate they are nearest to the line, but for the ends.
    nearest = feet(fitted.joints, fitted.line[1]).distance
    assert np.abs(nearest - apart)[1:-1].max() < 1e-4


@every_case
def test_rows_of_the_segments_agree_with_the_joints(fitted: Fitted) -> None:
    start, end = fitted.joints[:-1], fitted.joints[1:]
    table, links = fitted.dump("chain"), fitted.chain["links"]
    assert [link["name"] for link in links] == [f"segment_{k + 1:02d}" for k in range(len(start))]
    rotations = np.stack([table[f"r{i}{j}"] for i in "123" for j in "123"], axis=1).reshape(-1, 3, 3)
    for lengths, centres, turns in (
        (table["length"], vectors(table), rotations),
        (
            np.array([link["length"] for link in links]),
            np.array([link["transform"] for link in links])[:, :3, 3],
            np.array([link["transform"] for link in links])[:, :3, :3],
        ),
    ):
        assert np.abs(centres - 0.5 * (start + end)).max() < 1e-9
        assert np.abs(centres + 0.5 * lengths[:, None] * turns[:, :, 0] - end).max() < 1e-9
        assert np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9
        assert np.abs(np.linalg.det(turns) - 1.0).max() < 1e-9
    assert len(np.unique(np.round(table["length"], 9))) > 1  # a shuffle would show
    plain = json.loads((fitted.folder / "scan.plain.json").read_text())
    assert plain["joints"] == fitted.chain["joints"]
    assert plain["lengths"] == pytest.approx([link["length"] for link in links])
    assert fitted.chain["last_segment_length"] == pytest.approx(table["length"][-1])


@every_case
def test_models_put_their_joints_where_the_chain_has_them(fitted: Fitted) -> None:
    links, floating = fitted.chain["links"], "joints.base=floating" in fitted.options
    made = by_hand.of_json(fitted.chain["model"], links)
    scanned = {
        name: value
        for joint in fitted.chain["model"]["joints"]
        for name, value in zip(joint["hinges"], joint["scanned"], strict=True)
    }
    mjcf, keys = by_hand.read_mjcf(fitted.folder / "scan.xml")
    models = {
        "json": made,
        "urdf": by_hand.read_urdf(fitted.folder / "scan.urdf"),
        "mjcf": mjcf,
        "sdf": by_hand.read_sdf(fitted.folder / "scan.sdf"),
    }
    names, masses = [link["name"] for link in links], {link["name"]: link["mass"] for link in links}
    if "joints.zero=straight" in fitted.options:
        assert max(map(abs, scanned.values())) > 0.1
    for name, model in models.items():
        if name == "sdf" and "joints.dof=3" in fitted.options:
            continue  # its ball joints have no values
        assert [step.child for step in model.steps if step.child.startswith("segment")] == names
        assert model.hinges == list(scanned)
        assert np.abs(model.joints(scanned) - fitted.joints).max() < 1e-6, name
        assert model.masses == pytest.approx(masses)
    for name in ("urdf", "sdf"):
        assert models[name].lengths == pytest.approx({link["name"]: link["length"] for link in links})
    assert [mass / link["length"] for mass, link in zip(masses.values(), links, strict=True)] == pytest.approx(
        [sum(masses.values()) / fitted.chain["length"]] * len(links)
    )
    # What the others say of the scanned pose.
    numbers = keys["scanned"][1]
    base = None
    if floating:
        base, numbers = by_hand.homogeneous(by_hand.from_quaternion(numbers[3:7]), numbers[:3]), numbers[7:]
    values = dict(zip(mjcf.hinges, numbers, strict=True))
    assert np.abs(mjcf.joints(values, base) - fitted.joints).max() < 1e-6
    assert by_hand.read_srdf(fitted.folder / "scan.srdf")["scanned"] == pytest.approx(scanned, abs=1e-9)
    straight = by_hand.read_srdf(fitted.folder / "scan.srdf")["straight"]
    bends = np.diff(models["urdf"].joints(straight), axis=0)
    bends /= np.linalg.norm(bends, axis=1, keepdims=True)
    assert np.abs(bends - bends[0]).max() < 1e-6
    for model in (made, models["urdf"]):
        assert all(low <= scanned[name] <= high for name, (low, high) in model.limits.items())


@every_case
def test_curves_that_are_loaded_again_are_the_ones_that_were_written(fitted: Fitted) -> None:
    chain, skeleton = fitted.folder / "scan.json", fitted.folder / "scan.skeleton.csv"
    assert np.array_equal(dlogen.load_curve(chain).points, fitted.joints)
    assert np.abs(dlogen.load_curve(skeleton).points - fitted.chain["skeleton"]["points"]).max() < 1e-12
    if "joints.zero=straight" not in fitted.options and "joints.base=floating" not in fitted.options:
        assert np.abs(dlogen.load_curve(fitted.folder / "scan.urdf").points - fitted.joints).max() < 1e-6


# Places where the object touches itself.


def fit_alone(cloud: Path, *options: str) -> dict[str, Any]:
    """The chain of a cloud, in the axes of ROS."""
    run("fit", cloud, "-o", cloud.parent, "--frame", "optical-to-ros", "--format", "json", *options)
    data: dict[str, Any] = json.loads(cloud.with_suffix(".json").read_text())
    return data


def finding(chain: dict[str, Any], code: str) -> dict[str, Any]:
    (found,) = [item for item in chain["quality"]["findings"] if item["code"] == code]
    return dict(found)


@pytest.mark.parametrize("cut", ["start", "end"])
def test_a_crossing_is_named_by_the_strand_that_comes_first(cut: str, tmp_path: Path) -> None:
    """Its coordinate is on the first strand, its position in the middle between the two.

    One end of the loop is shorter than the other, so that no strand is in the place of the other one from behind.
    """
    points = loop_centre_line(1.4, 0.042).points(400)
    line = from_points(points[60:] if cut == "start" else points[:340])
    dlogen.write_cloud(tmp_path / "loop.ply", sample_tube(line, 0.02, 4000, 1).points)
    chain = fit_alone(tmp_path / "loop.ply")
    crossing, skeleton = finding(chain, "crossing"), np.array(chain["skeleton"]["points"])
    position = np.array(crossing["position"])
    apart = np.linalg.norm(skeleton - position, axis=1)
    near = np.flatnonzero(apart < 1.7 * 0.02)
    strands = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    assert len(strands) == 2
    first, second = (int(strand[np.argmin(apart[strand])]) for strand in strands)
    assert abs(second - first) > 200
    assert abs((999 - second) - first) > 50
    assert crossing["s"] == pytest.approx(first / 999, abs=0.01)
    # The axes are 42 mm apart there.
    assert apart[first] == pytest.approx(0.021, abs=0.002)
    assert np.linalg.norm(0.5 * (skeleton[first] + skeleton[second]) - position) < 0.002
    # In the frame of the output: the strands cross in the cloud at x = 0, which is -y of ROS.
    assert abs(position[1]) < 0.005


@pytest.mark.parametrize("inwards", [False, True])
def test_strands_side_by_side_are_measured_along_the_first(inwards: bool, tmp_path: Path) -> None:
    """A spiral: the outer strand is longer than the inner one beside it."""
    radius, angle = 0.01, np.linspace(0.0, 2 * np.pi * 1.6, 400)
    away = 0.09 + 2.1 * radius * angle / (2 * np.pi)
    spiral = np.stack([away * np.cos(angle), away * np.sin(angle), 0.0 * angle], axis=1)
    line = from_points(spiral[::-1] if inwards else spiral)
    dlogen.write_cloud(tmp_path / "spiral.ply", sample_tube(line, radius, 5000, 1).points)
    chain = fit_alone(tmp_path / "spiral.ply")
    found, skeleton = finding(chain, "side-by-side"), np.array(chain["skeleton"]["points"])
    along = arc_lengths(skeleton)
    distance = np.linalg.norm(skeleton[:, None] - skeleton[None], axis=2)
    first, second = np.nonzero((distance < 2.7 * radius) & (along[None] - along[:, None] > 7 * radius))
    runs = [along[side.max()] - along[side.min()] for side in (first, second)]
    assert abs(runs[1] - runs[0]) > 6 * radius
    (told,) = re.findall(r"for ([0-9.]+) mm", found["message"])
    assert float(told) / 1000 == pytest.approx(runs[0], abs=2 * radius)
    assert found["s"] == pytest.approx(along[first].mean() / along[-1], abs=0.02)


# Recordings, and clouds in no order.

FRAMES = [f"scan_{k}" for k in range(4, 13)]
#: Frames that cannot be believed: one is too short, one is no cloud.
SHORT, BROKEN = "scan_7", "scan_10"
GOOD = [name for name in FRAMES if name not in (SHORT, BROKEN)]
LENGTH, THICK = 0.6, 0.01
#: Angles by which the object is bent, by the names of the frames. The most and the least are behind those set aside.
BENDS = {name: 1.7 + 1.3 * np.cos(0.7 * k - 2.66) for k, name in enumerate(FRAMES)}


def arc(bend: float, turn: float, length: float) -> CentreLine:
    """An arc in the plane z = 0 that is bent by an angle, from the origin in the direction `turn`."""

    def curve(s: Array, derivative: int) -> Array:
        angle = bend * s + turn + 0.5 * np.pi * derivative
        offset = np.array([np.sin(turn), -np.cos(turn), 0.0]) if derivative == 0 else 0.0
        circle = np.stack([np.sin(angle), -np.cos(angle), 0.0 * s], axis=-1)
        return (circle - offset) * length / bend * bend**derivative

    return CentreLine("arc", curve, arc_length_parameter=True)


@dataclass(frozen=True)
class Recording:
    """A recording of an object that bends and turns, its motion, and one model for the same clouds in no order.

    Attributes:
        clouds, motion, models: folders.
        lines: true axes by the names of the frames.
    """

    clouds: Path
    motion: Path
    models: Path
    lines: dict[str, CentreLine]


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Recording:
    """From frame to frame the bend, and with it the error of three segments, changes by more than a millimetre.

    In the order of their names as text the frames would be in another order than in time.
    """
    folder = tmp_path_factory.mktemp("recording")
    (folder / "clouds").mkdir()
    lines = {}
    for k, name in enumerate(FRAMES):
        lines[name] = arc(BENDS[name], 0.42 * k, 0.7 * LENGTH if name == SHORT else LENGTH)
        points = sample_tube(lines[name], THICK, 3000, k, noise=0.0002 + 0.00003 * k).points
        dlogen.write_cloud(folder / "clouds" / f"{name}.ply", points)
    (folder / "clouds" / f"{BROKEN}.ply").write_bytes(b"ply\n")
    common = ["-j", "1", "--set", "segmentation.segments=3", "--format", "urdf,mjcf"]
    run_apart("sequence", folder / "clouds", "--rate", "10", "-o", folder / "motion", *common)
    common[-1] += ",json"
    run_apart("batch", folder / "clouds", "-o", folder / "models", "--one-model", *common, status=1)
    return Recording(folder / "clouds", folder / "motion", folder / "models", lines)


def table_of(path: Path) -> dict[str, dict[str, Any]]:
    """What a table, arrays or a report say of each frame, by its name: error and time, None if unknown, and state."""
    if path.suffix == ".json":
        return {row["name"]: row for row in json.loads(path.read_text())["frames"]}
    if path.suffix == ".csv":
        rows: list[dict[str, Any]] = [
            row | {"error": row["error"] or "nan", "time": row["time"] or "nan"} for row in read_csv(path)
        ]
    else:
        with np.load(path) as arrays:
            kinds = ("frame", "error", "time", "state")
            rows = [dict(zip(kinds, row, strict=True)) for row in zip(*(arrays[kind] for kind in kinds), strict=True)]
    for row in rows:
        row |= {key: None if np.isnan(float(row[key])) else float(row[key]) for key in ("error", "time")}
    return {str(row["frame"]): row for row in rows}


def joints_of(path: Path) -> dict[str, Array]:
    """(n + 1, 3) positions of the joints by the name of the frame."""
    with np.load(path) as arrays:
        return dict(zip(arrays["frame"].tolist(), arrays["joint_positions"], strict=True))


OUTPUTS = [
    *("motion/trajectory.csv", "motion/trajectory.npz", "motion/sequence.json"),
    *("models/one_model/poses.csv", "models/one_model/poses.npz", "models/one_model/one_model.json"),
]


@pytest.mark.parametrize("output", OUTPUTS)
def test_the_error_of_a_frame_is_between_its_own_line_and_its_own_chain(output: str, recording: Recording) -> None:
    path, in_time = recording.motion.parent / output, output.startswith("motion")
    told = table_of(path)
    assert list(told) == FRAMES if in_time else told.keys() == set(FRAMES)
    chains = joints_of(path.with_name("trajectory.npz" if in_time else "poses.npz"))
    fits = recording.motion / "frames" if in_time else recording.models
    true: dict[str, float] = {}
    for name in GOOD:
        chain = chains[name]
        skeleton = np.array(json.loads((fits / f"{name}.json").read_text())["skeleton"]["points"])
        # The chain and the fit are those of this frame.
        axis = recording.lines[name].points(FINE)
        assert feet(skeleton, axis).distance.max() < 0.001
        assert feet(chain, axis).distance.max() < told[name]["error"] + 0.001
        true[name] = by_hand.to_chain(skeleton, chain).max()
        assert told[name]["error"] == pytest.approx(true[name], abs=0.0003)
    # No frame could have the error of the one before or after it.
    assert np.abs(np.diff(list(true.values()))).min() > 0.001
    for name in (SHORT, BROKEN):
        assert told[name]["error"] is None
    common = json.loads(path.with_name("sequence.json" if in_time else "one_model.json").read_text())["common"]
    assert common["max_deviation_frame"] == max(true, key=lambda name: true[name])
    assert common["max_deviation"] == pytest.approx(max(true.values()), abs=0.0003)
    assert common["mean_deviation"] == pytest.approx(np.mean(list(true.values())), abs=0.0003)


@pytest.mark.parametrize("output", OUTPUTS[:3])
def test_frames_have_their_own_time_and_state(output: str, recording: Recording) -> None:
    told = table_of(recording.motion.parent / output)
    assert [told[name]["time"] for name in FRAMES] == pytest.approx([0.1 * k for k in range(len(FRAMES))])
    for name in FRAMES:
        assert told[name]["state"] == ("good" if name in GOOD else "interpolated")
        if "reason" in told[name]:
            reason = told[name]["reason"]
            code = reason["code"] if isinstance(reason, dict) else reason or None
            assert code == {SHORT: "length", BROKEN: "failed"}.get(name)


def test_poses_of_the_base_and_values_of_the_hinges_make_the_positions_of_the_same_frame(recording: Recording) -> None:
    """In the table, in the arrays and in the keyframes, for models of the URDF and the MJCF file."""
    folder = recording.motion
    chains = joints_of(folder / "trajectory.npz")
    urdf, (mjcf, keys) = by_hand.read_urdf(folder / "model.urdf"), by_hand.read_mjcf(folder / "model.xml")
    told = {row["frame"]: row for row in read_csv(folder / "trajectory.csv")}
    with np.load(folder / "trajectory.npz") as arrays:
        assert arrays["joint_names"].tolist() == urdf.hinges == mjcf.hinges
        rows = np.hstack([arrays["base_position"], arrays["base_quaternion"], arrays["joint_values"]])
    for k, name in enumerate(FRAMES):
        pose = ("x", "y", "z", "qw", "qx", "qy", "qz")
        written = np.array([float(told[name][key]) for key in (*pose, *urdf.hinges)])
        time, key = keys[name]
        assert time == pytest.approx(0.1 * k)
        for numbers, model in ((written, urdf), (rows[k], urdf), (key, mjcf)):
            base = by_hand.homogeneous(by_hand.from_quaternion(numbers[3:7]), numbers[:3])
            values = dict(zip(model.hinges, numbers[7:], strict=True))
            assert np.abs(model.joints(values, base) - chains[name]).max() < 1e-6
    # Frames that were filled in lie between their neighbours.
    for name in (SHORT, BROKEN):
        k = FRAMES.index(name)
        before, after = chains[FRAMES[k - 1]], chains[FRAMES[k + 1]]
        step = np.linalg.norm(after - before, axis=1).max()
        assert np.linalg.norm(chains[name] - 0.5 * (before + after), axis=1).max() < 0.25 * step


def test_rows_of_the_report_are_those_of_the_frames_fits(recording: Recording) -> None:
    report = json.loads((recording.motion / "sequence.json").read_text())
    chains, turned = joints_of(recording.motion / "trajectory.npz"), set()
    for row in report["frames"]:
        name = row["name"]
        if name == BROKEN:
            assert row["length"] is row["radius"] is row["residual"] is None
            continue
        fit = json.loads((recording.motion / "frames" / f"{name}.json").read_text())
        error = json.loads((recording.motion / "frames" / f"{name}.report.json").read_text())
        assert row["length"] == fit["skeleton"]["length"] == pytest.approx(recording.lines[name].length, rel=0.005)
        assert row["radius"] == fit["radius"]
        assert row["residual"] == error["residual"]["rms"]
        if name in GOOD:
            ends = np.linalg.norm(np.array(fit["skeleton"]["points"])[[0, -1]] - chains[name][0], axis=1)
            assert row["reversed"] == (ends[1] < ends[0])
            turned.add(row["reversed"])
    assert turned == {False, True}
    # Noise grows from frame to frame.
    assert (np.diff([row["residual"] for row in report["frames"] if row["name"] in GOOD]) > 0).all()
    tightest = max(GOOD, key=lambda name: BENDS[name])
    assert report["common"]["min_bend_radius_frame"] == tightest
    assert report["common"]["min_bend_radius"] == pytest.approx(LENGTH / BENDS[tightest], rel=0.1)
    assert report["common"]["reference_frame"] == min(GOOD, key=lambda name: BENDS[name])
    moved = max(np.linalg.norm(chains[a] - chains[b], axis=1).max() for a, b in pairwise(FRAMES))
    assert report["common"]["largest_step"] == pytest.approx(moved)


@pytest.mark.parametrize("folder", ["motion/frames", "models"])
def test_rows_of_a_batch_are_those_of_their_clouds(folder: str, recording: Recording) -> None:
    place = recording.motion.parent / folder
    rows = {row["key"]: row for row in read_csv(place / "summary.csv")}
    assert rows.keys() == set(FRAMES)
    for name, row in rows.items():
        cloud = recording.clouds / f"{name}.ply"
        assert Path(row["cloud"]).name == cloud.name
        if name == BROKEN:
            assert row["status"] == "failed"
            assert row["error"]
            continue
        assert row["status"] == "done"
        assert row["sha256"] == hashlib.sha256(cloud.read_bytes()).hexdigest()
        chain = json.loads((place / f"{name}.json").read_text())
        error = json.loads((place / f"{name}.report.json").read_text())
        assert chain["provenance"]["sha256"] == row["sha256"]
        assert float(row["length"]) == chain["skeleton"]["length"]
        assert float(row["radius"]) == chain["radius"]
        assert float(row["max_deviation"]) == chain["max_deviation"]
        assert float(row["mdtw_mean"]) == error["mdtw"]["mean"]
        assert float(row["residual_rms"]) == error["residual"]["rms"]
        assert float(row["length"]) == pytest.approx(recording.lines[name].length, rel=0.005)
