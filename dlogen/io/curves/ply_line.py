"""Curves from PLY: vertices in order, or edges."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dlogen.errors import InputError
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.order import in_order
from dlogen.types import Array, IntArray


def read_ply(file: CurveFile) -> Array:
    """Vertices in file order, or in the order of the element `edge` where there is one (Open3D's line sets)."""
    from dlogen.io.cloud_files import read_raw

    header = file.data[: file.data.find(b"end_header") + 1]
    rows = {name: int(count) for name, count in re.findall(rb"^element\s+(\w+)\s+(\d+)\s*$", header, re.MULTILINE)}
    if rows.get(b"face"):
        raise InputError("this is a mesh, not a curve", "give the points of the centre line in order, or edges")
    with file.seekable() as path:
        points = read_raw(path).points
        if not rows.get(b"edge"):
            return in_order(points)
        return points[_along(_ply_edges(path), len(points))]


def _ply_edges(path: Path) -> IntArray:
    """(E, 2) indices of vertices."""
    from plyfile import PlyData, PlyParseError

    try:
        edges = PlyData.read(str(path))["edge"]
        return np.stack([edges["vertex1"], edges["vertex2"]], axis=1).astype(np.intp)
    except (PlyParseError, ValueError, KeyError) as error:
        raise InputError(f"the edges cannot be read: {error}", "edges have the properties vertex1, vertex2") from None


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
            return order.astype(np.intp)
    raise InputError(
        f"the edges make no single open line: it has {len(ends)} free ends and up to {degree.max()} edges at a vertex",
        "give a line from one end to the other, without branches",
    )
