"""PCD files made byte by byte, and pypcd4 as a second opinion."""

import re
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import ascii_rows

from dlogen.errors import InputError
from dlogen.io.cloud_files import write_cloud
from dlogen.io.clouds.pcd import read
from dlogen.io.parsing.lzf import compress
from dlogen.types import RawCloud

SUFFIX = ".pcd"
POINTS = np.array([[0.5, -2.5, 3.0], [4.0, 5.25, -6.0], [1.0, 7.0, 8.5], [9.0, -10.0, 0.0]])
XYZ = {"FIELDS": "x y z", "SIZE": "4 4 4", "TYPE": "F F F", "COUNT": "1 1 1"}


def header(data="ascii", end="\n", **changes):
    """A header for four points; a value of None leaves the line out."""
    lines = {"VERSION": "0.7", **XYZ, "WIDTH": "4", "HEIGHT": "1", "VIEWPOINT": "0 0 0 1 0 0 0", "POINTS": "4"}
    lines |= {"DATA": data}
    lines |= changes
    return "".join(f"{key} {value}{end}" for key, value in lines.items() if value is not None).encode()


def packed(body, size=None, packed_size=None):
    """The body of a binary_compressed file."""
    stream = compress(body)
    size = len(body) if size is None else size
    return struct.pack("<II", len(stream) if packed_size is None else packed_size, size) + stream


class TestVersions:
    @pytest.mark.parametrize("version", ["0.7", ".7", "0.6", ".6", "0.5", ".5", None])
    def test_known(self, read_bytes, version):
        assert np.array_equal(read_bytes(header(VERSION=version) + ascii_rows(POINTS)).points, POINTS)

    @pytest.mark.parametrize("version", ["0.8", "1.0", "seven"])
    def test_unknown(self, read_bytes, version):
        with pytest.raises(InputError, match=re.escape(f"PCD version {version!r} is unknown")):
            read_bytes(b"# .PCD v.8\n" + header(VERSION=version) + ascii_rows(POINTS))

    def test_what_old_files_leave_out(self, read_bytes):
        bare = dict.fromkeys(("SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT"))
        cloud = read_bytes(header("binary", **bare) + POINTS.astype("<f4").tobytes())
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.viewpoint is None
        assert (cloud.width, cloud.height) == (4, 1)

    def test_columns_is_the_old_word_for_fields(self, read_bytes):
        data = b"COLUMNS z y x\nPOINTS 4\nDATA ascii\n" + ascii_rows(POINTS[:, ::-1])
        assert np.array_equal(read_bytes(data).points, POINTS)

    def test_points_may_be_left_to_width_and_height(self, read_bytes):
        cloud = read_bytes(header(POINTS=None, WIDTH="2", HEIGHT="2") + ascii_rows(POINTS))
        assert (cloud.width, cloud.height, cloud.organised) == (2, 2, True)


class TestText:
    @pytest.mark.parametrize("end", ["\n", "\r\n"])
    def test_comments_blanks_and_line_ends(self, read_bytes, end):
        data = f"# .PCD v0.7 - Point Cloud Data file format{end}# made by hand, ®{end}{end}".encode()
        data += header(end=f"  {end}") + ascii_rows(POINTS, f" \t{end}") + f"{end}{end}".encode()
        cloud = read_bytes(data)
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.comments == ("made by hand, ®",)
        assert cloud.encoding == "ascii"

    def test_counts_paddings_and_packed_colours(self, read_bytes):
        fields = {
            "FIELDS": "rgb _ z fpfh y x",
            "SIZE": "4 1 4 4 8 4",
            "TYPE": "U U F F F I",
            "COUNT": "1 3 1 2 1 1",
        }
        rows = b"4278190080 0 0 0 3.5 9 9 -2 1\n16711680 0 0 0 nan 9 9 nan 4\n" * 2
        cloud = read_bytes(header(**fields) + rows)
        assert cloud.points[0].tolist() == [1, -2, 3.5]
        assert np.isnan(cloud.points[1]).tolist() == [False, True, True]
        assert cloud.fields == ("rgb", "_", "z", "fpfh", "y", "x")

    @pytest.mark.parametrize(
        ("rows", "message"),
        [
            (ascii_rows(POINTS[:3]), "claims 4 points, the file holds 3"),
            (ascii_rows(POINTS)[:-5], "row 4 of the points has 2 numbers, not 3"),
            (ascii_rows(POINTS[[0, 1, 2, 3, 3]]), "goes on after the points"),
            (ascii_rows(POINTS).replace(b"4.0", b"four"), "row 2 of the points: 'four' is not a number"),
        ],
    )
    def test_damaged_rows(self, read_bytes, rows, message):
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            read_bytes(header() + rows)
        assert caught.value.hint


