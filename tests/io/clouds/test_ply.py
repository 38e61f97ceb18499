"""What PLY files hold: numbers, line ends, types, lists, the conventions of PCL."""

import struct

import numpy as np
import plyfile
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import ORDERS, POINTS, ascii_rows, header, vertex

from dlogen.errors import InputError
from dlogen.io.clouds.ply import read

SUFFIX = ".ply"


class TestText:
    def test_numbers_are_taken_as_written(self, read_bytes):
        cloud = read_bytes(header("ascii", *vertex(2, "x", "y", "z")) + b"500000.123456 0.1 -1e-3\n1 2 3\n")
        assert cloud.points.tolist() == [[500000.123456, 0.1, -1e-3], [1.0, 2.0, 3.0]]
        assert (cloud.format, cloud.encoding, cloud.width, cloud.height) == ("ply", "ascii", 2, 1)

    @pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
    def test_line_ends_and_trailing_blanks(self, read_bytes, end):
        lines = ["comment  made by  hand ", "obj_info by nobody", *vertex(4, "x", "y", "z")]
        data = header("ascii", *(line + "  " for line in lines), end=" \t" + end)
        data += ascii_rows(POINTS, "  \t" + end) + (end * 3).encode()
        cloud = read_bytes(data)
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.comments == ("made by  hand", "by nobody")

    def test_no_line_end_after_the_last_row(self, read_bytes):
        data = header("ascii", *vertex(4, "x", "y", "z")) + ascii_rows(POINTS).rstrip()
        assert np.array_equal(read_bytes(data).points, POINTS)

    def test_leading_blanks_tabs_and_blank_lines(self, read_bytes):
        data = header("ascii", *vertex(2, "x", "y", "z")) + b"\n  1\t2   3\n\n \t\n4 5 6\n"
        assert read_bytes(data).points.tolist() == [[1, 2, 3], [4, 5, 6]]

    def test_the_spellings_of_not_a_number(self, read_bytes):
        rows = b"nan -nan NaN\nnan(ind) -nan(ind) -nan(snan)\n1.#QNAN -1.#IND 1.#IND00\n"
        rows += b"inf -inf Infinity\n-1.#INF 1.#INF00 2\n"
        points = read_bytes(header("ascii", *vertex(5, "x", "y", "z")) + rows).points
        assert np.isnan(points[:3]).all()
        assert points[3:].tolist() == [[np.inf, -np.inf, np.inf], [-np.inf, np.inf, 2.0]]

    def test_fields_in_any_order_with_normals_among_others(self, read_bytes):
        names = ("red", "nz", "Z", "quality", "NX", "X", "ny", "Y")
        values = {"X": POINTS[:, 0], "Y": POINTS[:, 1], "Z": POINTS[:, 2]}
        normals = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0.6, 0, 0.8]])
        values |= {"NX": normals[:, 0], "ny": normals[:, 1], "nz": normals[:, 2]}
        values |= {"red": np.arange(4.0), "quality": np.full(4, 7.0)}
        cloud = read_bytes(
            header("ascii", *vertex(4, *names)) + ascii_rows(np.column_stack([values[name] for name in names]))
        )
        assert np.array_equal(cloud.points, POINTS)
        assert np.array_equal(cloud.normals, normals)
        assert cloud.fields == names

    def test_lists_before_within_and_after_the_vertices(self, read_bytes):
        data = header(
            "ascii",
            "element strip 2",
            "property list uchar int index",
            "property float weight",
            "element vertex 3",
            "property float x",
            "property list uchar float tags",
            "property float y",
            "property float z",
            "element face 1",
            "property list uchar int vertex_indices",
        )
        data += b"3 0 1 2 0.5\n0 0.25\n" + b"1 2 77 78 2 3\n4 0 5 6\n7 3 9 9 9 8 9\n" + b"3 0 1 2\n"
        assert read_bytes(data).points.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]

    def test_blocks_join_without_a_seam(self, read_bytes):
        rng = np.random.default_rng(1)
        points = rng.normal(size=(70_000, 3))  # 4 MB of text: several blocks
        text = ascii_rows(points.tolist())
        assert np.array_equal(read_bytes(header("ascii", *vertex(70_000, "x", "y", "z")) + text).points, points)

    def test_a_row_longer_than_a_block(self, read_bytes):
        data = header("ascii", *vertex(1, "x", "y", "z"), "element polygon 1", "property list int int index")
        corners = 600_000
        data += b"1 2 3\n" + b" ".join([str(corners).encode(), *[b"12"] * corners]) + b"\n"
        assert read_bytes(data).points.tolist() == [[1, 2, 3]]


