"""Curves from files: every kind against points that are known, and everything else refused in so many words."""

from __future__ import annotations

import io
import itertools
import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.errors import InputError
from dlogen.evaluation.comparison import compare
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube, write_truth
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.io.cloud_files import write_cloud
from dlogen.io.curves.curve import KINDS, Curve, load_curve
from dlogen.io.json_text import dump_json
from dlogen.io.models import chain as chain_json
from dlogen.io.models import urdf
from dlogen.io.report import report_dict
from dlogen.types import Result, Skeleton

HOOK = np.array([[0.0, 0, 0.1], [0.3, 0, 0.1], [0.3, 0.2, 0.1], [0.3, 0.2, -0.25]])


def bent(s: np.ndarray) -> np.ndarray:
    return np.c_[np.sin(np.pi * s), 2 * np.cos(np.pi * s) - 1, 0 * s]


def helical(s: np.ndarray) -> np.ndarray:
    return np.c_[0.5 * np.sin(3 * np.pi * s), 0.5 * np.cos(3 * np.pi * s), 0.5 * s]


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def table(points: np.ndarray, delimiter: str = ",", header: str | None = None) -> str:
    lines = [delimiter.join(repr(float(value)) for value in row) for row in points]
    return "\n".join([*([header] if header is not None else []), *lines]) + "\n"


def refused(source: str | Path, words: str) -> InputError:
    """The refusal: with those words, the file's name and a hint."""
    with pytest.raises(InputError) as caught:
        load_curve(source)
    error = caught.value
    assert words in error.message, error
    assert error.hint
    assert str(error.path).startswith(str(source).replace("-", "stdin", 1) if source == "-" else str(source))
    assert error.exit_code == 2
    return error


@pytest.fixture(scope="module")
def result(
    make_result: Callable[..., Result], fitted: Callable[..., Skeleton], helix: Callable[..., Skeleton]
) -> Result:
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01, name="cable")


# JSON -------------------------------------------------------------------------------------------------------------


