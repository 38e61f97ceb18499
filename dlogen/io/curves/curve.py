"""Curves from files (chains, URDF, tables, polylines, synthetic truth), and how two of them differ."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlogen.errors import InputError
from dlogen.geometry.polyline import arc_lengths
from dlogen.io import sniff
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.ply_line import read_ply
from dlogen.io.curves.serial_urdf import link_origins
from dlogen.io.curves.table import is_table, read_table
from dlogen.io.registry import cloud_formats
from dlogen.io.report import CHAIN_SCHEMA
from dlogen.types import Array
from dlogen.types.short_repr import ShortRepr
from dlogen.types.texts import counted

#: Numbers beyond this are no metres on Earth, and their squares would not fit into a float.
_FARTHEST = 1e9


@dataclass(frozen=True, eq=False, repr=False)
class Curve(ShortRepr):
    """A polyline that was read from a file.

    Attributes:
        points: (K, 3) vertices in order, K >= 2, metres.
        kind: a name in `KINDS`.
        name: the file, as the user called it; "stdin" for "-".

    >>> import dlogen, numpy as np
    >>> dlogen.Curve(np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.0]]), "csv", "axis.csv").length
    0.5
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

    Returns:
        The vertices in order, (K, 3) metres, and what kind of curve it is.

    Raises:
        InputError: there is no such file, it is of no known kind, it is damaged, or its points make no curve.

    >>> import dlogen, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "axis.csv")
    ...     _ = path.write_text("x,y,z\\n0,0,0\\n0.3,0.4,0\\n")
    ...     curve = dlogen.load_curve(path)
    >>> curve.kind, curve.length
    ('csv', 0.5)
    """
    name = str(source)
    place, part = _split(name)
    if place == "-":
        name = "stdin" + name[1:]
    try:
        file = CurveFile(name, *_read(place))
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


def _unknown(file: CurveFile) -> InputError:
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
            f"{counted(len(points), 'point')} in one place make no curve",
            "a curve has at least two points in different places",
        )
    if np.abs(points).max() > _FARTHEST:
        raise InputError(f"coordinates reach {np.abs(points).max():.3g} m", "write the curve in metres")
    return points


# Tables -----------------------------------------------------------------------------------------------------------


# PLY --------------------------------------------------------------------------------------------------------------


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
    holds: Callable[[CurveFile], bool]
    read: Callable[[CurveFile], Array]
    is_chain: bool = False


def _is_xml(file: CurveFile) -> bool:
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
    "ply": Kind("PLY with vertices in order, or edges", lambda file: file.text.startswith(b"ply"), read_ply),
    "csv": Kind("table of x, y, z", is_table, read_table),
}
