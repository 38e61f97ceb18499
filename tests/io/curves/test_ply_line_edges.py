"""Curves in PLY files whose edges are binary, odd or damaged."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from ply_bytes import ORDERS, POINTS, ascii_rows, header, vertex

from dlogen.errors import InputError
from dlogen.io.curves.curve import load_curve
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.ply_line import read_ply

VERTICES = vertex(4, "x", "y", "z", kind="double")
EDGES = ["element edge 3", "property int vertex1", "property int vertex2", "property uchar red"]
LINE = [(2, 0), (3, 1), (3, 2)]  # 0 2 3 1


def read(tmp_path: Path, data: bytes) -> np.ndarray:
    path = tmp_path / "line.ply"
    path.write_bytes(data)
    return read_ply(CurveFile(path.name, data, path))


@pytest.mark.parametrize("encoding", ORDERS)
def test_binary_edges_as_open3d_writes_them(tmp_path: Path, encoding: str) -> None:
    order = ORDERS[encoding]
    body = POINTS.astype(order + "f8").tobytes() + b"".join(struct.pack(order + "iiB", *edge, 9) for edge in LINE)
    assert np.array_equal(read(tmp_path, header(encoding, *VERTICES, *EDGES) + body), POINTS[[0, 2, 3, 1]])


def test_edges_before_the_vertices_and_between_lists(tmp_path: Path) -> None:
    lines = ["element edge 3", "property list uchar int tags", "property uint vertex2", "property short vertex1"]
    body = b"".join(struct.pack(f"<B{n}iIh", n, *range(n), b, a) for n, (a, b) in enumerate(LINE))
    data = header("binary_little_endian", *lines, *VERTICES) + body + POINTS.tobytes()
    assert np.array_equal(read(tmp_path, data), POINTS[[0, 2, 3, 1]])


def test_text_with_blanks_and_no_path_to_read_again(tmp_path: Path) -> None:
    rows = ascii_rows(POINTS, "  \r\n") + ascii_rows([(*edge, 9) for edge in LINE], " \r\n")
    data = header("ascii", *VERTICES, *EDGES, end="\r\n") + rows
    assert np.array_equal(read_ply(CurveFile("stdin", data, None)), POINTS[[0, 2, 3, 1]])


def test_elements_without_rows_are_as_good_as_none(tmp_path: Path) -> None:
    lines = ["element face 0", "property list uchar int vertex_indices", "element edge 0", "property int a"]
    assert np.array_equal(read(tmp_path, header("ascii", *VERTICES, *lines) + ascii_rows(POINTS)), POINTS)


@pytest.mark.parametrize("first", [b"0.5", b"nan", b"inf", b"1e300", b"-1e17"])
def test_edges_are_whole_numbers(tmp_path: Path, first: bytes) -> None:
    data = header("ascii", *VERTICES, *EDGES) + ascii_rows(POINTS) + b"0 1 9\n" + first + b" 2 9\n2 3 9\n"
    with pytest.raises(InputError, match="the edges cannot be read: row 2 has no whole numbers") as caught:
        read(tmp_path, data)
    assert caught.value.hint == "edges have the properties vertex1, vertex2"


def test_lists_are_no_ends(tmp_path: Path) -> None:
    lines = ["element edge 1", "property int vertex1", "property list uchar int vertex2"]
    data = header("ascii", *VERTICES, *lines) + ascii_rows(POINTS) + b"0 1 1\n"
    with pytest.raises(InputError, match="the edges cannot be read: no field of name vertex2"):
        read(tmp_path, data)


def test_a_damaged_header_is_refused_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "line.ply"
    path.write_bytes(header("ascii", "element vertex many"))
    with pytest.raises(InputError, match=r"PLY header, line 3 \('element vertex many'\)") as caught:
        load_curve(path)
    assert caught.value.path == str(path)