class TestBinary:
    @pytest.mark.parametrize("encoding", ORDERS)
    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            ("char", "i1"),
            ("uint8", "u1"),
            ("short", "i2"),
            ("uint16", "u2"),
            ("int", "i4"),
            ("uint32", "u4"),
            ("int64", "i8"),
            ("uint64", "u8"),
            ("float", "f4"),
            ("float32", "f4"),
            ("double", "f8"),
            ("float64", "f8"),
        ],
    )
    def test_types(self, read_bytes, encoding, kind, code):
        values = np.array([[1, 2, 3], [100, 5, 6]], dtype=ORDERS[encoding] + code)
        cloud = read_bytes(header(encoding, *vertex(2, "x", "y", "z", kind=kind)) + values.tobytes())
        assert cloud.points.dtype == np.float64
        assert cloud.points.tolist() == [[1, 2, 3], [100, 5, 6]]

    @pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
    def test_line_ends_before_data_that_look_like_one(self, read_bytes, end):
        # The first number is the bytes 0A 0D 0A 0D.
        values = np.frombuffer(b"\n\r\n\r" * 3, dtype="<f4")
        data = header("binary_little_endian", *vertex(1, "x", "y", "z"), end=end) + values.tobytes()
        assert read_bytes(data).points[0].tolist() == values.tolist()

    def test_signalling_nan(self, read_bytes):
        data = np.array([0x7F800001, 0x3F800000, 0xFF800001], dtype="<u4").tobytes()
        points = read_bytes(header("binary_little_endian", *vertex(1, "x", "y", "z")) + data).points
        assert np.array_equal(points, [[np.nan, 1.0, np.nan]], equal_nan=True)

    def test_trailing_blanks_and_bytes(self, read_bytes):
        data = header("binary_little_endian", *vertex(4, "x", "y", "z", kind="double"), end=" \r\n")
        assert np.array_equal(read_bytes(data + POINTS.tobytes() + b"padding").points, POINTS)

    def test_a_list_is_no_coordinate(self, read_bytes):
        lines = ["element vertex 1", "property list uchar float x", "property float y", "property float z"]
        with pytest.raises(InputError, match="no x coordinate"):
            read_bytes(header("binary_little_endian", *lines) + bytes(13))

    @pytest.mark.parametrize("encoding", ORDERS)
    @pytest.mark.parametrize("lengths", [(3, 3, 3), (3, 4, 0)])
    def test_lists_before_and_after_the_vertices(self, read_bytes, encoding, lengths):
        order = ORDERS[encoding]
        face = ["property list uchar int vertex_indices", "property short group"]
        faces = b"".join(struct.pack(f"{order}B{n}ih", n, *range(n), 7) for n in lengths)
        lines = ["element face 3", *face, *vertex(4, "x", "y", "z", kind="double"), "element more 3", *face]
        data = header(encoding, *lines) + faces + POINTS.astype(order + "f8").tobytes() + faces
        assert np.array_equal(read_bytes(data).points, POINTS)
        with pytest.raises(InputError, match="claims 3 'more' rows, the file holds 2"):
            read_bytes(data[:-1])

    @pytest.mark.parametrize("lengths", [(2, 2, 2, 2), (2, 0, 5, 1)])
    def test_lists_among_the_coordinates(self, read_bytes, lengths):
        lines = ["property double x", "property list ushort float tags", "property double y", "property double z"]
        rows = b"".join(
            struct.pack(f"<dH{n}fdd", x, n, *[9.0] * n, y, z) for n, (x, y, z) in zip(lengths, POINTS, strict=True)
        )
        data = header("binary_little_endian", "element vertex 4", *lines) + rows
        assert np.array_equal(read_bytes(data).points, POINTS)
        with pytest.raises(InputError, match="claims 4 points, the file holds 3"):
            read_bytes(data[:-1])

    def test_other_elements_before_the_vertices(self, read_bytes):
        lines = [
            "element sensor 2",
            "property uchar id",
            "property double gain",
            *vertex(4, "x", "y", "z", kind="double"),
        ]
        data = header("binary_little_endian", *lines) + bytes(18) + POINTS.tobytes()
        assert np.array_equal(read_bytes(data).points, POINTS)


