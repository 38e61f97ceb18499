"""Curves from files (chains, URDF, tables, polylines, synthetic truth), and how two of them differ."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import arc_lengths, hausdorff, resample
from dlogen.geometry.units import METRES
from dlogen.io import sniff
from dlogen.io.curves.serial_urdf import link_origins
from dlogen.io.models.report import CHAIN_SCHEMA, mdtw_dict
from dlogen.io.registry import cloud_formats
from dlogen.types import Array, IntArray

#: Numbers beyond this are no metres on Earth, and their squares would not fit into a float.
_FARTHEST = 1e9
#: A step along an ordered polyline is about as long as the way to the nearest vertex, in a cloud it is far longer.
_DISORDER = 20.0
_FEWEST_TO_JUDGE = 100
_BLANKS = b" \t\r\n"


@dataclass(frozen=True, eq=False)
class Curve:
    """A polyline that was read from a file.

    Attributes:
        points: (K, 3) vertices in order, K >= 2, metres.
        kind: a name in `KINDS`.
        name: the file, as the user called it; "stdin" for "-".
    """

    points: Array
    kind: str
    name: str

    @property
    def is_chain(self) -> bool:
        """Whether the vertices are joints between rigid segments, not samples of a smooth curve."""
        return KINDS[self.kind].is_chain

    @property
    def length(self) -> float:
        """Arc length, metres."""
        return float(arc_lengths(self.points)[-1])


def load_curve(source: str | Path) -> Curve:
    """Read a curve; what kind it is, is told by the content of the file (see `KINDS`).

    Numbers are metres, unless a JSON file says otherwise.

    Args:
        source: the file; "-" is stdin. A file that holds several curves gives the first one; "#KIND" behind the name
            picks another: "cloud.json" is the chain, "cloud.json#skeleton" the skeleton line.

    Raises:
        InputError: there is no such file, it is of no known kind, it is damaged, or its points make no curve.
    """
    name = str(source)
    place, part = _split(name)
    if place == "-":
        name = "stdin" + name[1:]
    try:
        file = _File(name, *_read(place))
        kinds = [kind for kind, entry in KINDS.items() if entry.holds(file)]
        if not kinds:
            raise _unknown(file)
        if part is not None and part not in kinds:
            raise InputError(f"the file holds no curve {part!r}", f"it holds: {', '.join(kinds)}")
        kind = part or kinds[0]
        return Curve(_checked(KINDS[kind].read(file)), kind, name)
    except InputError as error:
        error.path = name
        raise


def compare(a: npt.ArrayLike, b: npt.ArrayLike, samples: int = 1000, *, align_direction: bool = True) -> dict[str, Any]:
    """How two polylines differ: MDTW between samples of both, even in arc length and of the same number.

    Args:
        a: (K, 3) vertices of the first one, metres.
        b: (L, 3) vertices of the second one, metres.
        samples: points on each, at least 2. The paper takes 1000.
        align_direction: take `b` in the direction that gives the smaller mean error, since a scanned object has no
            preferred end; otherwise in the order of its vertices.

    Returns:
        What JSON files hold of it, in metres: `samples`, `reversed` (whether `b` was taken from its end to its start),
        `hausdorff`, `length_a`, `length_b`, `length_difference` (a less b), and all of
        `dlogen.io.models.report.mdtw_dict`.

    Raises:
        ValueError: wrong shapes, no points, coordinates that are not finite, or fewer than 2 samples.
    """
    first, second = resample(a, samples), resample(b, samples)
    error = mdtw(first, second)
    backwards = mdtw(first, second[::-1]) if align_direction else error
    is_reversed = backwards.mean < error.mean
    length_a, length_b = (float(arc_lengths(points)[-1]) for points in (a, b))
    return {
        "samples": samples,
        "reversed": is_reversed,
        "hausdorff": hausdorff(a, b),
        "length_a": length_a,
        "length_b": length_b,
        "length_difference": length_a - length_b,
        **mdtw_dict(backwards if is_reversed else error),
    }


@dataclass(frozen=True, eq=False)
class _File:
    """A file that was read. `path` is None for stdin and pipes, which cannot be read again."""

    name: str
    data: bytes
    path: Path | None

    @cached_property
    def text(self) -> bytes:
        """The content from its first visible character on."""
        return self.data.removeprefix(b"\xef\xbb\xbf").lstrip(_BLANKS)

    @cached_property
    def json(self) -> dict[str, Any]:
        """The content of a JSON file, empty for others."""
        if not self.text.startswith(b"{"):
            return {}
        try:
            content = json.loads(self.text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"this is not valid JSON: {error}", "the file may be cut off: write it again") from None
        assert isinstance(content, dict)
        return content

    @property
    def schema(self) -> str | None:
        """Which schema a JSON file says that it has."""
        schema = self.json.get("schema")
        return None if schema is None else str(schema)

    def points(self, *keys: str) -> Array:
        """Points of a JSON file, in metres: the value at keys[0], keys[1], ..."""
        value: Any = self.json
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if value is None:
            raise InputError(f"{'.'.join(keys)} is missing", "the file is incomplete: write it again")
        units = self.json.get("units", "m")
        units = units.get("length") if isinstance(units, dict) else units
        if units not in METRES:
            raise InputError(f"the units {units!r} are not known", f"known: {', '.join(METRES)}")
        try:
            return np.asarray(value, dtype=float) * METRES[units]
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{'.'.join(keys)} is not a list of points", "points are lists of three numbers") from None

    @contextmanager
    def seekable(self) -> Iterator[Path]:
        """A regular file with this content."""
        if self.path is not None:
            yield self.path
            return
        with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
            copy = Path(folder) / "curve"
            copy.write_bytes(self.data)
            yield copy


def _split(name: str) -> tuple[str, str | None]:
    """ "cloud.json#skeleton" -> "cloud.json", "skeleton"; a file that has such a name goes first."""
    place, mark, part = name.rpartition("#")
    return (name, None) if not mark or not place or Path(name).exists() else (place, part)


def _read(place: str) -> tuple[bytes, Path | None]:
    if place == "-":
        if sys.stdin.isatty():
            raise InputError("nothing is piped in", "pipe a curve: cat cloud.json | dlogen compare - other.json")
        data, path = sys.stdin.buffer.read(), None
    else:
        try:
            data, path = Path(place).read_bytes(), Path(place)
        except OSError as error:
            hint = "check the path" if isinstance(error, FileNotFoundError) else "name a file that you may read"
            raise InputError(f"cannot read: {error.strerror or error}", hint) from error
    if not data:
        raise InputError("the file is empty", "it has 0 bytes: copy or write it again")
    return data, path if path is not None and path.is_file() else None


def _unknown(file: _File) -> InputError:
    """What to say of a file that is of no known kind."""
    known = "known: " + "; ".join(f"{name} ({kind.description})" for name, kind in KINDS.items())
    if file.schema == "dlogen.report/1":
        return InputError("a report holds no curve", "give the chain instead: NAME.json, beside NAME.report.json")
    if file.json:
        return InputError(f"this is JSON with the schema {file.schema!r}, not a curve", known)
    head = file.data[:4096]
    if any(item.sniff(head) for item in cloud_formats()):
        return InputError("this is a point cloud, not a curve", "fit it first: dlogen fit FILE, and compare the chain")
    what = sniff.by_content(head)
    if what is not None and head.startswith(b"version https://git-lfs"):
        return InputError(f"this is {what[0]}", what[1])
    return InputError(f"this is {what[0] if what else 'not a curve that dlogen knows'}", known)


def _checked(points: Array) -> Array:
    """The points, if they make a curve."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"the points have the shape {points.shape}, not (K, 3)", "points are lists of three numbers")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(
            f"{len(bad)} of {len(points)} points are not finite, the first is number {bad[0] + 1}",
            "leave out what is NaN or infinite",
        )
    if len(points) < 2 or (points == points[0]).all():
        raise InputError(
            f"{len(points)} point{'s' if len(points) != 1 else ''} in one place make no curve",
            "a curve has at least two points in different places",
        )
    if np.abs(points).max() > _FARTHEST:
        raise InputError(f"coordinates reach {np.abs(points).max():.3g} m", "write the curve in metres")
    return points


