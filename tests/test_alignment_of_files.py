"""Rows that belong together stay together where files are read and written: clouds, curves, synthetic truth.

As in `test_alignment`: what belongs together is found anew by the geometry of an object that is known.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from by_command import run
from by_hand import arc_lengths, at, evenly, feet, read_dump, same_rows, vectors
from odd_clouds import Rows, with_defects, write_pcd, write_ply

import dlogen
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube

Array = np.ndarray

#: Files by name: format, encoding, and whether each point has a list of numbers between its coordinates.
FILES = {
    "ply-ascii": ("ply", "ascii", False),
    "ply-ascii-lists": ("ply", "ascii", True),
    "ply-little": ("ply", "binary_little_endian", False),
    "ply-little-lists": ("ply", "binary_little_endian", True),
    "ply-big": ("ply", "binary_big_endian", False),
    "ply-big-lists": ("ply", "binary_big_endian", True),
    "pcd-ascii": ("pcd", "ascii", False),
    "pcd-binary": ("pcd", "binary", False),
    "pcd-compressed": ("pcd", "binary_compressed", False),
}
TUBE = 0.2


@pytest.fixture(scope="module")
def rows() -> Rows:
    """1,800 rows of a tube around the z axis: the normal of a point is the direction to it from there."""
    rng = np.random.default_rng(5)
    angle, height = rng.uniform(0, 2 * np.pi, 1500), rng.uniform(-1, 1, 1500)
    normals = np.stack([np.cos(angle), np.sin(angle), np.zeros(1500)], axis=1)
    return with_defects(TUBE * normals + height[:, None] * [0, 0, 1], normals, 6, unknown=5)


def assert_normals_are_outward(cloud: dlogen.Cloud, unknown: Array) -> None:
    """Every normal is that of its own point on the tube, and missing at these points only."""
    missing = ~cloud.normals.any(axis=1)
    assert same_rows(cloud.points[missing], unknown, 0.0)
    outward = cloud.points / [TUBE, TUBE, np.inf]
    assert np.abs(cloud.normals - outward)[~missing].max() < 1e-9


@pytest.mark.parametrize("shape", [(1800, 1), (60, 30)], ids=["in-a-row", "organised"])
@pytest.mark.parametrize("file", FILES)
def test_normals_stay_with_their_points_on_reading(
    file: str, shape: tuple[int, int], rows: Rows, tmp_path: Path
) -> None:
    ending, encoding, lists = FILES[file]
    path = tmp_path / f"cloud.{ending}"
    if ending == "ply":
        write_ply(path, rows.points, rows.normals, encoding, lists=lists, shape=shape)
    else:
        write_pcd(path, rows.points, rows.normals, encoding, shape=shape)
    cloud = dlogen.read_cloud(path)
    assert (cloud.source.width, cloud.source.height) == shape
    assert np.array_equal(cloud.points, rows.points[rows.kept])
    assert_normals_are_outward(cloud, rows.points[rows.unknown])


def test_arrays_are_cleaned_as_files_are(rows: Rows) -> None:
    settings = {"profile": "paper", "r": TUBE}
    result, clean = (dlogen.fit(points, settings) for points in (rows.points, rows.points[rows.kept]))
    assert result.provenance["points"] == rows.kept.sum()
    assert np.array_equal(result.chain.joints, clean.chain.joints)


@pytest.mark.parametrize("file", [name for name in FILES if "lists" not in name])
@pytest.mark.parametrize("given", ["own", "others"])
def test_normals_stay_with_their_points_on_writing(file: str, given: str, rows: Rows, tmp_path: Path) -> None:
    ending, encoding, _ = FILES[file]
    path = tmp_path / f"cloud.{ending}"
    points, normals = rows.points[rows.kept], np.nan_to_num(rows.normals[rows.kept])
    if given == "own":
        dlogen.write_cloud(path, dlogen.Cloud(points, normals), encoding=encoding)
    else:
        dlogen.write_cloud(path, dlogen.Cloud(points, -normals), encoding=encoding, normals=normals)
    expected = np.hstack([points, normals])
    # Our own opinion, where a file is easy to read.
    if encoding == "ascii":
        lines = [line.split() for line in path.read_text().splitlines()]
        table = np.array([words for words in lines if len(words) == 6], dtype=float)
        assert np.array_equal(table, expected)
    if encoding == "binary_little_endian":
        columns = read_dump(path)
        assert np.array_equal(np.hstack([vectors(columns), vectors(columns, "n")]), expected)
    cloud = dlogen.read_cloud(path)
    assert np.array_equal(cloud.points, points)
    assert_normals_are_outward(cloud, rows.points[rows.unknown])


@pytest.mark.parametrize("organised", [False, True], ids=["in-a-row", "organised"])
def test_normals_stay_with_their_points_when_an_object_is_cut_out(organised: bool, tmp_path: Path) -> None:
    """A tube stands in front of a wall that the background has as well; some places were not seen."""
    rng = np.random.default_rng(7)
    wall = np.stack([np.full(3000, 0.6), *rng.uniform(-0.5, 0.5, (2, 3000))], axis=1)
    scene, normals = wall.copy(), np.tile([-1.0, 0.0, 0.0], (3000, 1))
    is_tube, lost = rng.random(3000) < 0.3, rng.random(3000) < 0.05
    angle, height = rng.uniform(0, 2 * np.pi, is_tube.sum()), rng.uniform(-TUBE, TUBE, is_tube.sum())
    normals[is_tube] = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    scene[is_tube] = TUBE * normals[is_tube] + height[:, None] * [0.0, 0.0, 1.0]
    scene[lost] = np.nan
    shape = (60, 50) if organised else (3000, 1)
    write_pcd(tmp_path / "scene.pcd", scene, normals, "binary", shape=shape)
    write_pcd(tmp_path / "wall.pcd", wall, np.tile([-1.0, 0.0, 0.0], (3000, 1)), "binary", shape=shape)
    for count in ("all", "300"):
        out = tmp_path / f"{count}.ply"
        options = ["--points", count, "--threshold", "0.1", "-o", out]
        run("extract", tmp_path / "scene.pcd", "--background", tmp_path / "wall.pcd", *options)
        cloud = dlogen.read_cloud(out)
        assert len(cloud) == 300 if count == "300" else len(cloud) > 0.9 * (is_tube & ~lost).sum()
        assert np.abs(np.hypot(*cloud.points.T[:2]) - TUBE).max() < 1e-9
        assert_normals_are_outward(cloud, np.empty((0, 3)))


# Synthetic clouds and their truth.


def test_rows_of_synthetic_clouds_belong_together() -> None:
    """Points, normals, coordinates and what is stray, after strays are mixed in."""
    line = random_centre_line(3)
    tube = sample_tube(line, 0.02, 4000, 3, stray_fraction=0.2, density_ratio=3.0, gaps=[(0.3, 0.4)], caps=True)
    stray = tube.is_stray
    assert stray.sum() == 800
    assert np.array_equal(stray, np.isnan(tube.s))
    assert np.array_equal(stray, np.isnan(tube.normals).any(axis=1))
    points, normals, s = tube.points[~stray], tube.normals[~stray], tube.s[~stray]
    axis, tangents = line(s), line.tangents(s)
    along = (normals * tangents).sum(axis=1)
    # On the flat ends the normal goes on along the line, elsewhere it is across, and leads to the point.
    cap = np.abs(along) > 0.5
    assert 5 < cap.sum() < 100
    assert set(s[cap]) == {0.0, 1.0}
    assert np.abs(along[cap] - np.where(s[cap] > 0.5, 1.0, -1.0)).max() < 1e-9
    assert np.abs(((points - axis) * tangents).sum(axis=1)).max() < 1e-9
    assert np.linalg.norm(points - axis, axis=1)[cap].max() <= 0.02
    assert np.abs(points - axis - 0.02 * normals)[~cap].max() < 1e-9
    assert not ((s > 0.3) & (s < 0.4)).any()
    # A stray is off the tube, if not by chance.
    assert np.median(feet(tube.points[stray], line.points(2000)).distance) > 0.05


def test_the_truth_of_a_synthetic_cloud_is_where_its_points_are(tmp_path: Path) -> None:
    """From its start to its end: the gap and the density say which is which."""
    shape = ["random", "--seed", "3", "--points", "4000", "--diameter", "0.03", "--units", "mm"]
    defects = ["--gap", "0.2:0.3", "--density-ratio", "5", "--offset", "10,-20,30"]
    run("synth", *shape, *defects, "-o", tmp_path / "cloud.ply")
    truth = json.loads((tmp_path / "cloud.truth.json").read_text())
    line = np.array(truth["points"])
    steps = np.diff(arc_lengths(line))
    assert np.ptp(steps) < 1e-5
    assert steps.sum() == pytest.approx(truth["length"], rel=1e-5)
    found = feet(dlogen.read_cloud(tmp_path / "cloud.ply").points / 1000.0, line)
    assert np.abs(found.distance - 0.015).max() < 1e-5
    s = found.place / 999
    assert not ((s > 0.201) & (s < 0.299)).any()
    # The density is 1 + 4 s: its integral is 1 up to the middle and 3 in all, of which the gap takes 0.2.
    assert (s < 0.5).mean() == pytest.approx(0.8 / 2.8, abs=0.03)
    assert truth["radius"] == 0.015


def test_the_truth_of_a_camera_is_where_the_object_is(tmp_path: Path) -> None:
    run("synth", "hose", "--camera", "kinect-v1", "-o", tmp_path / "scene.pcd")
    background = tmp_path / "scene.background.pcd"
    run("extract", tmp_path / "scene.pcd", "--background", background, "--points", "all", "-o", tmp_path / "hose.ply")
    line = np.array(json.loads((tmp_path / "scene.truth.json").read_text())["points"])
    found = feet(dlogen.read_cloud(tmp_path / "hose.ply").points, line)
    assert np.quantile(np.abs(found.distance - 0.02), 0.95) < 0.01
    # Along all of it.
    assert np.histogram(found.place, bins=20, range=(0, 999))[0].min() > 20


# Curves.


@pytest.fixture(scope="module")
def curve() -> Array:
    """(300, 3): of uneven steps, and no end is like the other."""
    s = np.linspace(0.0, 1.0, 300) ** 1.5
    return np.stack([s, 0.3 * np.sin(4 * s) * s, 0.2 * s**2], axis=1)


def test_a_curve_of_edges_is_followed_from_point_to_point(curve: Array, tmp_path: Path) -> None:
    """As Open3D writes line sets: points in any order, and pairs of them."""
    order = np.random.default_rng(2).permutation(len(curve))
    place = np.argsort(order)
    edges = np.random.default_rng(3).permutation(np.stack([place[:-1], place[1:]], axis=1))
    head = ["ply", "format ascii 1.0", f"element vertex {len(curve)}", *(f"property double {axis}" for axis in "zxy")]
    head += [f"element edge {len(edges)}", "property int vertex1", "property int vertex2", "end_header"]
    body = [" ".join(map(repr, row)) for row in curve[order][:, [2, 0, 1]].tolist()]
    body += [f"{first} {second}" for first, second in edges.tolist()]
    (tmp_path / "lines.ply").write_text("\n".join([*head, *body, ""]))
    points = dlogen.load_curve(tmp_path / "lines.ply").points
    assert np.array_equal(points, curve) or np.array_equal(points, curve[::-1])


def test_a_table_is_read_by_the_names_of_its_columns(curve: Array, tmp_path: Path) -> None:
    rows = [f"{k},{z!r},{x!r},0.5,{y!r}" for k, (x, y, z) in enumerate(curve.tolist())]
    (tmp_path / "curve.csv").write_text("\n".join(["time,z,x,weight,y", *rows, ""]))
    assert np.array_equal(dlogen.load_curve(tmp_path / "curve.csv").points, curve)


@pytest.mark.parametrize("turned", [False, True], ids=["same-way", "other-way"])
def test_errors_of_a_comparison_are_where_the_curves_differ(curve: Array, turned: bool) -> None:
    """A dent at a third of the first curve is at a third of the table, in whichever direction the second one runs."""
    s = arc_lengths(curve) / arc_lengths(curve)[-1]
    other = curve + 0.02 * np.exp(-(((s - 0.3) / 0.05) ** 2))[:, None] * [0, 0, 1]
    found = dlogen.compare(curve, other[::-1] if turned else other)
    assert found["reversed"] is turned
    error, places = np.array(found["error"]), np.array(found["s"])
    assert len(error) == len(places) == found["path_length"]
    assert (np.diff(places) >= 0).all()
    assert found["max"] == error.max() == pytest.approx(0.02, rel=0.05)
    assert places[int(error.argmax())] == pytest.approx(0.3, abs=0.01)
    # Each is the distance of its own place to the other curve, or a little more: MDTW goes by pairs of samples.
    own = feet(at(places, np.linspace(0, 1, 1000), evenly(curve, 1000)), other).distance
    assert (own < error + 1e-6).all()
    assert np.abs(own - error).max() < 0.005