def test_memory_is_a_small_multiple_of_the_file(tmp_path, traced):
    path = tmp_path / "cloud.ply"
    path.write_bytes(header("ascii", *vertex(1_000_000, "x", "y", "z")) + b"1 2 3\n" * 1_000_000)
    with traced() as peak:
        read(path)
    assert peak() < 8 * path.stat().st_size + 50_000_000


NAMES = ("x", "y", "z", "nx", "ny", "nz", "red", "quality")


@settings(deadline=None, max_examples=60)
@given(st.permutations(NAMES), st.lists(st.sampled_from(["f4", "f8"]), min_size=8, max_size=8), st.sampled_from("<>"))
def test_trimesh_and_plyfile_read_the_same(tmp_path_factory, names, codes, order):
    rng = np.random.default_rng(len(names))
    layout = [(name, order + ("u1" if name == "red" else code)) for name, code in zip(names, codes, strict=True)]
    rows = np.empty(7, dtype=layout)
    for name in names:
        rows[name] = rng.uniform(-9, 9, len(rows)) if name != "red" else rng.integers(0, 255, len(rows))
    kinds = {"u1": "uchar", "f4": "float", "f8": "double"}
    lines = ["element vertex 7", *(f"property {kinds[code[1:]]} {name}" for name, code in layout)]
    encoding = {sign: encoding for encoding, sign in ORDERS.items()}[order]
    path = tmp_path_factory.getbasetemp() / "order.ply"
    path.write_bytes(header(encoding, *lines) + rows.tobytes())
    cloud = read(path)
    assert np.array_equal(cloud.points, trimesh.load(path, process=False).vertices)
    theirs = plyfile.PlyData.read(path)["vertex"]
    for parts, found in ((("x", "y", "z"), cloud.points), (("nx", "ny", "nz"), cloud.normals)):
        assert np.array_equal(found, np.column_stack([theirs[part].astype(float) for part in parts]))
        assert np.array_equal(found, np.column_stack([rows[part].astype(float) for part in parts]))
    assert cloud.fields == tuple(names)


