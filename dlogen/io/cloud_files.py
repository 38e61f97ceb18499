"""Reading point clouds from files and writing them: finds the format, and cleans what it reads."""

from __future__ import annotations

import hashlib
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError, UsageError
from dlogen.io import sniff
from dlogen.io.atomic import write_with
from dlogen.io.registry import CloudFormat, cloud_formats
from dlogen.types import Array, BoolArray, Cloud, Dropped, IntArray, RawCloud, Source

_HEAD = 4096
_CHUNK = 1 << 20
_STDIN = "stdin"
# PCL writes NaN for the few points whose neighbours span no plane. Where there are more, something else is wrong.
_MAX_UNUSABLE_NORMALS = 0.01


def read_raw(path: str | Path) -> RawCloud:
    """A cloud as its file has it: file order, NaN points kept, the file's own units.

    The format is told by the content of the file, and by the end of its name only where the content does not say.

    Args:
        path: the file; "-" is stdin. Pipes work as well.

    Raises:
        InputError: there is no such file, it is not a point cloud, or it is damaged.
    """
    name = _STDIN if str(path) == "-" else str(path)
    try:
        with _as_file(path) as file, file.open("rb") as stream:
            head = stream.read(_HEAD)
            raw = _format_of(head, Path(name).suffix).read(file)
            stream.seek(0)
            return replace(raw, sha256=_sha256(stream))
    except InputError as error:
        error.path = name
        raise
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}", _os_hint(error), path=name) from error


def read_cloud(path: str | Path, *, raw: RawCloud | None = None) -> Cloud:
    """A clean cloud from a PLY or PCD file, in the file's own units. See `clean` for what is left out.

    Args:
        path: the file; "-" is stdin. Pipes work as well.
        raw: what `read_raw` made of it, to save reading it again.

    Raises:
        InputError: there is no such file, it is not a point cloud, it is damaged, or it holds no finite point.
    """
    raw = read_raw(path) if raw is None else raw
    name = _STDIN if str(path) == "-" else Path(path).name
    if not len(raw.points):
        raise InputError("the file holds no points", "its header says 0 points: export the file again", path=path)
    source = Source(
        name=name,
        format=raw.format,
        encoding=raw.encoding,
        fields=raw.fields,
        declared_points=len(raw.points),
        width=raw.width,
        height=raw.height,
        sha256=raw.sha256,
    )
    try:
        cloud = clean(raw.points, raw.normals, viewpoint=raw.viewpoint)
    except InputError as error:
        error.path = path
        raise
    return replace(cloud, source=source)


def clean(
    points: npt.ArrayLike, normals: npt.ArrayLike | None = None, *, viewpoint: npt.ArrayLike | None = None
) -> Cloud:
    """Leave out points that are not finite, and all but the first of points in exactly the same place.

    Args:
        points: (M, 3).
        normals: (M, 3), or None. They are brought to unit length. Those that are not finite or have no length become
            zero; where they are more than 1 %, all are left out.
        viewpoint: (3,) position of the sensor or (7,) its pose tx ty tz qw qx qy qz, or None.

    Returns:
        The points that are left, in their order, with counts of what was left out.

    Raises:
        InputError: wrong shape, or no finite point.
    """
    points = _vectors(points, "points")
    keep = np.flatnonzero(np.isfinite(points).all(axis=1))
    non_finite = len(points) - len(keep)
    if not len(keep):
        what = f"all {len(points)} points are NaN or infinite" if len(points) else "there are no points"
        raise InputError(what, "nothing was in view of the sensor, or the export failed: look at the cloud in a viewer")
    if non_finite:
        points = points[keep]
    first = _first_occurrences(points)
    duplicates = len(points) - len(first)
    if duplicates:
        points, keep = points[first], keep[first]
    unit = None
    if normals is not None:
        normals = _vectors(normals, "normals")
        if len(normals) != len(points) + non_finite + duplicates:
            raise InputError(
                f"there are {len(normals)} normals for {len(points) + non_finite + duplicates} points",
                "give one for each, or none",
            )
        unit = _unit(normals[keep])
    pose = None if viewpoint is None else np.asarray(viewpoint, dtype=np.float64)
    position, orientation = (None, None) if pose is None else (pose[:3], pose[3:] if len(pose) == 7 else None)
    return Cloud(points, unit, position, Dropped(non_finite, duplicates), orientation=orientation)