class TestBinary:
    @pytest.mark.parametrize("compressed", [False, True])
    @pytest.mark.parametrize("kind", ["I1", "I2", "I4", "I8", "U1", "U2", "U4", "U8", "F4", "F8"])
    def test_types(self, read_bytes, kind, compressed):
        values = np.array([[1, 2, 3], [100, 5, 6], [7, 8, 9], [0, 0, 1]]).astype("<" + kind.lower())
        fields = {"TYPE": " ".join(kind[0] * 3), "SIZE": " ".join(kind[1] * 3)}
        if compressed:
            data = header("binary_compressed", **fields) + packed(np.ascontiguousarray(values.T).tobytes())
        else:
            data = header("binary", **fields) + values.tobytes()
        assert read_bytes(data).points.tolist() == values.tolist()

    @pytest.mark.parametrize("compressed", [False, True])
    def test_fields_in_any_order_with_counts_and_paddings(self, read_bytes, compressed):
        layout = [
            ("n", "<f4", 3),
            ("_", "u1", 5),
            ("z", "<f8"),
            ("rgb", "<u4"),
            ("x", "<f4"),
            ("h", "<i2", 4),
            ("y", "<i4"),
        ]
        layout += [(f"normal_{axis}", "<f4") for axis in "zyx"]
        rows = np.zeros(4, dtype=layout)
        rng = np.random.default_rng(3)
        rows["n"], rows["_"], rows["h"], rows["rgb"] = rng.normal(size=(4, 3)), 255, 7, 0xFF00FF00
        rows["x"], rows["y"], rows["z"] = [1, 2, 3, 4], [-5, 6, 7, 8], [0.1, 0.2, np.nan, 0.4]
        rows["normal_x"], rows["normal_y"], rows["normal_z"] = 0.5, [1, 2, 3, 4], -1
        sizes = [np.dtype(item[1]).itemsize for item in layout]
        fields = {
            "FIELDS": " ".join(item[0] for item in layout),
            "SIZE": " ".join(map(str, sizes)),
            "TYPE": " ".join(np.dtype(item[1]).kind.upper() for item in layout),
            "COUNT": " ".join(str(item[2]) if len(item) > 2 else "1" for item in layout),
        }
        if compressed:
            body = b"".join(rows[name].tobytes() for name in rows.dtype.names)
            # PCL leaves padding out of compressed data, other writers do not.
            bodies = [packed(body), packed(b"".join(rows[name].tobytes() for name in rows.dtype.names if name != "_"))]
        else:
            bodies = [rows.tobytes()]
        for body in bodies:
            cloud = read_bytes(header("binary_compressed" if compressed else "binary", **fields) + body)
            assert np.array_equal(cloud.points, np.column_stack([rows[name] for name in "xyz"]), equal_nan=True)
            assert np.array_equal(cloud.normals, np.column_stack([rows[f"normal_{name}"] for name in "xyz"]))

    @pytest.mark.parametrize("end", ["\n", "\r\n", " \n"])
    def test_trailing_bytes_are_padding(self, read_bytes, end):
        body = POINTS.astype("<f4").tobytes()
        assert np.array_equal(read_bytes(header("binary", end) + body + bytes(99)).points, POINTS)
        body = packed(np.ascontiguousarray(POINTS.T.astype("<f4")).tobytes())
        assert np.array_equal(read_bytes(header("binary_compressed", end) + body + bytes(99)).points, POINTS)

    def test_cut_off(self, read_bytes):
        with pytest.raises(InputError, match="claims 4 points, the file holds 3"):
            read_bytes(header("binary") + POINTS.astype("<f4").tobytes()[:-1])

    def test_compressed_and_cut_off(self, read_bytes):
        body = packed(np.ascontiguousarray(POINTS.T.astype("<f4")).tobytes())
        data = header("binary_compressed")
        with pytest.raises(
            InputError, match=f"{len(body) - 8} compressed bytes are announced, the file holds {len(body) - 9}"
        ):
            read_bytes(data + body[:-1])
        with pytest.raises(InputError, match="claims 4 points, the file ends with it"):
            read_bytes(data + body[:7])

    def test_compressed_data_of_another_size(self, read_bytes):
        body = np.ascontiguousarray(POINTS.T.astype("<f4")).tobytes()
        with pytest.raises(InputError, match="claims 4 points, which take 48 bytes; the compressed data hold 36"):
            read_bytes(header("binary_compressed") + packed(body[:36]))
        with pytest.raises(InputError, match="the compressed data are damaged: it holds 36 bytes, not 48"):
            read_bytes(header("binary_compressed") + packed(body[:36], size=48))