class TestPclConventions:
    def test_pose_of_a_camera_element(self, read_bytes):
        # As pcl::PLYWriter writes it: the axes are the rows of the rotation matrix; here 90 degrees about z.
        axes = [f"{axis}_axis{part}" for axis in "xyz" for part in "xyz"]
        names = ["view_px", "view_py", "view_pz", *axes, "focal", "scalex"]
        lines = [*vertex(1, "x", "y", "z"), "element camera 1", *(f"property float {name}" for name in names)]
        cloud = read_bytes(header("ascii", *lines) + b"1 2 3\n" + b"4 5 6 0 -1 0 1 0 0 0 0 1 0 1\n")
        assert cloud.viewpoint == pytest.approx([4, 5, 6, np.sqrt(0.5), 0, 0, np.sqrt(0.5)])

    @pytest.mark.parametrize("axis", ["0", "nan", "1e200", "-1"])
    def test_a_position_without_orientation(self, read_bytes, axis):
        axes = [f"{axis}_axis{part}" for axis in "xyz" for part in "xyz"]
        names = ["view_px", "view_py", "view_pz", *axes]
        lines = [*vertex(1, "x", "y", "z"), "element camera 1", *(f"property float {name}" for name in names)]
        row = f"4 5 6 {axis} 0 0 0 {axis} 0 0 0 {axis}\n".encode()
        assert read_bytes(header("ascii", *lines) + b"1 2 3\n" + row).viewpoint.tolist() == [4, 5, 6, 1, 0, 0, 0]

    def test_other_cameras_are_left_alone(self, read_bytes):
        lines = [*vertex(1, "x", "y", "z"), "element camera 1", "property float view_px"]
        assert read_bytes(header("ascii", *lines) + b"1 2 3\n4\n").viewpoint is None

    @pytest.mark.parametrize(("rows", "shape"), [(2, (2, 2)), (3, (4, 1))])
    def test_organised(self, read_bytes, rows, shape):
        lines = ["obj_info num_cols 2", f"obj_info num_rows {rows}", *vertex(4, "x", "y", "z")]
        cloud = read_bytes(header("ascii", *lines) + ascii_rows(POINTS))
        assert (cloud.width, cloud.height) == shape
        assert cloud.comments == ()


class TestFaces:
    """Triangles of meshes; trimesh as a second opinion."""

    @pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
    @pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
    @pytest.mark.parametrize("lengths", [(3, 3, 3), (4, 4), (3, 4, 2, 0, 4, 1, 3)])
    def test_faces_are_cut_into_triangles(self, read_bytes, encoding, name, lengths):
        faces = [tuple(int(corner) for corner in np.random.default_rng(n).permutation(4)[:n]) for n in lengths]
        lines = [f"element face {len(faces)}", "property short group", f"property list uchar int {name}"]
        lines += ["property list uchar float texcoord", *vertex(4, "x", "y", "z", kind="double")]
        data = header(encoding, *lines)
        if encoding == "ascii":
            data += ascii_rows([(7, len(face), *face, 2, 0.5, 0.25) for face in faces]) + ascii_rows(POINTS)
        else:
            order = ORDERS[encoding]
            for face in faces:
                data += struct.pack(f"{order}hB{len(face)}iB2f", 7, len(face), *face, 2, 0.5, 0.25)
            data += POINTS.astype(order + "f8").tobytes()
        cloud = read_bytes(data)
        expected = [(face[0], *face[k : k + 2]) for face in faces for k in range(1, len(face) - 1)]
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.triangles.tolist() == [list(triangle) for triangle in expected]

    def test_trimesh_reads_the_same(self, tmp_path):
        mesh = trimesh.creation.icosphere(2)
        for encoding in ("ascii", "binary"):
            mesh.export(tmp_path / "ball.ply", encoding=encoding)
            assert np.array_equal(read(tmp_path / "ball.ply").triangles, mesh.faces)

    @pytest.mark.parametrize("row", ["3 0 1 nan", "3 0 1 -7", "3 0 1 1e30", "3 0 1 99"])
    def test_corners_that_are_none_name_no_point(self, read_bytes, row):
        lines = [*vertex(4, "x", "y", "z"), "element face 1", "property list uchar double vertex_indices"]
        cloud = read_bytes(header("ascii", *lines) + ascii_rows(POINTS) + row.encode() + b"\n")
        assert cloud.triangles[0].tolist() in ([0, 1, -1], [0, 1, 99])

    def test_clouds_without_faces_have_no_triangles(self, read_bytes):
        assert read_bytes(header("ascii", *vertex(4, "x", "y", "z")) + ascii_rows(POINTS)).triangles is None
        for lines in (["element face 0", "property list uchar int vertex_indices"], ["element face 0"]):
            data = header("ascii", *vertex(4, "x", "y", "z"), *lines) + ascii_rows(POINTS)
            assert read_bytes(data).triangles is None
