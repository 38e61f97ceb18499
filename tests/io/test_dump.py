from __future__ import annotations

import io

import numpy as np
import pytest

from dlogen.evaluation.shapes import hose_centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.dump import dump_files
from dlogen.pipeline import fit
from dlogen.types import Cloud

trimesh = pytest.importorskip("trimesh")
plyfile = pytest.importorskip("plyfile")


@pytest.fixture(scope="module")
def result(fitted, make_result):
    return make_result(fitted(hose_centre_line()), 0.02, 0.01)


@pytest.fixture(scope="module")
def files(result) -> dict[str, bytes]:
    return dump_files(result)


def vertices(content: bytes) -> np.ndarray:
    """The vertex table, by plyfile."""
    return plyfile.PlyData.read(io.BytesIO(content))["vertex"].data


def xyz(table) -> np.ndarray:
    return np.stack([table[axis] for axis in "xyz"], axis=1)


def csv(content: bytes) -> tuple[list[str], np.ndarray]:
    text = content.decode()
    return text.partition("\n")[0].split(","), np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1, ndmin=2)


def named(files: dict[str, bytes], name: str) -> bytes:
    (found,) = [content for key, content in files.items() if key.partition("_")[2] == name]
    return found


def test_names_are_numbered_in_their_order(files) -> None:
    numbers = [int(name.partition("_")[0]) for name in files]
    assert numbers == list(range(1, len(files) + 1))
    order = ["normals.ply", "projected.ply", "sorted.ply", "unreached.ply", "skeleton.csv", "joints.csv", "chain.csv"]
    assert [name.partition("_")[2] for name in files][: len(order)] == order


def test_normals(files, result) -> None:
    table = vertices(named(files, "normals.ply"))
    assert table.dtype.names == ("x", "y", "z", "nx", "ny", "nz")
    made = result.intermediates[0]
    assert np.array_equal(xyz(table), made.points)
    assert np.array_equal(np.stack([table[f"n{axis}"] for axis in "xyz"], 1), np.stack(list(made.columns.values()), 1))


def test_projected_points_are_the_points_less_the_radius(files, result) -> None:
    surface, projected = vertices(named(files, "normals.ply")), vertices(named(files, "projected.ply"))
    normals = np.stack([surface[f"n{axis}"] for axis in "xyz"], axis=1)
    assert xyz(projected) == pytest.approx(xyz(surface) - 0.02 * normals)


def test_sorted_points_run_along_the_line(files, result) -> None:
    table = vertices(named(files, "sorted.ply"))
    assert (np.diff(table["s"]) >= 0).all()
    assert table["s"][[0, -1]].tolist() == [0, 1]
    # In order of place too: the steps add up to the length of the line, a shuffled order would make them metres.
    steps = np.linalg.norm(np.diff(xyz(table), axis=0), axis=1).sum()
    assert steps == pytest.approx(result.skeleton.length, rel=0.01)
    # Brightness grows with s.
    brightness = sum(table[name].astype(float) for name in ("red", "green", "blue"))
    assert (np.diff(brightness) > -2).all()  # rounded
    assert tuple(table[0])[-3:] == (48, 18, 92)
    assert tuple(table[-1])[-3:] == (253, 231, 37)


def test_no_point_is_lost(files, result) -> None:
    counts = {name: len(vertices(named(files, f"{name}.ply"))) for name in ("projected", "sorted", "unreached")}
    assert counts["sorted"] + counts["unreached"] == counts["projected"] == 400


def test_other_tools_open_them(files) -> None:
    for name, content in files.items():
        if name.endswith(".ply") and len(vertices(content)):
            cloud = trimesh.load(io.BytesIO(content), file_type="ply")
            assert len(cloud.vertices) == len(vertices(content))
    coloured = trimesh.load(io.BytesIO(named(files, "sorted.ply")), file_type="ply")
    assert coloured.colors[0].tolist() == [48, 18, 92, 255]


def test_our_own_reader_opens_them(files, tmp_path) -> None:
    from dlogen.io.clouds.ply import FORMAT

    for name, content in files.items():
        if name.endswith(".ply") and len(vertices(content)):
            path = tmp_path / name
            path.write_bytes(content)
            assert np.array_equal(FORMAT.read(path).points, xyz(vertices(content)))


def test_skeleton(files, result) -> None:
    header, table = csv(named(files, "skeleton.csv"))
    assert header == ["s", "x", "y", "z", "curvature"]
    assert table.shape == (1000, 5)
    assert (np.diff(table[:, 0]) > 0).all()
    assert table[:, 1:4] == pytest.approx(result.skeleton(table[:, 0]))
    assert table[:, 4].max() == pytest.approx(1 / 0.145, rel=0.02)
    assert abs(table[table[:, 4].argmax(), 0] - 0.33) < 0.02


def test_joints_and_chain(files, result) -> None:
    header, joints = csv(named(files, "joints.csv"))
    assert header == ["s", "x", "y", "z"]
    assert joints[:, 1:] == pytest.approx(result.chain.joints, abs=0)
    assert (np.diff(joints[:, 0]) > 0).all()
    header, chain = csv(named(files, "chain.csv"))
    assert header[:4] == ["length", "x", "y", "z"]
    assert chain[:, 1:4] == pytest.approx((joints[:-1, 1:] + joints[1:, 1:]) / 2)
    rotation = chain[:, 4:].reshape(-1, 3, 3)  # r11, r12, ...: rows
    assert header[4:7] == ["r11", "r12", "r13"]
    assert chain[:, 1:4] + chain[:, :1] / 2 * rotation[:, :, 0] == pytest.approx(joints[1:, 1:])


def test_mdtw(files, result) -> None:
    header, table = csv(named(files, "mdtw.csv"))
    assert header == ["s", "error", "skeleton_index", "chain_index"]
    assert table[:, 1].mean() == pytest.approx(result.mdtw.mean)
    assert table[0, 2:].tolist() == [0, 0]
    assert table[-1, 2:].tolist() == [999, 999]


def test_one_segment(fitted, make_result, straight) -> None:
    files = dump_files(make_result(fitted(straight([0, 0, 0], [1, 0, 0]))))
    assert csv(named(files, "chain.csv"))[1].shape == (1, 13)
    assert csv(named(files, "joints.csv"))[1].shape == (2, 4)


def test_the_same_result_gives_the_same_bytes(result, files) -> None:
    assert dump_files(result) == files


@pytest.mark.parametrize("profile", ["paper", "refined"])
def test_dumps_of_real_fits(profile: str) -> None:
    cloud = sample_tube(random_centre_line(3, clearance=0.08), 0.015, 2000, 3, stray_fraction=0.01)
    points = cloud.points + np.array([100.0, 200, 300])
    files = dump_files(fit(Cloud(points), {"profile": profile, "r": 0.015}))
    for name, content in files.items():
        if name.endswith(".ply"):
            table = vertices(content)
            if "s" in table.dtype.names:
                assert (np.diff(table["s"]) >= 0).all()
            if len(table):  # in the cloud's frame again
                assert np.abs(xyz(table) - [100, 200, 300]).max() < 3
        else:
            assert np.isfinite(csv(content)[1]).all()
