"""Headers of PLY files, beside what plyfile makes of them."""

from __future__ import annotations

import io

import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import header, vertex

from dlogen.errors import InputError
from dlogen.io.parsing.ply_header import TYPES, Element, Property, read_header

WORDS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=8)
OLD_TYPES = [name for name in TYPES if name not in ("int64", "uint64")]
COUNTS = [name for name in OLD_TYPES if TYPES[name][0] != "f"]


@st.composite
def elements(draw: st.DrawFn) -> list[tuple[str, int, list[tuple[str, str, str]]]]:
    """Names, rows and (name, type, type of the count or nothing) of some elements."""
    names = draw(st.lists(WORDS, min_size=1, max_size=4, unique=True))
    found = []
    for name in names:
        properties = draw(st.lists(WORDS, max_size=5, unique=True))
        kinds = [(item, draw(st.sampled_from(OLD_TYPES)), draw(st.sampled_from(["", *COUNTS]))) for item in properties]
        found.append((name, draw(st.integers(0, 10**12)), kinds))
    return found


@settings(deadline=None, max_examples=100)
@given(elements(), st.sampled_from(["\n", "\r\n", "\r"]), st.binary(max_size=20))
def test_what_plyfile_finds(content: list, end: str, body: bytes) -> None:
    lines = ["comment made by hand", "obj_info by nobody"]
    for name, rows, properties in content:
        lines.append(f"element {name} {rows}")
        lines += [f"property {f'list {count} ' if count else ''}{kind} {item}" for item, kind, count in properties]
    if end == "\r" and body.startswith(b"\n"):
        body = b""  # plyfile takes it for a part of the line's end
    data = header("binary_big_endian", *lines, end=end)
    found = read_header(io.BytesIO(data + body))
    theirs = plyfile.PlyData._parse_header(io.BytesIO(data + body))
    assert (found.encoding, found.comments, found.size) == (
        "binary_big_endian",
        ("made by hand", "by nobody"),
        len(data),
    )
    assert [(item.name, item.rows) for item in found.elements] == [(item.name, item.count) for item in theirs.elements]
    for ours, other in zip(found.elements, theirs.elements, strict=True):
        assert [(item.name, item.type, item.count) for item in ours.properties] == [
            (item.name, item.val_dtype, getattr(item, "len_dtype", "")) for item in other.properties
        ]


def test_what_plyfile_refuses() -> None:
    lines = [
        "comment Kabelstück ",
        "element two words 0",
        "property int64 a number",
        "property uint64 a number",
        "",
        *vertex(1, "x", "x"),
        "obj_info num_cols 2",
        "obj_info num_rows 3",
        "obj_info num_rows many",
    ]
    data = header("ascii", *lines, end=" \t\n")
    found = read_header(io.BytesIO(data))
    assert found.elements == (
        Element("two words", 0, (Property("a number", "i8"), Property("a number", "u8"))),
        Element("vertex", 1, (Property("x", "f4"), Property("x", "f4"))),
    )
    assert found.comments == ("Kabelstück", "num_rows many")
    assert found.shape == (2, 3)
    assert found.size == len(data)
    with pytest.raises((plyfile.PlyParseError, UnicodeDecodeError)):
        plyfile.PlyData._parse_header(io.BytesIO(data))


def test_a_line_feed_after_a_carriage_return_alone_is_data() -> None:
    data = header("binary_little_endian", *vertex(1, "x"), end="\r")
    assert read_header(io.BytesIO(data + b"\n\n\n\n")).size == len(data)
    assert read_header(io.BytesIO(header("ascii") + b"\r\n")).size == len(header("ascii"))


def test_places_and_sizes() -> None:
    lines = ["element face 7", "property list ushort double index", "property uchar group", *vertex(0, "x", "y")]
    found = read_header(io.BytesIO(header("ascii", *lines, "element face 9")))
    assert (found.index("face"), found.index("vertex"), found.index("edge")) == (0, 1, None)
    face, points, _ = found.elements
    assert (face.smallest, points.smallest) == (2 + 1, 4 + 4)
    assert (face.has_lists, points.has_lists) == (True, False)
    assert (face.what, points.what) == ("'face' rows", "points")
    assert points.names == ["x", "y"]


def test_the_line_that_is_wrong_is_named() -> None:
    lines = ["comment one", *vertex(1, "x"), "property real y"]
    for end in ("\n", "\r\n", "\r"):
        with pytest.raises(InputError, match=r"line 6 \('property real y'\): unknown type 'real'"):
            read_header(io.BytesIO(header("ascii", *lines, end=end)))


def test_other_files() -> None:
    with pytest.raises(InputError, match="its first line is 'solid', not 'ply'"):
        read_header(io.BytesIO(b"solid\nfacet"))
    with pytest.raises(InputError, match="its first line is '', not 'ply'"):
        read_header(io.BytesIO(b""))
