"""PLY files that are written, read by others."""

import numpy as np
import plyfile
import pytest
import trimesh
from ply_bytes import ORDERS, POINTS

from dlogen.io.cloud_files import write_cloud
from dlogen.io.clouds.ply import read, write
from dlogen.types import RawCloud


class TestOracles:
    @pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
    def test_others_read_what_is_written(self, tmp_path, encoding):
        path = tmp_path / "cloud.ply"
        points = POINTS + 5e6
        normals = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0.6, 0, 0.8]])
        write_cloud(path, points, normals=normals, viewpoint=[1, 2, 3], encoding=encoding)
        data = plyfile.PlyData.read(path)
        rows = data["vertex"]
        assert np.array_equal(np.column_stack([rows[name] for name in ("x", "y", "z")]), points)
        assert np.array_equal(np.column_stack([rows[name] for name in ("nx", "ny", "nz")]), normals)
        assert [float(data["camera"][name][0]) for name in ("view_px", "view_py", "view_pz")] == [1, 2, 3]
        loaded = trimesh.load(path)
        assert np.array_equal(loaded.vertices, points)

    @pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
    def test_meshes_that_others_wrote(self, tmp_path, encoding):
        mesh = trimesh.creation.icosphere(subdivisions=2)
        vertices = np.array([tuple(row) for row in mesh.vertices], dtype=[("x", "f8"), ("y", "f8"), ("z", "f8")])
        faces = np.array([(row,) for row in mesh.faces], dtype=[("vertex_indices", "i4", (3,))])
        elements = [plyfile.PlyElement.describe(faces, "face"), plyfile.PlyElement.describe(vertices, "vertex")]
        path = tmp_path / "mesh.ply"
        plyfile.PlyData(elements, text=encoding == "ascii", byte_order=ORDERS.get(encoding, "=")).write(path)
        assert np.array_equal(read(path).points, mesh.vertices)


def test_single_precision_where_it_is_exact(tmp_path):
    path = tmp_path / "cloud.ply"
    write_cloud(path, [[0.5, 0.25, 3.0]])
    assert b"property float x" in path.read_bytes()
    write_cloud(path, [[0.1, 0.25, 3.0]])
    assert b"property double x" in path.read_bytes()


def test_comments_are_kept_on_one_line(tmp_path):
    path = tmp_path / "cloud.ply"
    write(path, RawCloud(POINTS, comments=("two\nlines", "Kabelstück")), "ascii")
    assert read(path).comments == ("two lines", "Kabelstück")