class TestHeader:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"DATA": None}, "there is no line 'DATA'"),
            ({"DATA": "base64"}, "PCD data 'base64' are unknown"),
            ({"FIELDS": None}, "no line 'FIELDS'"),
            ({"FIELDS": "x y"}, "2 FIELDS, but 3 values of SIZE"),
            ({"COUNT": "1 1"}, "3 FIELDS, but 2 values of COUNT"),
            ({"FIELDS": "u v w"}, "no x and no y and no z coordinate (fields: u v w)"),
            ({"FIELDS": "x y i"}, "no z coordinate"),
            ({"SIZE": "4 4 0"}, "the field 'z' has SIZE 0 and COUNT 1"),
            ({"SIZE": "4 4 four"}, "SIZE is 'four', not a whole number"),
            ({"SIZE": "4 4 2"}, "the field 'z' is of TYPE F and SIZE 2"),
            ({"TYPE": "F F Q"}, "the field 'z' is of TYPE Q and SIZE 4"),
            ({"COUNT": "1 1 2"}, "the field 'z' has 2 numbers for each point"),
            ({"WIDTH": "640", "HEIGHT": "480"}, "WIDTH 640 x HEIGHT 480 is 307200, POINTS 4"),
            ({"WIDTH": None, "HEIGHT": "3"}, "WIDTH 1 x HEIGHT 3 is 3, POINTS 4"),
            ({"WIDTH": "-4"}, "WIDTH is '-4', not a whole number"),
            ({"WIDTH": None, "POINTS": None}, "neither 'POINTS' nor 'WIDTH'"),
            ({"VIEWPOINT": "0 0 0"}, "VIEWPOINT is '0 0 0', not seven numbers"),
            ({"VIEWPOINT": "a b c d e f g"}, "not seven numbers"),
            ({"COLOUR": "red"}, "line 10 ('COLOUR red')"),
            ({"HEIGHT": ""}, "line 7 ('HEIGHT ')"),
        ],
    )
    def test_damaged(self, read_bytes, changes, message):
        data = header(**({"DATA": None} | changes if "COLOUR" in changes else changes))
        data += b"DATA ascii\n" if "COLOUR" in changes else b""
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            read_bytes(data + ascii_rows(POINTS))
        assert caught.value.hint

    def test_pose(self, read_bytes):
        cloud = read_bytes(header(VIEWPOINT="1 -2.5 3e6 0 1 0 0") + ascii_rows(POINTS))
        assert cloud.viewpoint.tolist() == [1, -2.5, 3e6, 0, 1, 0, 0]
        assert read_bytes(header(VIEWPOINT="nan 0 0 1 0 0 0") + ascii_rows(POINTS)).viewpoint is None

    def test_no_points(self, read_bytes):
        for data in ("ascii", "binary", "binary_compressed"):
            cloud = read_bytes(header(data, WIDTH="0", HEIGHT="0", POINTS="0"))
            assert cloud.points.shape == (0, 3)


class TestClaims:
    """A header that claims the impossible is refused before memory is asked for."""

    @pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
    @pytest.mark.parametrize(
        "changes",
        [
            {"WIDTH": "1000000000000", "POINTS": "1000000000000"},
            {"FIELDS": "x y z h", "SIZE": "4 4 4 4", "TYPE": "F F F F", "COUNT": "1 1 1 999999999999"},
            {"FIELDS": "x y z h", "SIZE": "4 4 4 999999999999", "TYPE": "F F F F", "COUNT": "1 1 1 999999999999"},
        ],
    )
    def test_points_counts_and_sizes(self, read_bytes, traced, data, changes):
        if data == "ascii" and "COUNT" not in changes:
            changes = changes | {"COUNT": "1 1 1"}
        body = packed(bytes(48)) if data == "binary_compressed" else ascii_rows(POINTS)
        with traced() as peak, pytest.raises(InputError, match="the header claims"):
            read_bytes(header(data, **changes) + body)
        assert peak() < 2_000_000

    def test_compressed_size(self, read_bytes, traced):
        points = 300_000_000
        data = header("binary_compressed", WIDTH=str(points), POINTS=str(points))
        body = packed(bytes(48), size=(12 * points) % 2**32)
        with traced() as peak, pytest.raises(InputError, match=r"compressed bytes cannot hold the 3600000000"):
            read_bytes(data + body)
        assert peak() < 2_000_000

    def test_no_compressed_stream_is_denser_than_the_bound(self, read_bytes):
        points = 200_000
        data = header("binary_compressed", WIDTH=str(points), POINTS=str(points))
        assert not read_bytes(data + packed(bytes(12 * points))).points.any()


