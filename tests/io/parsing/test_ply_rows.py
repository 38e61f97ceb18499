"""Rows of PLY files made byte by byte: any types, any order of the properties, and plyfile as a second opinion."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_bytes import ORDERS, POINTS, header, vertex

from dlogen.errors import InputError
from dlogen.io.parsing import ply_rows
from dlogen.io.parsing.ply_header import TYPES, read_header
from dlogen.io.parsing.ply_rows import read_rows

CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d"}
NEW = ("int64", "uint64")
FACE = "property list uchar int vertex_indices"


def read(path: Path, **wanted: list[str]) -> dict[str, np.ndarray]:
    """Columns of a file by the names of elements and properties."""
    with path.open("rb") as stream:
        found = read_header(stream)
        places = {found.index(name): name for name in wanted}
        numbers = {
            place: [found.elements[place].names.index(item) for item in wanted[name]] for place, name in places.items()
        }
        tables = read_rows(stream, found, numbers)
    assert set(tables) == set(range(len(found.elements)))
    return {name: tables[place] for place, name in places.items()}


class Made:
    """An element whose numbers are random bytes, so that NaN and infinity are among them."""

    def __init__(self, draw: st.DrawFn, name: str, order: str) -> None:
        rng = np.random.default_rng(draw(st.integers(0, 2**32)))
        rows = draw(st.integers(0, 6))
        kinds = draw(st.lists(st.sampled_from(sorted(TYPES)), min_size=1, max_size=6))
        self.lines = [f"element {name} {rows}"]
        self.numbers: dict[str, np.ndarray] = {}
        parts: list[list[bytes]] = []
        for index, kind in enumerate(kinds):
            code = TYPES[kind]
            lengths = draw(st.sampled_from([None, "same", "other"]))
            if lengths is None:
                values = np.frombuffer(rng.bytes(rows * int(code[1])), dtype=order + code)
                self.lines.append(f"property {kind} p{index}")
                with np.errstate(invalid="ignore"):
                    self.numbers[f"p{index}"] = values.astype(float)
                parts.append([values[row : row + 1].tobytes() for row in range(rows)])
                continue
            count = draw(st.sampled_from(["uchar", "short", "uint32", "int64"]))
            same = draw(st.integers(0, 5))
            sizes = [same if lengths == "same" else int(size) for size in rng.integers(0, 5, rows)]
            self.lines.append(f"property list {count} {kind} p{index}")
            parts.append([struct.pack(order + CODES[TYPES[count]], n) + rng.bytes(n * int(code[1])) for n in sizes])
        self.data = b"".join(part for row in zip(*parts, strict=True) for part in row)
        self.has_new = any(word in NEW for line in self.lines for word in line.split())


@st.composite
def files(draw: st.DrawFn) -> tuple[str, list[Made], bytes]:
    """Encoding, elements and content of a binary file; sometimes bytes follow."""
    encoding = draw(st.sampled_from(sorted(ORDERS)))
    made = [Made(draw, f"e{index}", ORDERS[encoding]) for index in range(draw(st.integers(1, 3)))]
    head = header(encoding, *(line for item in made for line in item.lines))
    return encoding, made, head + b"".join(item.data for item in made) + draw(st.binary(max_size=9))


@settings(deadline=None, max_examples=250)
@given(files(), st.randoms(use_true_random=False))
def test_any_types_in_any_order(tmp_path_factory: pytest.TempPathFactory, content: tuple, random) -> None:
    _, made, data = content
    path = tmp_path_factory.getbasetemp() / "rows.ply"
    path.write_bytes(data)
    wanted = {f"e{index}": random.sample(sorted(item.numbers), len(item.numbers)) for index, item in enumerate(made)}
    tables = read(path, **wanted)
    theirs = None if any(item.has_new for item in made) else plyfile.PlyData.read(path, mmap=False)
    for item, (name, names) in zip(made, wanted.items(), strict=True):
        table = tables[name]
        assert table.dtype == np.float64
        assert table.shape[1] == len(names)
        for column, key in zip(table.T, names, strict=True):
            assert np.array_equal(column, item.numbers[key], equal_nan=True)
            if theirs is not None:
                with np.errstate(invalid="ignore"):
                    assert np.array_equal(column, theirs[name][key].astype(float), equal_nan=True)


@settings(deadline=None, max_examples=100)
@given(files(), st.integers(1, 40))
def test_a_file_cut_off_is_refused(tmp_path_factory: pytest.TempPathFactory, content: tuple, lost: int) -> None:
    encoding, made, _ = content
    body = b"".join(item.data for item in made)
    if not body:
        return
    path = tmp_path_factory.getbasetemp() / "cut.ply"
    path.write_bytes(header(encoding, *(line for item in made for line in item.lines)) + body[: -min(lost, len(body))])
    with pytest.raises(InputError, match="the header claims") as caught:
        read(path)
    assert caught.value.hint


def mesh(encoding: str, lengths: list[int], more: bytes = b"") -> bytes:
    """Faces before the points and after them."""
    order = ORDERS[encoding]
    faces = b"".join(struct.pack(f"{order}B{n}i", n, *range(n)) for n in lengths)
    lines = [f"element face {len(lengths)}", FACE, *vertex(4, "x", "y", "z", kind="double")]
    lines += [f"element more {len(lengths)}", FACE]
    return header(encoding, *lines) + faces + POINTS.astype(order + "f8").tobytes() + faces + more


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize(
    ("lengths", "walked"),
    [
        ([3] * 50, 2),  # the first row of each element is looked at, the others by plyfile
        ([0] * 50, 2),
        ([3] * 49 + [4], 102),
        ([3] * 49 + [2], 102),
        ([4] + [3] * 49, 102),
        ([0] + [3] * 49, 102),
    ],
)
def test_only_lists_of_varying_length_are_walked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoding: str, lengths: list[int], walked: int
) -> None:
    path = tmp_path / "mesh.ply"
    path.write_bytes(mesh(encoding, lengths, bytes(50)))
    calls = []
    step = ply_rows._RowWalk.__call__

    def counted(self: ply_rows._RowWalk, at: int, row: int) -> tuple[list[int], int]:
        calls.append(row)
        return step(self, at, row)

    monkeypatch.setattr(ply_rows._RowWalk, "__call__", counted)
    assert np.array_equal(read(path, vertex=["x", "y", "z"])["vertex"], POINTS)
    assert len(calls) == walked


@pytest.mark.parametrize("lengths", [[3, 3, 3], [3, 4, 0]])
def test_file_systems_that_map_nothing_into_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lengths: list[int]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(19, "No such device")

    path = tmp_path / "mesh.ply"
    path.write_bytes(mesh("binary_big_endian", lengths))
    monkeypatch.setattr(mmap, "mmap", refuse)
    assert np.array_equal(read(path, vertex=["z", "x"])["vertex"], POINTS[:, [2, 0]])
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match="claims 3 'more' rows, the file holds 2"):
        read(path)


Traced = Callable[[], AbstractContextManager[Callable[[], int]]]


def test_binary_rows_are_not_copied_into_memory(tmp_path: Path, traced: Traced) -> None:
    path = tmp_path / "cloud.ply"
    rows = np.zeros(400_000, dtype=[("x", "<f8"), ("extra", "V52")])
    rows["x"] = np.arange(len(rows))
    lines = [f"element vertex {len(rows)}", "property double x", *(f"property float q{i}" for i in range(13))]
    faces = np.zeros(400_000, dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"] = 3
    lines += [f"element face {len(faces)}", FACE]
    path.write_bytes(header("binary_little_endian", *lines) + rows.tobytes() + faces.tobytes())
    with traced() as peak:
        table = read(path, vertex=["x"])["vertex"]
    assert np.array_equal(table[:, 0], rows["x"])
    assert table.nbytes <= peak() < table.nbytes + 1_000_000  # the file has 29 MB, the column 3 MB


def test_lists_of_one_row_may_be_long(tmp_path: Path) -> None:
    path = tmp_path / "strip.ply"
    strip = np.arange(100_000, dtype="<i4")
    lines = ["element strip 1", "property list int int index", *vertex(4, "x", "y", "z", kind="double")]
    data = header("binary_little_endian", *lines) + struct.pack("<i", len(strip)) + strip.tobytes() + POINTS.tobytes()
    path.write_bytes(data)
    assert np.array_equal(read(path, vertex=["x", "y", "z"])["vertex"], POINTS)


def test_ascii_lists_and_numbers(tmp_path: Path) -> None:
    path = tmp_path / "lists.ply"
    lines = ["element vertex 2", "property list uchar int tags", "property float x", "property list uchar int more"]
    path.write_bytes(header("ascii", *lines) + b"2 8 9 0.5 0\n0 0.25 1 7\n")
    assert read(path, vertex=["x"])["vertex"].tolist() == [[0.5], [0.25]]
