"""The rows of PLY files: what stands after the header.

Binary rows are mapped into memory by plyfile, which is imported where that is done: it takes 0.6 ms once numpy is
there. Two things stay by hand, with the reason beside them: text, and lists of varying length.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.geometry.mesh_sampling import fan
from dlogen.io.parsing.cloud_header import CUT_OFF, refuse_claim, refuse_missing, refuse_text_claim
from dlogen.io.parsing.cloud_table import Bytes, columns_table, gather
from dlogen.io.parsing.ply_header import BYTE_ORDERS, TYPES, Element, Header
from dlogen.io.parsing.text_rows import TextRows, refuse_rows
from dlogen.types import Array, IntArray

#: The properties to read, by the index of their element.
Wanted = Mapping[int, list[int]]

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
_KEYWORDS = {code: keyword for keyword, code in reversed(TYPES.items())}
# plyfile has no 64-bit integers: eight bytes are eight bytes until they are looked at.
_KEYWORDS["i8"] = _KEYWORDS["u8"] = "double"
# Bytes of a row that numpy has types for.
_LARGEST_RECORD = 1 << 31


class Polygons:
    """Collects the corners of the polygons that a list property has.

    Args:
        element, property: where the list is in the header.
    """

    def __init__(self, element: int, property: int) -> None:
        self.element, self.property = element, property
        self._triangles: list[IntArray] = []

    def add(self, corners: npt.NDArray[Any], counts: IntArray) -> None:
        """(sum of counts,) indices of vertices, and how many corners each polygon has."""
        # What is no index names no vertex; comparing with NaN is False.
        with np.errstate(invalid="ignore"):
            possible = (corners >= 0) & (corners < 1 << 31)
            numbers: IntArray = np.where(possible, corners, -1).astype(np.int32)
        self._triangles.append(fan(numbers, counts))

    @property
    def triangles(self) -> IntArray:
        """(T, 3) indices of vertices as the file has them; -1 for what cannot be one."""
        return np.concatenate([np.empty((0, 3), dtype=np.int32), *self._triangles])


def read_rows(stream: BinaryIO, header: Header, wanted: Wanted, polygons: Polygons | None = None) -> dict[int, Array]:
    """The wanted properties of the wanted elements, as float64 columns. All elements have to be complete.

    Args:
        stream: the file that the header is of.
        header: what it says.
        wanted: which properties, none of them lists.
        polygons: takes what the list has that it names.

    Raises:
        InputError: the file is damaged or cut off.
    """
    is_text = header.encoding == "ascii"
    available = os.fstat(stream.fileno()).st_size - header.size
    for element in header.elements:
        if is_text:
            refuse_text_claim(element.what, element.rows, len(element.properties), available)
        else:
            refuse_claim(element.what, element.rows, element.smallest, available, at_most=element.has_lists)
    stream.seek(header.size)
    if is_text:
        return _read_text(stream, header, wanted, polygons)
    return {
        index: _read_binary(
            stream,
            element,
            wanted.get(index, []),
            header.encoding,
            polygons if polygons is not None and polygons.element == index else None,
        )
        for index, element in enumerate(header.elements)
    }


def _read_text(stream: BinaryIO, header: Header, wanted: Wanted, polygons: Polygons | None) -> dict[int, Array]:
    """By hand: plyfile takes 4 to 6 times as long, and refuses blanks at the ends of rows and "-nan(ind)"."""
    rows = TextRows(stream)
    tables = {}
    for index, element in enumerate(header.elements):
        columns = wanted.get(index, [])
        if not element.properties:
            tables[index] = np.empty((0, 0))
        elif element.has_lists:
            pick = _ListPicker(element, columns, polygons if polygons and polygons.element == index else None)
            tables[index] = rows.collect(element.rows, element.what, len(columns), pick)
        else:
            tables[index] = rows.table(element.rows, element.what, len(element.properties), columns)
    rows.refuse_more(header.elements[-1].what)
    return tables


class _ListPicker:
    """Picks columns from rows of text with lists in them: numbers one after the other -> (k, len(columns))."""

    def __init__(self, element: Element, columns: list[int], polygons: Polygons | None) -> None:
        self.element = element
        self.columns = columns
        self.polygons = polygons

    def __call__(self, values: Array, first: IntArray, row: int) -> Array:
        what = self.element.what
        # Step through the properties, all rows at once: `at` is the number that each row has come to.
        at, end = first[:-1], first[1:]
        out = np.empty((len(at), len(self.columns)))
        for index, item in enumerate(self.element.properties):
            refuse_rows(at >= end, first, row, what, "as many as its lists need")
            if index in self.columns:
                out[:, self.columns.index(index)] = values[at]
            at = at + 1
            if item.count:
                counts = values[at - 1]
                fits = (counts >= 0) & (counts <= end - at) & (counts == np.floor(counts))
                refuse_rows(~fits, first, row, what, "as many as its lists need")
                sizes = counts.astype(np.intp)
                if self.polygons is not None and self.polygons.property == index:
                    before = np.cumsum(sizes) - sizes
                    self.polygons.add(values[np.repeat(at - before, sizes) + np.arange(sizes.sum())], sizes)
                at = at + sizes
        refuse_rows(at != end, first, row, what, "as many as its lists need")
        return out


def _read_binary(
    stream: BinaryIO, element: Element, columns: list[int], encoding: str, polygons: Polygons | None
) -> Array:
    """Columns of the element whose rows begin where the stream is; leaves the stream at their end."""
    if not element.rows or not element.properties:
        return np.empty((0, len(columns)))
    start = stream.tell()
    size = os.fstat(stream.fileno()).st_size
    if not element.has_lists:
        refuse_claim(element.what, element.rows, element.smallest, size - start)
        return columns_table(_mapped(stream, element, columns, encoding, []), element.rows)
    from plyfile import PlyParseError

    order = BYTE_ORDERS[encoding]
    data = _content(stream)
    walk = _RowWalk(data, element, order)
    _, end = walk(start, 0)
    # In practice all lists are of one length (triangles), which plyfile checks for all rows at once when it is told.
    if isinstance(data, np.memmap) and element.rows * (end - start) <= size - start and end - start < _LARGEST_RECORD:
        stream.seek(start)
        try:
            lists = [] if polygons is None else [polygons.property]
            found = _mapped(stream, element, columns + lists, encoding, walk.lengths)
            if polygons is not None:
                corners = found.pop()
                polygons.add(corners.reshape(-1), np.full(element.rows, corners.shape[1]))
            return columns_table(found, element.rows)
        except PlyParseError:
            pass
    # Where they vary, rows are walked one by one by hand. plyfile takes 2.5 to 5 times as long, asks for the memory of
    # a list before it looks whether the file has it (1 GB for 8 bytes that claim 2^27 doubles), and takes a list of -1
    # bytes for all that is left of the file.
    offsets = np.empty((element.rows, len(columns)), dtype=np.intp)
    spans = np.empty((element.rows if polygons else 0, 2), dtype=np.intp)
    end = start
    for row in range(element.rows):
        places, end = walk(end, row)
        if columns:
            offsets[row] = [places[index] for index in columns]
        if polygons:
            spans[row] = places[polygons.property], walk.lengths[polygons.property]
    stream.seek(end)
    if polygons:
        item, sizes = element.properties[polygons.property], spans[:, 1]
        first = np.repeat(spans[:, 0] + int(item.count[1]), sizes)
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        polygons.add(gather(data, first + within * int(item.type[1]), order + item.type), sizes)
    codes = [order + element.properties[column].type for column in columns]
    return columns_table(
        [gather(data, place, code) for place, code in zip(offsets.T, codes, strict=True)], element.rows
    )


def _content(stream: BinaryIO) -> Bytes:
    """All bytes of a file, mapped into memory where the file system can."""
    try:
        return np.memmap(stream, dtype=np.uint8, mode="r")
    except (OSError, ValueError):
        stream.seek(0)
        return np.fromfile(stream, dtype=np.uint8)


def _mapped(
    stream: BinaryIO, element: Element, columns: list[int], encoding: str, lengths: list[int]
) -> list[npt.NDArray[Any]]:
    """Columns of the element whose rows begin where the stream is, mapped into memory by plyfile.

    Args:
        stream: will be at the end of the rows.
        element: its rows, all of which are there.
        columns: the properties.
        encoding: of the file.
        lengths: of the list of each property, the same in all rows; empty where there are no lists.

    Raises:
        PlyParseError: lists have other lengths.
    """
    from plyfile import PlyData

    lines = ["ply", f"format {encoding} 1.0", f"element row {element.rows}"]
    for index, item in enumerate(element.properties):
        kind = f"list {_KEYWORDS[item.count]} {_KEYWORDS[item.type]}" if item.count else _KEYWORDS[item.type]
        lines.append(f"property {kind} p{index}")
    known = {f"p{index}": lengths[index] for index, item in enumerate(element.properties) if item.count}
    spelt = _OtherHeader("\n".join([*lines, "end_header", ""]).encode(), stream)
    rows = PlyData.read(spelt, known_list_len={"row": known})["row"].data
    order = BYTE_ORDERS[encoding]
    return [rows[f"p{column}"].view(order + element.properties[column].type) for column in columns]


class _OtherHeader:
    """A file for plyfile whose rows stand behind a header in the spelling that plyfile takes.

    Files come with blanks at the ends of lines, comments beyond ASCII, 64-bit integers, names with blanks and two
    properties of one name: `ply_header` has read all that, plyfile would refuse it.
    """

    def __init__(self, header: bytes, stream: BinaryIO) -> None:
        self._header = io.BytesIO(header)
        self._stream = stream
        # What maps files into memory asks for these.
        self.tell, self.seek, self.fileno = stream.tell, stream.seek, stream.fileno

    def read(self, size: int = -1) -> bytes:
        return self._header.read(size) or self._stream.read(size)


class _RowWalk:
    """Steps over one row of a binary element."""

    def __init__(self, data: Bytes, element: Element, order: str) -> None:
        self.data = data.data
        self.what = element.what
        self.rows = element.rows
        self.counts = [
            struct.Struct(order + _STRUCT[item.count]) if item.count else None for item in element.properties
        ]
        self.sizes = [int(item.type[1]) for item in element.properties]
        self.lengths = [0] * len(self.sizes)  # of the lists in the row stepped over last

    def __call__(self, at: int, row: int) -> tuple[list[int], int]:
        """First byte of each property in the row that starts at `at`, and the end of the row."""
        places = []
        for index, (count, size) in enumerate(zip(self.counts, self.sizes, strict=True)):
            places.append(at)
            if count is None:
                at += size
                continue
            if at + count.size > len(self.data):
                refuse_missing(self.what, self.rows, row)
            (length,) = count.unpack_from(self.data, at)
            if length < 0:
                raise InputError(f"a list in row {row + 1} of the {self.what} has {length} numbers", CUT_OFF)
            self.lengths[index] = length
            at += count.size + length * size
        if at > len(self.data):
            refuse_missing(self.what, self.rows, row)
        return places, at