class TestOracle:
    """pypcd4 reads what dlogen writes, and the other way round."""

    @pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
    @pytest.mark.parametrize("offset", [0.0, 5e6])
    def test_reads_what_is_written(self, tmp_path, encoding, offset):
        pypcd4 = pytest.importorskip("pypcd4")
        rng = np.random.default_rng(5)
        points, normals = rng.normal(size=(500, 3)) + offset, rng.normal(size=(500, 3))
        path = tmp_path / "cloud.pcd"
        write_cloud(path, points, normals=normals, viewpoint=[1, 2, 3, 0, 1, 0, 0], encoding=encoding)
        cloud = pypcd4.PointCloud.from_path(path)
        names = ("x", "y", "z", "normal_x", "normal_y", "normal_z")
        assert cloud.fields == names
        assert np.array_equal(cloud.numpy(names), np.hstack([points, normals]))
        assert cloud.metadata.viewpoint == (1, 2, 3, 0, 1, 0, 0)

    @pytest.mark.parametrize("encoding", ["ASCII", "BINARY", "BINARY_COMPRESSED"])
    def test_writes_what_is_read(self, tmp_path, encoding):
        pypcd4 = pytest.importorskip("pypcd4")
        rng = np.random.default_rng(6)
        points = rng.normal(size=(500, 3)).astype(np.float32)
        columns = [*points.T, rng.integers(0, 1 << 24, 500).astype(np.float32)]
        path = tmp_path / "cloud.pcd"
        cloud = pypcd4.PointCloud.from_points(columns, ("x", "y", "z", "rgb"), [np.float32] * 4)
        cloud.save(path, getattr(pypcd4.Encoding, encoding))
        # Its ascii writer rounds to ten digits.
        assert read(path).points == pytest.approx(points.astype(float), rel=1e-9, abs=1e-9)


def test_shape_and_gaps_of_organised_clouds(tmp_path):
    path = tmp_path / "cloud.pcd"
    points = POINTS.copy()
    points[2] = np.nan
    write_cloud(path, RawCloud(points, width=2, height=2))
    assert b"WIDTH 2\nHEIGHT 2\n" in path.read_bytes()
    cloud = read(path)
    assert (cloud.width, cloud.height) == (2, 2)
    assert np.array_equal(cloud.points, points, equal_nan=True)


@st.composite
def damaged(draw):
    """A valid file with some bytes changed, cut out or put in."""
    data = draw(st.sampled_from(["ascii", "binary", "binary_compressed"]))
    fields = {"FIELDS": "x y z _ h", "SIZE": "4 4 4 1 2", "TYPE": "F F F U I", "COUNT": "1 1 1 3 2"}
    body = {
        "ascii": b"1 2 3 0 0 0 5 6\n" * 4,
        "binary": bytes(range(76)),
        "binary_compressed": packed(bytes(40) + bytes(range(36))),
    }
    content = header(data, **fields) + body[data]
    junk = st.one_of(
        st.binary(max_size=6),
        st.sampled_from([b"999999999999", b"-1", b"F", b"\n", b" ", b"nan", b"COUNT 1\n", b"\xff\xff\xff\xff", b"#"]),
    )
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(content)))
        content = content[:start] + draw(junk) + content[start + draw(st.integers(0, 8)) :]
    return content[: draw(st.one_of(st.none(), st.integers(0, len(content))))]


@settings(max_examples=400, deadline=None)
@given(damaged())
def test_damage_gives_a_cloud_or_an_input_error(tmp_path_factory, traced, data):
    path = tmp_path_factory.getbasetemp() / "damaged.pcd"
    path.write_bytes(data)
    with traced() as peak:
        try:
            cloud = read(path)
            assert cloud.points.shape == (cloud.width * cloud.height, 3)
        except InputError as error:
            assert error.hint
    assert peak() < 2_000_000