def test_a_chain_is_its_joints_unless_the_skeleton_is_asked_for(result: Result, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.json", chain_json.write(result, "cable")["cable.json"])
    chain, named, skeleton = load_curve(path), load_curve(f"{path}#chain"), load_curve(f"{path}#skeleton")
    assert (chain.kind, chain.is_chain, chain.name) == ("chain", True, str(path))
    assert np.array_equal(chain.points, result.chain.joints)
    assert np.array_equal(named.points, chain.points)
    assert (skeleton.kind, skeleton.is_chain) == ("skeleton", False)
    assert np.array_equal(skeleton.points, result.skeleton_points)
    assert chain.length == pytest.approx(result.chain.length)


def test_truth(tmp_path: Path) -> None:
    line = centre_line("helical")
    write_truth(tmp_path / "t.json", line, 0.02)
    curve = load_curve(tmp_path / "t.json")
    assert (curve.kind, curve.is_chain) == ("truth", False)
    assert curve.points == pytest.approx(line.points(1000), abs=1e-9)
    assert curve.length == pytest.approx(line.length, rel=1e-5)


@pytest.mark.parametrize(("units", "scale"), [("mm", 1e-3), ({"length": "cm"}, 1e-2), ("m", 1.0), (None, 1.0)])
def test_units_of_json_are_heeded(tmp_path: Path, units: object, scale: float) -> None:
    content = {"schema": "dlogen.truth/1", "points": (HOOK / scale).tolist()} | ({"units": units} if units else {})
    assert load_curve(written(tmp_path, "t.json", json.dumps(content))).points == pytest.approx(HOOK)


def truth(points: object, **more: object) -> str:
    return json.dumps({"schema": "dlogen.truth/1", "units": "m", "points": points} | more)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"schema": "dlogen.truth/1", "points": [[0, 0', "not valid JSON"),
        ("[" * 10_000, "JSON"),
        ('{"a":' * 100_000, "not valid JSON"),
        (b'{"schema": "\xff\xfe"}', "not valid JSON"),
        ('{"schema": "dlogen.chain/9", "joints": []}', "dlogen.chain/9"),
        ('{"schema": ["dlogen.chain/1"]}', "not a curve"),
        ('{"points": [[0, 0, 0], [1, 1, 1]]}', "schema None"),
        ('{"schema": "dlogen.chain/1"}', "joints is missing"),
        ('{"schema": "dlogen.truth/1", "points": null}', "points is missing"),
        (truth([[0, 0, 0], [1, 0, 0]], units="inch"), "inch"),
        (truth([[0, 0, 0], [1, 0]]), "not a list of points"),
        (truth([[0, 0, "a"]]), "not a list of points"),
        (truth([[0, 0, 10**400], [0, 0, 1]]), "not a list of points"),
        (truth({"x": 1}), "not a list of points"),
        (truth([[0, 0], [1, 0]]), "(2, 2)"),
        (truth([]), "shape"),
        (truth([[0, 0, 0], [0, 0, math.nan], [1, 1, math.inf]]), "2 of 3 points are not finite, the first is number 2"),
        (truth([[0, 0, None], [1, 1, 1]]), "not finite"),
        (truth([[1, 2, 3]]), "1 point in one place"),
        (truth([[1, 2, 3]] * 4), "4 points in one place"),
        (truth([[0, 0, 0], [1e200, 0, 0]]), "1e+200 m"),
    ],
)
def test_json_that_is_no_curve(tmp_path: Path, content: str | bytes, words: str) -> None:
    refused(written(tmp_path, "t.json", content), words)


def test_a_report_is_told_from_a_chain(result: Result, tmp_path: Path) -> None:
    error = refused(written(tmp_path, "cable.report.json", dump_json(report_dict(result))), "report")
    assert "NAME.json" in str(error.hint)


def test_a_part_that_is_not_there(result: Result, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.json", chain_json.write(result, "cable")["cable.json"])
    error = refused(f"{path}#joints", "'joints'")
    assert "chain, skeleton" in str(error.hint)
    refused(f"{written(tmp_path, 'a.csv', table(HOOK))}#skeleton", "'skeleton'")


def test_a_file_whose_name_has_the_mark_itself(tmp_path: Path) -> None:
    path = written(tmp_path, "run#skeleton", table(HOOK))
    assert load_curve(path).kind == "csv"
    assert load_curve(f"{path}#csv").kind == "csv"


# URDF -------------------------------------------------------------------------------------------------------------


def test_our_urdf_has_the_joints_of_the_chain(result: Result, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.urdf", urdf.write(result, "cable")["cable.urdf"])
    curve = load_curve(path)
    assert (curve.kind, curve.is_chain) == ("urdf", True)
    assert curve.points == pytest.approx(result.chain.joints, abs=1e-9)


@pytest.mark.oracle
def test_forward_kinematics_is_that_of_yourdfpy(result: Result, tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    path = written(tmp_path, "arm.urdf", robot(*ARM))
    model = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    expected = [model.get_transform(f"l{i}", "l0")[:3, 3] for i in range(5)]
    assert load_curve(path).points == pytest.approx(np.array(expected), abs=1e-12)


def joint(name: str, parent: str, child: str, origin: str = 'xyz="1 0 0"', kind: str = "revolute") -> str:
    limit = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>' if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin {origin}/>'
        f"{limit}</joint>"
    )


def robot(*joints: str, links: str | None = None, bodies: bool = True) -> str:
    names = dict.fromkeys(word for text in joints for word in text.split('link="')[1:3])
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    made = "".join(f'<link name="{n.split(chr(34))[0]}">{body if bodies else ""}</link>' for n in names)
    return f'<?xml version="1.0"?>\n<robot name="arm">{made if links is None else links}{"".join(joints)}</robot>'


ARM = (
    joint("a", "l0", "l1", 'xyz="0.5 0.1 0" rpy="0.3 -0.7 1.1"'),
    joint("b", "l1", "l2", 'xyz="0 0.4 0.2" rpy="-2 0.4 0.6"'),
    joint("c", "l2", "l3", 'xyz="-0.2 0 0.3" rpy="1.5707963267948966 1.5707963267948966 0"', "fixed"),
    joint("d", "l3", "l4", 'xyz="0.1 0.2 0.3"', "fixed"),
)


def test_urdf_by_hand(tmp_path: Path) -> None:
    # A quarter turn left at the first joint: the second step goes along y; then a quarter roll: z becomes -y.
    text = robot(
        joint("a", "l0", "l1", 'xyz="1 0 0" rpy="0 0 1.5707963267948966"'),
        joint("b", "l1", "l2", 'xyz="2 0 0" rpy="1.5707963267948966 0 0"'),
        joint("c", "l2", "l3", 'xyz="0 0 3"'),
    )
    expected = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [4, 2, 0]]
    assert load_curve(written(tmp_path, "a.urdf", text)).points == pytest.approx(np.array(expected, dtype=float))


def test_the_order_of_joints_in_the_file_does_not_matter(tmp_path: Path) -> None:
    expected = load_curve(written(tmp_path, "a.urdf", robot(*ARM))).points
    for order in itertools.permutations(ARM):
        assert np.array_equal(load_curve(written(tmp_path, "b.urdf", robot(*order))).points, expected)


def test_frames_before_the_first_body_place_the_model(tmp_path: Path) -> None:
    links = '<link name="world"/><link name="base"/><link name="l1"><visual/></link><link name="l2"/>'
    text = robot(
        joint("p", "world", "base", 'xyz="5 0 0"', "fixed"),
        joint("q", "base", "l1", 'xyz="0 5 0"', "fixed"),
        joint("r", "l1", "l2"),
        links=links,
    )
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[5, 5, 0], [6, 5, 0]]


def test_a_model_without_bodies_begins_at_its_root_and_stacked_joints_count_once(tmp_path: Path) -> None:
    text = robot(
        joint("a", "l0", "l1"),
        joint("b", "l1", "l2", 'xyz="0 0 0"'),
        joint("c", "l2", "l3", ""),
        joint("d", "l3", "l4", 'xyz="0 1 0"'),
        bodies=False,
    )
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_frames_fixed_to_a_segment_are_passed_over(tmp_path: Path) -> None:
    side = joint("s", "l1", "camera", 'xyz="0 0 9"', "fixed")
    text = robot(joint("a", "l0", "l1"), side, joint("b", "l1", "l2", 'xyz="0 1 0"'))
    assert load_curve(written(tmp_path, "a.urdf", text)).points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_a_long_chain_does_not_exhaust_the_stack(tmp_path: Path) -> None:
    text = robot(*(joint(f"j{i}", f"l{i}", f"l{i + 1}", 'xyz="0.001 0 0"') for i in range(3000)))
    assert load_curve(written(tmp_path, "a.urdf", text)).points[-1] == pytest.approx([3, 0, 0])


LAUGHS = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"), joint("c", "l1", "l3")), "branches at the link 'l1'"),
        (robot(joint("a", "l0", "l1", kind="fixed"), joint("b", "l0", "l2", kind="fixed")), "branches"),
        (robot(joint("a", "l0", "l1"), joint("b", "l2", "l3")), "2 of 4 have no parent"),
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l0")), "no tree"),
        (robot(joint("a", "l0", "l1"), joint("b", "l2", "l3"), joint("c", "l3", "l2")), "ring"),
        (robot(joint("a", "l0", "l1"), joint("b", "l1", "l2"), joint("c", "l0", "l2")), "1 have several"),
        (robot(joint("a", "l0", "l1"), links='<link name="l0"/>'), "'l1', which is not there"),
        (robot(joint("a", "l0", "l1", 'xyz="1 0"')), "joint 'a' has xyz='1 0'"),
        (robot(joint("a", "l0", "l1", 'rpy="1 0 east"')), "rpy='1 0 east'"),
        (robot(joint("a", "l0", "l1", 'xyz="nan 0 0"')), "nan"),
        (robot('<joint name="a" type="fixed"/>', links='<link name="l0"/>'), "parent and child"),
        (robot(links='<link name="l0"/>'), "1 point in one place"),
        (robot(), "no tree"),
        ("<mujoco><worldbody/></mujoco>", "<mujoco>"),
        (robot(joint("a", "l0", "l1"))[:-20], "not valid XML"),
        (LAUGHS + robot(joint("a", "l0", "l1")).split("\n")[1], "document type"),
        ('<?xml version="1.0" encoding="no-such"?><robot/>', "not valid XML"),
    ],
)
def test_urdf_that_is_no_serial_chain(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.urdf", text), words)


# Tables -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        table(HOOK),
        table(HOOK, ";"),
        table(HOOK, "\t"),
        table(HOOK, "  "),
        table(HOOK, ", "),
        table(HOOK).replace("\n", "\r\n"),
        table(HOOK).replace("\n", ",\n"),
        "\ufeff" + table(HOOK, header="x,y,z"),
        "\n# measured by hand\n\n" + table(HOOK) + "\n\n",
        table(HOOK, header="X,Y,Z"),
        table(HOOK, ";", header='"x";"y";"z"'),
        table(HOOK[:, [2, 0, 1]], header="z,x,y"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], header="s,x,y,z"),
        table(np.c_[HOOK, HOOK], " ", header="x y z vx vy vz"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], " ", header="# s x y z"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], header="# s, x, y, z"),
    ],
)
@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a"])
def test_tables(tmp_path: Path, text: str, name: str) -> None:
    curve = load_curve(written(tmp_path, name, text))
    assert (curve.kind, curve.is_chain) == ("csv", False)
    assert curve.points == pytest.approx(HOOK, abs=1e-15)


