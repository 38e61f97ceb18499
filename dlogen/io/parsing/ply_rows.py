"""The rows of PLY files: what stands after the header."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import BinaryIO

import numpy as np

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_table import (
    CUT_OFF,
    Bytes,
    Place,
    TextRows,
    gather,
    gather_table,
    refuse_claim,
    refuse_rows,
)
from dlogen.io.parsing.ply_elements import Element
from dlogen.types import Array, IntArray

#: The properties to read, by the index of their element.
Wanted = Mapping[int, list[int]]

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


def read_text(stream: BinaryIO, elements: Sequence[Element], wanted: Wanted) -> dict[int, Array]:
    """The wanted properties of the wanted elements, as float64 columns. All rows are checked."""
    rows = TextRows(stream)
    tables = {}
    for index, element in enumerate(elements):
        columns = wanted.get(index, [])
        table = np.empty((element.rows if columns else 0, len(columns)))
        done = 0
        for values, first in rows.take(element.rows if element.properties else 0, element.what):
            block = _text_columns(element, columns, values, first, done)
            if columns:
                table[done : done + len(block)] = block
            done += len(first) - 1
        if element.properties:
            _refuse_missing(element, done)
        tables[index] = table
    rows.refuse_more(elements[-1].what)
    return tables


def _text_columns(element: Element, columns: list[int], values: Array, first: IntArray, row: int) -> Array:
    """Columns of a block of rows: numbers one after the other -> (k, len(columns))."""
    width = len(element.properties)
    if not element.has_lists:
        refuse_rows(np.diff(first) != width, first, row, element.what, str(width))
        return values.reshape(-1, width)[:, columns]
    # Step through the properties, all rows at once: `at` is the number that each row has come to.
    at, end = first[:-1], first[1:]
    out = np.empty((len(at), len(columns)))
    for index, item in enumerate(element.properties):
        refuse_rows(at >= end, first, row, element.what, "as many as its lists need")
        if index in columns:
            out[:, columns.index(index)] = values[at]
        at = at + 1
        if item.count:
            counts = values[at - 1]
            fits = (counts >= 0) & (counts <= end - at) & (counts == np.floor(counts))
            refuse_rows(~fits, first, row, element.what, "as many as its lists need")
            at = at + counts.astype(np.intp)
    refuse_rows(at != end, first, row, element.what, "as many as its lists need")
    return out


def read_binary(stream: BinaryIO, elements: Sequence[Element], wanted: Wanted, order: str) -> dict[int, Array]:
    """The wanted properties of the wanted elements, as float64 columns. All elements have to be complete."""
    data = np.fromfile(stream, dtype=np.uint8)
    tables = {}
    start = 0
    for index, element in enumerate(elements):
        columns = wanted.get(index, [])
        places, start = _places(data, element, order, start, columns)
        codes = [order + element.properties[column].type for column in columns]
        tables[index] = gather_table(data, list(zip(places, codes, strict=True)), element.rows if columns else 0)
    return tables


def _places(data: Bytes, element: Element, order: str, start: int, columns: list[int]) -> tuple[list[Place], int]:
    """Where the columns stand, and where the element ends.

    Lists make rows of unlike size. In practice they are all of one length (triangles), which is checked for all
    rows at once; only where they are not, the rows are walked one by one.
    """
    if element.rows == 0:
        return [(start, 0)] * len(columns), start
    if not element.has_lists:
        refuse_claim(element.what, element.rows, sum(item.smallest for item in element.properties), len(data) - start)
    walk = _RowWalk(data, element, order)
    first, row_end = walk(start, 0)
    stride = row_end - start
    if start + element.rows * stride <= len(data) and all(
        (gather(data, (place, stride), order + item.count, element.rows) == length).all()
        for place, item, length in zip(first, element.properties, walk.lengths, strict=True)
        if item.count
    ):
        return [(first[index], stride) for index in columns], start + element.rows * stride
    offsets = np.empty((element.rows if columns else 0, len(columns)), dtype=np.intp)
    for row in range(element.rows):
        places, start = walk(start, row)
        if columns:
            offsets[row] = [places[index] for index in columns]
    return list(offsets.T), start


class _RowWalk:
    """Steps over one row of a binary element."""

    def __init__(self, data: Bytes, element: Element, order: str) -> None:
        self.data = data.data
        self.element = element
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
                _refuse_missing(self.element, row)
            (length,) = count.unpack_from(self.data, at)
            if length < 0:
                raise InputError(f"a list in row {row + 1} of the {self.element.what} has {length} numbers", CUT_OFF)
            self.lengths[index] = length
            at += count.size + length * size
        if at > len(self.data):
            _refuse_missing(self.element, row)
        return places, at


def _refuse_missing(element: Element, holds: int) -> None:
    """Refuse a file that has fewer rows than its header says."""
    if holds < element.rows:
        raise InputError(f"the header claims {element.rows} {element.what}, the file holds {holds}", CUT_OFF)
