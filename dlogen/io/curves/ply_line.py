"""Curves from PLY: vertices in order, or edges."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dlogen.errors import InputError
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.order import in_order
from dlogen.io.parsing.ply_header import Header, read_header
from dlogen.io.parsing.ply_rows import read_rows
from dlogen.types import Array, IntArray

_ENDS = ("vertex1", "vertex2")


def read_ply(file: CurveFile) -> Array:
    """Vertices in file order, or in the order of the element `edge` where there is one (Open3D's line sets)."""
    from dlogen.io.cloud_files import read_raw

    with file.seekable() as path, path.open("rb") as stream:
        header = read_header(stream)
        if _rows(header, "face"):
            raise InputError("this is a mesh, not a curve", "give the points of the centre line in order, or edges")
        points = read_raw(path).points
        if not _rows(header, "edge"):
            return in_order(points)
        return points[_along(_edges(stream, header), len(points))]


def _rows(header: Header, name: str) -> int:
    """How many rows an element has."""
    index = header.index(name)
    return 0 if index is None else header.elements[index].rows


def _edges(stream: BinaryIO, header: Header) -> IntArray:
    """(E, 2) indices of vertices."""
    index = header.index("edge")
    assert index is not None
    element = header.elements[index]
    hint = "edges have the properties vertex1, vertex2"
    numbers = {item.name: place for place, item in enumerate(element.properties) if not item.count}
    for name in _ENDS:
        if name not in numbers:
            raise InputError(f"the edges cannot be read: no field of name {name}", hint)
    table = read_rows(stream, header, {index: [numbers[name] for name in _ENDS]})[index]
    wrong = ((table != np.floor(table)) | ~(np.abs(table) < 2**53)).any(axis=1)
    if wrong.any():
        raise InputError(f"the edges cannot be read: row {int(wrong.argmax()) + 1} has no whole numbers", hint)
    return table.astype(np.intp)


def _along(edges: IntArray, count: int) -> IntArray:
    """The vertices that edges join, from one end to the other; the end of the smaller index is the start."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    if edges.min() < 0 or edges.max() >= count:
        raise InputError(f"an edge names a vertex that is not there: there are {count}", "write the file again")
    degree = np.bincount(edges.ravel(), minlength=count)
    ends = np.flatnonzero(degree == 1)
    if len(ends) == 2 and degree.max() <= 2:
        graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
        order = breadth_first_order(graph.tocsr(), ends[0], directed=False, return_predecessors=False)
        if len(order) == np.count_nonzero(degree):
            vertices: IntArray = order.astype(np.intp)
            return vertices
    raise InputError(
        f"the edges make no single open line: it has {len(ends)} free ends and up to {degree.max()} edges at a vertex",
        "give a line from one end to the other, without branches",
    )