def test_a_table_with_words_in_a_column_that_is_not_used(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "name,x,y,z\nstart,0,0,0\nend,1,2,3\n")
    assert load_curve(path).points.tolist() == [[0, 0, 0], [1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0,0,0\n1,1,1,1\n", "4 columns and no header"),
        ("0,0\n1,1\n", "2 columns and no header"),
        ("x,y\n1,1\n", "no columns x, y and z"),
        ("x,y,z,x\n1,1,1,1\n", "once each"),
        ("1,5;2,5;3,5\n1,5;2,5;3,6\n", "no columns x, y and z"),
        ("x,y,z\n0,0,0\n# one\n1,one,1\n", "line 4 is not a point: '1,one,1'"),
        ("x,y,z\n0,0,0\n1,1\n", "line 3 is not a point: '1,1'"),
        ("x,y,z\n", "no rows of numbers"),
        ("# nothing\n", "no rows of numbers"),
        ("0,0,0\n1,nan,1\n", "not finite"),
        ("0,0,0\n", "1 point in one place"),
    ],
)
def test_tables_that_are_no_curve(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.csv", text), words)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6, allow_nan=False)] * 3), min_size=2, max_size=20, unique=True))
def test_tables_keep_every_digit(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, ...]]) -> None:
    points = np.array(rows) + 0.0
    if (points == points[0]).all():
        return
    path = written(tmp_path_factory.mktemp("t"), "a.csv", table(points))
    assert np.array_equal(load_curve(path).points, points)


