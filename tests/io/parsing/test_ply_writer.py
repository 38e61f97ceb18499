"""PLY files as they are written: byte by byte, and read by plyfile."""

from __future__ import annotations

import io

import numpy as np
import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import ORDERS, header

from dlogen.io.parsing.ply_writer import write_ply

CODES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
WORDS = {"f8": "double", "f4": "float", "u1": "uchar", "i4": "int", "i1": "char", "u2": "ushort"}


def written(*arguments: object) -> bytes:
    stream = io.BytesIO()
    write_ply(stream, *arguments)
    return stream.getvalue()


@st.composite
def tables(draw: st.DrawFn) -> dict[str, np.ndarray]:
    """Elements of any types and byte orders, of random bytes."""
    found = {}
    for index in range(draw(st.integers(1, 3))):
        codes = draw(st.lists(st.sampled_from(CODES), min_size=1, max_size=5))
        layout = np.dtype([(f"p{i}", draw(st.sampled_from("<>")) + code) for i, code in enumerate(codes)])
        rows = draw(st.integers(0, 5))
        data = np.random.default_rng(draw(st.integers(0, 2**32))).bytes(rows * layout.itemsize)
        found[f"e{index}"] = np.frombuffer(data, dtype=layout)
    return found


@settings(deadline=None, max_examples=150)
@given(tables(), st.sampled_from(["ascii", *ORDERS]), st.sampled_from([(), ("by hand",), ("Kabelstück", "")]))
def test_plyfile_reads_what_is_written(elements: dict, encoding: str, comments: tuple[str, ...]) -> None:
    data = written(elements, encoding, comments, ["num_cols 3"])
    end = data.index(b"end_header\n")
    # Comments beyond ASCII are nothing that plyfile reads, so they are taken out for it.
    head = data[:end].decode().split("\n")
    assert [line for line in head if line.startswith("comment")] == [f"comment {comment}" for comment in comments]
    plain = "\n".join(line for line in head if not line.startswith("comment")).encode() + data[end:]
    found = plyfile.PlyData.read(io.BytesIO(plain))
    assert (found.text, found.obj_info) == (encoding == "ascii", ["num_cols 3"])
    assert encoding == "ascii" or found.byte_order == ORDERS[encoding]
    assert [element.name for element in found] == list(elements)
    for name, rows in elements.items():
        assert found[name].data.dtype.names == rows.dtype.names
        for item in rows.dtype.names:
            assert found[name][item].dtype.str[1:] == rows.dtype[item].str[1:]
            assert np.array_equal(found[name][item], rows[item], equal_nan=True)


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize("comments", [["plain"], ["Kabelstück"]])
def test_bytes_by_hand(encoding: str, comments: list[str]) -> None:
    order = ORDERS[encoding]
    rows = np.array([(0.1, 7), (-2.0, 255)], dtype=[("x", "<f8"), ("red", "u1")])
    empty = np.empty(0, dtype=[("a", ">f4")])
    lines = [f"comment {comments[0]}", "obj_info num_cols 2", "element vertex 2", "property double x"]
    lines += ["property uchar red", "element none 0", "property float a"]
    expected = header(encoding, *lines) + rows.astype([("x", order + "f8"), ("red", "u1")]).tobytes()
    assert written({"vertex": rows, "none": empty}, encoding, comments, ["num_cols 2"]) == expected


def test_text_by_hand() -> None:
    rows = np.array([(0.1, 7), (np.nan, 255)], dtype=[("x", "<f8"), ("red", "u1")])
    lines = ["comment Stück", "element vertex 2", "property double x", "property uchar red"]
    assert written({"vertex": rows}, "ascii", ["Stück"]) == header("ascii", *lines) + b"0.1 7\nnan 255\n"


@pytest.mark.parametrize("encoding", ORDERS)
def test_lists(encoding: str) -> None:
    faces = np.array([((0, 1, 2), 5), ((2, 1, 3), 6)], dtype=[("vertex_indices", "<i4", 3), ("group", "u1")])
    lines = ["element face 2", "property list uchar int vertex_indices", "property uchar group"]
    order = ORDERS[encoding]
    body = np.array([(3, (0, 1, 2), 5), (3, (2, 1, 3), 6)], dtype=[("n", "u1"), ("i", order + "i4", 3), ("g", "u1")])
    assert written({"face": faces}, encoding) == header(encoding, *lines) + body.tobytes()
    for arguments in (("ascii",), (encoding, ["Stück"])):
        with pytest.raises(ValueError, match="lists are written to binary files"):
            written({"face": faces}, *arguments)