def _ordered(points: Array) -> Array:
    """The points, unless they jump about like those of a cloud."""
    if len(points) < _FEWEST_TO_JUDGE or not np.isfinite(points).all():
        return points
    from scipy.spatial import cKDTree

    step = float(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    nearest = float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))
    if step > _DISORDER * nearest:
        raise InputError(
            f"the points are in no order: from one to the next it is {1e3 * step:.3g} mm, to the nearest "
            f"{1e3 * nearest:.3g} mm (medians)",
            "a curve needs its points in order; of a point cloud make a chain first: dlogen fit",
        )
    return points


# Tables -----------------------------------------------------------------------------------------------------------


def _is_table(file: _File) -> bool:
    """Text whose first row is numbers or names columns x, y, z; or any text that is called .csv."""
    if file.text.startswith((b"{", b"<", b"ply")) or b"\0" in file.data[:4096]:
        return False
    if file.path is not None and file.path.suffix.lower() == ".csv":
        return True
    rows, comments = _rows(file.data[:4096])
    names = {name for row in (*rows[:1], *comments) for name in _names(_fields(row))}
    return {"x", "y", "z"} <= names or (bool(rows) and len(_fields(rows[0])) >= 3 and _are_numbers(_fields(rows[0])))


def _table(file: _File) -> Array:
    """x, y, z separated by commas, semicolons, tabs or blanks; columns of other names (`s`) are left out.

    Without a header there must be three columns. A header may be a comment, as `numpy.savetxt` writes it.
    """
    rows, comments = _rows(file.data)
    first = _fields(rows[0]) if rows else []
    header: list[str] | None = None
    if rows and not _are_numbers(first):
        header, rows = _names(first), rows[1:]
    else:
        named = [_names(_fields(comment)) for comment in comments]
        header = next((names for names in named if len(names) == len(first) and {"x", "y", "z"} <= set(names)), None)
    if not rows:
        raise InputError("the table has no rows of numbers", "give one row of x, y, z for each point")
    if header is None and len(first) != 3:
        raise InputError(
            f"the table has {len(first)} columns and no header", "name the columns in a header, for instance: s,x,y,z"
        )
    if header is not None and any(header.count(axis) != 1 for axis in "xyz"):
        raise InputError(
            f"the table has no columns x, y and z, once each; its first row is {', '.join(header)!r}",
            "name the columns x, y and z; numbers have a point before their decimals",
        )
    columns = [0, 1, 2] if header is None else [header.index(axis) for axis in "xyz"]
    try:
        points = np.loadtxt(rows, delimiter=_delimiter(rows[0]), usecols=columns, ndmin=2, comments=None)
    except ValueError:
        raise _bad_row(file.data, rows, columns) from None
    return _ordered(points)