# PLY --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_vertices_in_file_order(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.ply"
    write_cloud(path, HOOK, encoding=encoding)
    curve = load_curve(path)
    assert (curve.kind, curve.is_chain) == ("ply", False)
    assert curve.points == pytest.approx(HOOK)


def ply(points: np.ndarray, edges: object = (), faces: int = 0, claimed: int | None = None) -> str:
    edges = np.reshape(edges, (-1, 2)).astype(int)
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    if len(edges):
        header += [f"element edge {len(edges) if claimed is None else claimed}"]
        header += ["property int vertex1", "property int vertex2"]
    if faces:
        header += [f"element face {faces}", "property list uchar int vertex_indices"]
    rows = [
        " ".join(map(str, row)) for part in (points.tolist(), edges.tolist(), [[3, 0, 1, 2]] * faces) for row in part
    ]
    return "\n".join([*header, "end_header", *rows, ""])


def test_ply_edges_give_the_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    line = helical(np.linspace(0, 1, 300))
    order = rng.permutation(len(line))  # vertex i of the file is order[i] on the line
    place = np.argsort(order)
    edges = np.stack([place[:-1], place[1:]], axis=1)
    edges = rng.permuted(edges[rng.permutation(len(edges))], axis=1)
    points = load_curve(written(tmp_path, "a.ply", ply(line[order], edges))).points
    assert np.array_equal(points, line if place[0] < place[-1] else line[::-1])


