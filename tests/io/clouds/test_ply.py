"""PLY files made byte by byte, so that reader and writer are not tested against one another only."""

import re
import struct

import numpy as np
import plyfile
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.errors import InputError
from dlogen.io.cloud_files import read_raw, write_cloud
from dlogen.io.clouds.ply import read, write
from dlogen.types import RawCloud

POINTS = np.array([[0.1, -2.5, 3.0], [4.0, 5.25, -6.0], [1e-3, 7.0, 8.5], [9.0, -10.0, 0.0]])
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def header(encoding, *lines, end="\n"):
    return end.join(["ply", f"format {encoding} 1.0", *lines, "end_header", ""]).encode()


def vertex(count, *properties, kind="float"):
    return [f"element vertex {count}", *(f"property {kind} {name}" for name in properties)]


def ascii_rows(rows, end="\n"):
    return "".join(" ".join(str(value) for value in row) + end for row in rows).encode()


@pytest.fixture
def read_bytes(tmp_path):
    def read_them(data):
        path = tmp_path / "cloud.ply"
        path.write_bytes(data)
        return read_raw(path)

    return read_them


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

    @pytest.mark.parametrize(
        ("rows", "message"),
        [
            (b"1 2 3\n4 5 6.0000\n", "claims 3 points, the file holds 2"),
            (b"1 2 3\n4 5 6\n", "claims 3 points, the file has room for 2 at most"),
            (b"1 2 3\n4 5 6\n7.0 8\n", "row 3 of the points has 2 numbers, not 3"),
            (b"1 2 3\n4 5 6 7\n8 9\n", "row 2 of the points has 4 numbers"),
            (b"1 2 3\n4 5 six\n7 8 9\n", "row 2 of the points: 'six' is not a number"),
            (b"1 2 3\n4,5 5 6\n7 8 9\n", "row 2 of the points: '4,5' is not a number"),
            (b"1 2 3\n4 5 6\n1-2 8 9\n", "row 3 of the points: '1-2' is not a number"),
            (b"1 2 3\n4 5 6\n7 8 9\n10 11 12\n", "goes on after the points"),
            (b"1 2 3\n4 5 6\n7 \x008 9\n", "row 3 of the points"),
            (b"1 2 3\n4 5 6\n7 8 0x10\n", "'0x10' is not a number"),
        ],
    )
    def test_damaged_rows_are_refused_with_their_number(self, read_bytes, rows, message):
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            read_bytes(header("ascii", *vertex(3, "x", "y", "z")) + rows)
        assert caught.value.hint

    def test_row_numbers_count_over_blocks(self, read_bytes):
        text = b"1 2 3\n" * 400_000 + b"1 2 x\n"
        with pytest.raises(InputError, match="row 400001 of the points: 'x'"):
            read_bytes(header("ascii", *vertex(400_001, "x", "y", "z")) + text)

    def test_a_file_cut_off_in_its_faces(self, read_bytes):
        lines = [*vertex(1, "x", "y", "z"), "element face 2", "property list uchar int vertex_indices"]
        with pytest.raises(InputError, match="claims 2 'face' rows, the file holds 1"):
            read_bytes(header("ascii", *lines) + b"1 2 3\n3 0 1 2\n")
        with pytest.raises(InputError, match="row 2 of the 'face' rows has 3 numbers, not as many as its lists need"):
            read_bytes(header("ascii", *lines) + b"1 2 3\n3 0 1 2\n3 0 1\n")


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

    def test_too_few_points_are_refused_with_the_numbers(self, read_bytes):
        data = header("binary_little_endian", *vertex(5, "x", "y", "z", kind="double")) + POINTS.tobytes()
        with pytest.raises(InputError, match="claims 5 points, the file holds 4"):
            read_bytes(data)

    def test_negative_list_lengths_are_refused(self, read_bytes):
        lines = ["element face 1", "property list char int index", *vertex(1, "x", "y", "z")]
        with pytest.raises(InputError, match="-3 numbers"):
            read_bytes(header("binary_little_endian", *lines) + b"\xfd" + bytes(12))


