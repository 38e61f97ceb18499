"""PLY files that are damaged, cut off, or claim what they do not hold: refused with the reason, in little memory."""

import re
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import ORDERS, POINTS, ascii_rows, header, vertex

from dlogen.errors import InputError
from dlogen.io.clouds.ply import read

SUFFIX = ".ply"


class TestText:
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