def write_cloud(
    path: str | Path,
    cloud: Cloud | RawCloud | npt.ArrayLike,
    *,
    encoding: str | None = None,
    normals: npt.ArrayLike | None = None,
    viewpoint: npt.ArrayLike | None = None,
) -> None:
    """Write a cloud; the end of the file's name says in which format. An existing file is replaced.

    Numbers are stored in single precision where that is exact and in double precision elsewhere: what is read back is
    what was written, bit by bit, in every encoding. The same cloud gives the same bytes.

    Args:
        path: the file.
        cloud: a cloud, or (M, 3) points. Of organised clouds (`RawCloud`) the shape and the NaN points are kept.
        encoding: one of the format's encodings (`dlogen formats --json`); by default binary.
        normals: (M, 3), in place of the cloud's own.
        viewpoint: (3,) position of the sensor or (7,) its pose tx ty tz qw qx qy qz, in place of the cloud's own.

    Raises:
        UsageError: unknown format or encoding, arrays of the wrong shape, or the file cannot be written.
    """
    path = Path(path)
    chosen = _format_by_suffix(path.suffix)
    if chosen is None:
        known = " ".join(suffix for item in cloud_formats() for suffix in item.suffixes)
        raise UsageError(f"no cloud format has the name ending {path.suffix!r}", f"known: {known}", path=path)
    if encoding is not None and encoding not in chosen.encodings:
        raise UsageError(
            f"{chosen.name} has no encoding {encoding!r}", f"known: {', '.join(chosen.encodings)}", path=path
        )
    try:
        raw = _raw(cloud, normals, viewpoint)
    except InputError as error:
        raise UsageError(error.message, error.hint, path=path) from None
    write_with({path: lambda place: chosen.write(place, raw, encoding or chosen.encodings[0])})


def cloud_bytes(name: str | Path, cloud: Cloud | RawCloud | npt.ArrayLike, *, encoding: str | None = None) -> bytes:
    """What `write_cloud` would write to a file of that name: for stdout, and for files that are written together.

    Raises:
        UsageError: unknown format or encoding, or arrays of the wrong shape.
    """
    with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
        place = Path(folder) / f"cloud{Path(name).suffix}"
        try:
            write_cloud(place, cloud, encoding=encoding)
        except UsageError as error:
            error.path = name
            raise
        return place.read_bytes()


def _raw(
    cloud: Cloud | RawCloud | npt.ArrayLike, normals: npt.ArrayLike | None, viewpoint: npt.ArrayLike | None
) -> RawCloud:
    """What a format's writer takes."""
    if isinstance(cloud, RawCloud):
        raw = cloud
    elif isinstance(cloud, Cloud):
        raw = RawCloud(cloud.points, cloud.normals)
        viewpoint = _sensor(cloud) if viewpoint is None else viewpoint
    else:
        raw = RawCloud(_vectors(cloud, "points"))
    normals = raw.normals if normals is None else normals
    pose = raw.viewpoint if viewpoint is None else np.asarray(viewpoint, dtype=np.float64)
    if pose is not None:
        pose = np.concatenate([pose, [1.0, 0.0, 0.0, 0.0]]) if pose.shape == (3,) else pose
        if pose.shape != (7,) or not np.isfinite(pose).all():
            raise InputError("the viewpoint is not 3 or 7 finite numbers", "give tx ty tz or tx ty tz qw qx qy qz")
    raw = replace(
        raw,
        points=_vectors(raw.points, "points"),
        normals=None if normals is None else _vectors(normals, "normals"),
        viewpoint=pose,
    )
    if raw.normals is not None and len(raw.normals) != len(raw.points):
        raise InputError(f"there are {len(raw.normals)} normals for {len(raw.points)} points", "give one for each")
    if raw.organised and raw.width * raw.height != len(raw.points):
        raise InputError(f"{raw.width} x {raw.height} pixels do not fit {len(raw.points)} points", "correct the shape")
    return raw


def _sensor(cloud: Cloud) -> Array | None:
    """(3,) position or (7,) pose of the sensor, as far as they are known."""
    if cloud.viewpoint is None or cloud.orientation is None:
        return cloud.viewpoint
    return np.concatenate([cloud.viewpoint, cloud.orientation])


def _vectors(values: npt.ArrayLike, what: str) -> Array:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"the {what} are not numbers: {error}",
            f"give the {what} as an (M, 3) array; dlogen.read_cloud reads a file",
        ) from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(
            f"the {what} have the shape {array.shape}, not (M, 3)", "give x, y and z of each point in a row"
        )
    return array