def test_ply_vertices_without_an_edge_are_left_out(tmp_path: Path) -> None:
    points = np.concatenate([[[9.0, 9, 9]], HOOK])
    path = written(tmp_path, "a.ply", ply(points, [[1, 2], [2, 3], [3, 4]]))
    assert np.array_equal(load_curve(path).points, HOOK)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ply(HOOK, [[0, 1], [1, 2], [2, 3], [3, 0]]), "no single open line"),
        (ply(HOOK, [[0, 1], [0, 2], [0, 3]]), "no single open line"),
        (ply(HOOK, [[0, 1], [2, 3]]), "no single open line"),
        (ply(np.tile(HOOK, (2, 1)), [[0, 1], [2, 3], [3, 4], [4, 2]]), "no single open line"),
        (ply(HOOK, [[0, 0], [0, 1]]), "no single open line"),
        (ply(HOOK, [[0, 1], [1, 4]]), "not there"),
        (ply(HOOK, [[0, 1], [1, -1]]), "not there"),
        (ply(HOOK, [[0, 1]], claimed=10**12), "claims 1000000000000"),
        (ply(HOOK, [[0, 1]], claimed=5), "claims 5"),
        (ply(HOOK, [[0, 1]]).replace("vertex2", "to"), "edges cannot be read"),
        (ply(HOOK, faces=1), "mesh"),
        (ply(np.full((3, 3), np.nan)), "not finite"),
        (ply(HOOK)[:60], ""),
    ],
)
def test_ply_that_is_no_curve(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.ply", text), words)


@pytest.mark.parametrize("suffix", ["ply", "csv"])
def test_a_cloud_is_not_taken_for_a_polyline(tmp_path: Path, suffix: str) -> None:
    points = sample_tube(centre_line("bent"), 0.02, 3000, np.random.default_rng(1)).points
    path = tmp_path / f"a.{suffix}"
    write_cloud(path, points) if suffix == "ply" else path.write_text(table(points))
    error = refused(path, "in no order")
    assert "dlogen fit" in str(error.hint)


@pytest.mark.parametrize("count", [100, 5000])
def test_noisy_and_coiled_polylines_are_still_polylines(tmp_path: Path, count: int) -> None:
    rng = np.random.default_rng(2)
    turn = np.linspace(0, 60 * np.pi, count)
    coil = np.c_[0.1 * np.cos(turn), 0.1 * np.sin(turn), 0.01 * turn / (2 * np.pi)]
    for points in (coil, bent(np.linspace(0, 1, count)) + rng.normal(0, 0.002, (count, 3))):
        assert len(load_curve(written(tmp_path, "a.csv", table(points))).points) == count


# Whatever else ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"\n\n", "not a curve"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n", "Git LFS"),
        (b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n", "point cloud"),
        (b"<!DOCTYPE html>\n<html><body>Not Found", "web page"),
        (b"solid cable\nfacet normal 0 0 1\n", "STL"),
        (b"import numpy as np\n", "not a curve"),
        (bytes(range(256)) * 20, "not a curve"),
        (b"\x1f\x8b\x08\x00\x00\x00", "gzip"),
    ],
)
def test_files_of_other_kinds_are_named(tmp_path: Path, content: bytes, words: str) -> None:
    refused(written(tmp_path, "thing.dat", content), words)


def test_the_hint_names_all_kinds(tmp_path: Path) -> None:
    hint = str(refused(written(tmp_path, "a.py", "import numpy\n"), "not a curve").hint)
    assert all(kind in hint for kind in KINDS)


@settings(deadline=None, max_examples=150)
@given(st.binary(max_size=300), st.sampled_from([b"", b"ply\n", b"{", b"<robot>", b"x,y,z\n", b'{"schema": "dlogen.']))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes, start: bytes) -> None:
    path = written(tmp_path_factory.mktemp("f"), "a.csv" if len(data) % 2 else "a.dat", start + data)
    try:
        assert isinstance(load_curve(path), Curve)
    except InputError as error:
        assert error.hint and error.path == str(path)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert "check the path" in str(refused(tmp_path / "none.json", "No such file").hint)
    refused(tmp_path, "cannot read")