def _bad_row(data: bytes, rows: list[str], columns: list[int]) -> InputError:
    """What to say of a table with a row that cannot be read, by its line in the file."""
    hint = "give numbers in every row, as many in each"
    lines = [line.strip() for line in data.decode("utf-8-sig", errors="replace").splitlines()]
    for row in rows:
        fields = _split_row(row, _delimiter(rows[0]))
        if len(fields) <= max(columns) or not _are_numbers([fields[column] for column in columns]):
            return InputError(f"line {lines.index(row) + 1} is not a point: {row[:60]!r}", hint)
    return InputError("the table cannot be read", hint)


def _rows(data: bytes) -> tuple[list[str], list[str]]:
    """The rows of a table, and its comments without their mark."""
    lines = [line.strip() for line in data.decode("utf-8-sig", errors="replace").splitlines()]
    return [x for x in lines if x and x[0] != "#"], [x.lstrip("# ") for x in lines if x.startswith("#")]


def _delimiter(row: str) -> str | None:
    """What separates the fields of a row; None is blanks."""
    return next((mark for mark in ";\t," if mark in row), None)


def _fields(row: str) -> list[str]:
    return _split_row(row, _delimiter(row))


def _split_row(row: str, delimiter: str | None) -> list[str]:
    return row.rstrip(delimiter).split(delimiter)


def _names(fields: list[str]) -> list[str]:
    return [field.strip(" \t\"'").lower() for field in fields]


def _are_numbers(fields: list[str]) -> bool:
    try:
        return bool([float(field) for field in fields])
    except ValueError:
        return False


# PLY --------------------------------------------------------------------------------------------------------------


def _ply(file: _File) -> Array:
    """Vertices in file order, or in the order of the element `edge` where there is one (Open3D's line sets)."""
    from dlogen.io.cloud_files import read_raw

    header = file.data[: file.data.find(b"end_header") + 1]
    rows = {name: int(count) for name, count in re.findall(rb"^element\s+(\w+)\s+(\d+)\s*$", header, re.MULTILINE)}
    if rows.get(b"face"):
        raise InputError("this is a mesh, not a curve", "give the points of the centre line in order, or edges")
    with file.seekable() as path:
        points = read_raw(path).points
        if not rows.get(b"edge"):
            return _ordered(points)
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


# The registry -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """A kind of curve that files hold.

    Attributes:
        description: a few words for messages.
        holds: whether a file holds one.
        read: the vertices in order, (K, 3), metres; raises `InputError`.
        is_chain: whether the vertices are joints.
    """

    description: str
    holds: Callable[[_File], bool]
    read: Callable[[_File], Array]
    is_chain: bool = False


def _is_xml(file: _File) -> bool:
    return file.text.startswith(b"<") and not file.text[:16].lower().startswith((b"<html", b"<!doctype html"))


#: All kinds. Of the kinds that a file holds the first is the default.
KINDS: dict[str, Kind] = {
    "chain": Kind(
        f"joints of a chain, {CHAIN_SCHEMA}",
        lambda file: file.schema == CHAIN_SCHEMA,
        lambda f: f.points("joints"),
        True,
    ),
    "skeleton": Kind(
        f"skeleton line, {CHAIN_SCHEMA}",
        lambda file: file.schema == CHAIN_SCHEMA,
        lambda f: f.points("skeleton", "points"),
    ),
    "truth": Kind(
        "synthetic truth, dlogen.truth/1", lambda file: file.schema == "dlogen.truth/1", lambda f: f.points("points")
    ),
    "urdf": Kind("URDF of one serial chain", _is_xml, lambda f: link_origins(f.text), True),
    "ply": Kind("PLY with vertices in order, or edges", lambda file: file.text.startswith(b"ply"), _ply),
    "csv": Kind("table of x, y, z", _is_table, _table),
}