def _unit(normals: Array) -> Array | None:
    """Normals of unit length; zero where that is impossible, None where that happens too often."""
    with np.errstate(all="ignore"):
        unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    unusable = ~np.isfinite(unit).all(axis=1)
    if unusable.mean() > _MAX_UNUSABLE_NORMALS:
        return None
    unit[unusable] = 0.0
    return unit


def _first_occurrences(points: Array) -> IntArray:
    """Indices, in ascending order, of the first of each set of equal rows.

    Sorts 64-bit hashes of the rows, which is many times faster than sorting the rows. Rows that follow one another in
    that order are compared; two unlike rows of equal hash are as good as impossible, but not a reason to be wrong.
    """
    hashes = _row_hashes(points)
    order = np.argsort(hashes)
    same_row = _same_as_next(points.T, order)
    if (_same_as_next([hashes], order) & ~same_row).any():
        order = np.lexsort(points.T)
        same_row = _same_as_next(points.T, order)
    starts = np.flatnonzero(np.concatenate([[True], ~same_row]))
    return np.sort(np.minimum.reduceat(order, starts))


def _same_as_next(columns: Iterable[npt.NDArray[Any]], order: IntArray) -> BoolArray:
    """(M - 1,) whether the rows of these (M,) columns, taken in that order, are like the row after them."""
    same = np.ones(len(order) - 1, dtype=bool)
    for column in columns:
        values = column[order]
        same &= values[1:] == values[:-1]
    return same


def _row_hashes(points: Array) -> npt.NDArray[np.uint64]:
    """(M,) 64-bit hashes: each column is mixed in by multiplication with an odd constant (that of SplitMix64)."""
    bits = (points + 0.0).view(np.uint64)  # -0.0 + 0.0 is 0.0: they are the same place
    hashes = np.zeros(len(points), dtype=np.uint64)
    for column in bits.T:
        hashes ^= column
        hashes *= np.uint64(0xBF58476D1CE4E5B9)
        hashes ^= hashes >> np.uint64(32)
    return hashes


@contextmanager
def _as_file(path: str | Path) -> Iterator[Path]:
    """A regular file with that content: stdin and pipes go to a temporary one, since readers look at sizes and seek."""
    if str(path) != "-":
        mode = Path(path).stat().st_mode
        if stat.S_ISDIR(mode):
            raise InputError("this is a folder", "name a file in it, or run: dlogen batch FOLDER -o DIR")
        if stat.S_ISREG(mode):
            yield Path(path)
            return
        if not stat.S_ISFIFO(mode):
            raise InputError("this is not an ordinary file", "give a PLY or PCD file, or - for stdin")
    elif sys.stdin.isatty():
        raise InputError("nothing is piped in", "pipe a cloud: cat cloud.ply | dlogen fit -")
    with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
        copy = Path(folder) / "cloud"
        with copy.open("wb") as stream:
            if str(path) == "-":
                _copy(sys.stdin.buffer, stream)
            else:
                with Path(path).open("rb") as pipe:
                    _copy(pipe, stream)
        yield copy


def _copy(source: BinaryIO, target: BinaryIO) -> None:
    while chunk := source.read(_CHUNK):
        target.write(chunk)


def _sha256(stream: BinaryIO) -> str:
    digest = hashlib.sha256()
    while chunk := stream.read(_CHUNK):
        digest.update(chunk)
    return digest.hexdigest()


def _format_of(head: bytes, suffix: str) -> CloudFormat:
    """The format of a file that starts with `head`.

    Raises:
        InputError: it is not a cloud that dlogen reads.
    """
    if not head:
        raise InputError("the file is empty", "it has 0 bytes: copy or export it again")
    for candidate in cloud_formats():
        if candidate.sniff(head):
            return candidate
    known = " and ".join(item.name.upper() for item in cloud_formats())
    what = sniff.by_content(head)
    named = _format_by_suffix(suffix)
    if what is None and named is not None:
        return named
    what = what or sniff.by_suffix(suffix)
    if what is None:
        raise InputError(f"this is not a point cloud that dlogen knows: it reads {known}", "convert it to PLY or PCD")
    raise InputError(f"this is {what[0]}; dlogen reads {known}", what[1])


def _format_by_suffix(suffix: str) -> CloudFormat | None:
    return next((item for item in cloud_formats() if suffix.lower() in item.suffixes), None)


def _os_hint(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "check the path"
    if isinstance(error, PermissionError):
        return "you are not allowed to read it: check its permissions"
    return "check the path and the disk"