def test_stdin(monkeypatch: pytest.MonkeyPatch, result: Result, tmp_path: Path) -> None:
    def pipe(data: bytes, terminal: bool = False) -> None:
        stream = SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: terminal)
        monkeypatch.setattr(sys, "stdin", stream)

    chain = chain_json.write(result, "cable")["cable.json"]
    write_cloud(tmp_path / "a.ply", HOOK)
    for data, kind in (
        (chain, "chain"),
        (table(HOOK).encode(), "csv"),
        (urdf.write(result, "cable")["cable.urdf"], "urdf"),
        ((tmp_path / "a.ply").read_bytes(), "ply"),
        (ply(HOOK, [[0, 1], [1, 2], [2, 3]]).encode(), "ply"),
    ):
        pipe(data)
        curve = load_curve("-")
        assert (curve.kind, curve.name) == (kind, "stdin")
    pipe(chain)
    assert load_curve("-#skeleton").kind == "skeleton"
    pipe(b"")
    refused("-", "empty")
    pipe(b"", terminal=True)
    refused("-", "nothing is piped in")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("text", [table(HOOK), ply(HOOK)])
def test_named_pipes(tmp_path: Path, text: str) -> None:
    import threading

    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert load_curve(pipe).points == pytest.approx(HOOK)
    writer.join()


# Comparing --------------------------------------------------------------------------------------------------------


def test_even_arc_length_takes_the_parameter_out() -> None:
    # One curve sampled in two parameters is about a quarter of the sample spacing from itself; resampled it is not.
    s = np.linspace(0, 1, 1000)
    spacing = arc_lengths(bent(s))[-1] / 999
    assert 0.15 * spacing < mdtw(bent(s), bent(0.8 * s + 0.2 * s**2)).mean < 0.35 * spacing
    fine = np.linspace(0, 1, 20_000)
    assert compare(bent(fine), bent(0.8 * fine + 0.2 * fine**2))["mean"] < 1e-4 * spacing


@pytest.mark.parametrize(("flip_a", "flip_b"), [*itertools.product([False, True], repeat=2)])
def test_compare_finds_the_direction(flip_a: bool, flip_b: bool) -> None:
    s = np.linspace(0, 1, 300)
    a, b = helical(s), helical(s) * [1, 1, 1.1]
    expected = compare(a, b)
    found = compare(a[::-1] if flip_a else a, b[::-1] if flip_b else b)
    assert found["reversed"] is (flip_a != flip_b)
    for key in ("mean", "max", "hausdorff", "length_a", "length_b"):
        assert found[key] == pytest.approx(expected[key])
    assert found["length_difference"] == pytest.approx(found["length_a"] - found["length_b"])
    assert found["length_difference"] < 0


def test_compare_keeps_the_direction_when_told_to_and_in_doubt() -> None:
    line = np.array([[0.0, 0, 0], [1, 0, 0]])
    found = compare(line, line[::-1], 100, align_direction=False)
    assert found["reversed"] is False
    assert found["mean"] > 0.1
    assert found["hausdorff"] == pytest.approx(0, abs=1e-12)
    across = np.array([[0.5, -1.0, 0], [0.5, 1, 0]])
    assert compare(line, across)["reversed"] is False


def test_compare_is_mdtw_of_even_samples() -> None:
    a, b = HOOK, HOOK + 0.01 * np.eye(4, 3)
    found, expected = compare(a, b, 250), mdtw(resample(a, 250), resample(b, 250))
    assert (found["samples"], found["sampling"]) == (250, "even arc length")
    assert (found["mean"], found["std"], found["max"]) == (expected.mean, expected.std, expected.max)
    assert found["path_length"] == len(found["error"]) == len(found["s"]) == len(expected.path)
    assert found["error"] == expected.error.tolist()
    assert json.loads(dump_json(found)) == found


def test_compare_does_not_depend_on_how_often_a_curve_was_sampled(result: Result) -> None:
    joints = result.chain.joints
    once, often = compare(result.skeleton_points, joints), compare(result.skeleton_points, resample(joints, 5001))
    assert often["mean"] == pytest.approx(once["mean"], rel=1e-3)
    assert often["hausdorff"] == pytest.approx(once["hausdorff"], rel=1e-3)
    # The chain was made not to leave the skeleton line by more than e_max, half the radius here.
    assert 0.5 * result.e_max < once["hausdorff"] <= result.e_max


def test_the_public_names_are_the_functions() -> None:
    # A public name that is a module's as well would turn into the module when that is imported.
    import dlogen

    for name in dlogen.__all__:
        if name != "__version__":
            assert callable(getattr(dlogen, name)) and callable(getattr(dlogen, name)), name
    assert dlogen.compare(HOOK, HOOK)["max"] == 0.0
    assert dlogen.load_curve is load_curve