class TestHeader:
    @pytest.mark.parametrize(
        ("data", "message"),
        [
            (b"ply\nformat ascii 1.0\nelement vertex 1\n", "no line 'end_header'"),
            (b"ply\nformat ascii 1.0\nend_header\n", "no element 'vertex' in the PLY header (elements: none)"),
            (b"ply\nelement vertex 0\nend_header\n", "no line 'format'"),
            (header("ascii", "element face 0"), "elements: face"),
            (header("ascii", "element vertex 0"), "(fields: none)"),
            (header("ascii", *vertex(1, "x", "y")) + b"1 2\n", "no z coordinate (fields: x y)"),
            (header("ascii", *vertex(1, "u", "v")) + b"1 2\n", "no x and no y and no z coordinate"),
            (header("middle_endian", *vertex(0, "x", "y", "z")), "line 2 ('format middle_endian 1.0'): unknown format"),
            (
                header("ascii", *vertex(0, "x", "y", "z", kind="real")),
                "line 4 ('property real x'): unknown type 'real'",
            ),
            (header("ascii", "element vertex many"), "the count is 'many', not a whole number"),
            (header("ascii", "element vertex -1"), "the count is '-1', not a whole number"),
            (header("ascii", "element vertex"), "line 3"),
            (header("ascii", "property float x"), "line 3"),
            (header("ascii", "element vertex 0", "property list float int x"), "whole number"),
            (header("ascii", "element vertex 0", "property"), "line 4"),
            (header("ascii", "element vertex 0", "property list uchar x"), "line 4"),
            (header("ascii", "elephant"), "line 3 ('elephant')"),
            (header("ascii", "format ascii 1.0"), "line 3"),
        ],
    )
    def test_damaged_headers_are_refused(self, read_bytes, data, message):
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            read_bytes(data)
        assert caught.value.hint

    def test_a_header_without_end_is_not_read_for_ever(self, read_bytes):
        with pytest.raises(InputError, match="in its first 1048576 bytes"):
            read_bytes(b"ply\nformat ascii 1.0\n" + b"comment so it goes\n" * 100_000)

    def test_no_points(self, read_bytes):
        cloud = read_bytes(header("binary_little_endian", *vertex(0, "x", "y", "z")))
        assert cloud.points.shape == (0, 3)


class TestClaims:
    """A header that claims the impossible is refused before memory is asked for."""

    @pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
    @pytest.mark.parametrize(
        "lines",
        [
            vertex(10**12, "x", "y", "z"),
            [*vertex(10**12, "x", "y", "z"), "property list uchar int tags"],
            ["element face 1000000000000", "property list uint int index", *vertex(1, "x", "y", "z")],
            [*vertex(1, "x", "y", "z"), "element face 1000000000000", "property list uint int index"],
        ],
    )
    def test_rows(self, read_bytes, traced, encoding, lines):
        data = header(encoding, *lines) + b"1 2 3\n" * 100
        with traced() as peak, pytest.raises(InputError, match="claims 1000000000000 "):
            read_bytes(data)
        assert peak() < 2_000_000

    @pytest.mark.parametrize("before", [True, False])
    def test_list_lengths(self, read_bytes, traced, before):
        face = ["element face 2", "property list uint double index"]
        points = vertex(1, "x", "y", "z")
        body = [struct.pack("<I", 2**32 - 1) * 2, bytes(12)]
        lines, body = ([*face, *points], body) if before else ([*points, *face], body[::-1])
        data = header("binary_little_endian", *lines) + b"".join(body)
        with traced() as peak, pytest.raises(InputError, match="claims 2 'face' rows, the file holds 0"):
            read_bytes(data)
        assert peak() < 2_000_000

    def test_elements_without_properties_take_no_time(self, read_bytes):
        lines = ["element nothing 1000000000000", *vertex(1, "x", "y", "z")]
        assert len(read_bytes(header("ascii", *lines) + b"1 2 3\n").points) == 1
        assert len(read_bytes(header("binary_little_endian", *lines) + bytes(12)).points) == 1


def test_memory_is_a_small_multiple_of_the_file(tmp_path, traced):
    path = tmp_path / "cloud.ply"
    path.write_bytes(header("ascii", *vertex(1_000_000, "x", "y", "z")) + b"1 2 3\n" * 1_000_000)
    with traced() as peak:
        read(path)
    assert peak() < 8 * path.stat().st_size + 50_000_000


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


@st.composite
def damaged(draw):
    """A valid file with some bytes changed, cut out or put in."""
    encoding = draw(st.sampled_from(["ascii", *ORDERS]))
    order = ORDERS.get(encoding, "<")
    lines = [
        "element face 2",
        "property list uchar int vertex_indices",
        *vertex(4, "x", "y", "z", kind="double"),
        "property uchar red",
        "element camera 1",
        "property list int short tags",
    ]
    data = header(encoding, *lines)
    if encoding == "ascii":
        data += b"3 0 1 2\n4 0 1 2 3\n" + ascii_rows(np.column_stack([POINTS, np.arange(4)])) + b"2 5 6\n"
    else:
        rows = np.empty(4, dtype=[("p", order + "f8", 3), ("c", "u1")])
        rows["p"], rows["c"] = POINTS, np.arange(4)
        data += (
            struct.pack(f"{order}B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 3)
            + rows.tobytes()
            + struct.pack(f"{order}i2h", 2, 5, 6)
        )
    junk = st.one_of(
        st.binary(max_size=6),
        st.sampled_from([b"999999999999", b"-1", b"list", b"\n", b" ", b"nan", b"property int q\n", b"element e 3\n"]),
    )
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(data)))
        data = data[:start] + draw(junk) + data[start + draw(st.integers(0, 8)) :]
    return data[: draw(st.one_of(st.none(), st.integers(0, len(data))))]


@settings(max_examples=400, deadline=None)
@given(damaged())
def test_damage_gives_a_cloud_or_an_input_error(tmp_path_factory, traced, data):
    path = tmp_path_factory.getbasetemp() / "damaged.ply"
    path.write_bytes(data)
    with traced() as peak:
        try:
            cloud = read(path)
            assert cloud.points.shape == (cloud.width * cloud.height, 3)
        except InputError as error:
            assert error.hint
    assert peak() < 2_000_000
