"""Reading point clouds from files and writing them: finds the format, and cleans what it reads."""

from __future__ import annotations

import hashlib
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError, UsageError
from dlogen.io import sniff
from dlogen.io.atomic import write_with
from dlogen.io.parsing.text_encoding import plain_text
from dlogen.io.registry import CloudFormat, cloud_formats
from dlogen.stages.clean import clean, vectors
from dlogen.types import Array, Cloud, Mesh, RawCloud, Source

_HEAD = 4096
_CHUNK = 1 << 20
_STDIN = "stdin"


def read_raw(path: str | Path) -> RawCloud:
    """A cloud as its file has it: file order, NaN points kept, the file's own units.

    The format is told by the content of the file, and by the end of its name only where the content does not say.

    Args:
        path: the file; "-" is stdin. Pipes work as well.

    Returns:
        All points (M, 3) in the file's own units, with what else the file says.

    Raises:
        InputError: there is no such file, it is not a point cloud, or it is damaged.

    >>> import dlogen, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/cloud.ply"
    ...     dlogen.write_cloud(path, [[0.0, 0.0, 0.1], [0.0, 0.0, 0.1], [0.2, 0.0, 0.1]])
    ...     cloud = dlogen.read_raw(path)
    >>> cloud.points.shape, cloud.format, cloud.encoding
    ((3, 3), 'ply', 'binary_little_endian')
    """
    name = _STDIN if str(path) == "-" else str(path)
    try:
        with _as_file(path) as file, file.open("rb") as stream, plain_text(file) as text:
            with text.open("rb") as start:
                head = start.read(_HEAD)
            raw = _format_of(head, Path(name).suffix).read(text)
            return replace(raw, sha256=sha256_of(stream))
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

    Returns:
        The clean points (M, 3) in the file's own units, and what was left out.

    Raises:
        InputError: there is no such file, it is not a point cloud, it is damaged, or it holds no finite point.

    >>> import dlogen, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/cloud.ply"
    ...     dlogen.write_cloud(path, [[0.0, 0.0, 0.1], [0.0, 0.0, 0.1], [0.2, 0.0, 0.1]])
    ...     cloud = dlogen.read_cloud(path)
    >>> len(cloud), cloud.dropped.duplicates
    (2, 1)
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
    mesh = None if raw.triangles is None else Mesh(raw.points, raw.triangles)
    return replace(cloud, source=source, mesh=mesh)


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

    >>> import dlogen, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cloud.pcd")
    ...     dlogen.write_cloud(path, [[0.0, 0.0, 0.1], [0.2, 0.0, 0.1]], encoding="ascii")
    ...     path.read_text().splitlines()[-1]
    '0.2 0.0 0.1'
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
        raw = RawCloud(vectors(cloud, "points"))
    normals = raw.normals if normals is None else normals
    pose = raw.viewpoint if viewpoint is None else np.asarray(viewpoint, dtype=np.float64)
    if pose is not None:
        pose = np.concatenate([pose, [1.0, 0.0, 0.0, 0.0]]) if pose.shape == (3,) else pose
        if pose.shape != (7,) or not np.isfinite(pose).all():
            raise InputError("the viewpoint is not 3 or 7 finite numbers", "give tx ty tz or tx ty tz qw qx qy qz")
    raw = replace(
        raw,
        points=vectors(raw.points, "points"),
        normals=None if normals is None else vectors(normals, "normals"),
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
                shutil.copyfileobj(sys.stdin.buffer, stream)
            else:
                with Path(path).open("rb") as pipe:
                    shutil.copyfileobj(pipe, stream)
        yield copy


def sha256_of(stream: BinaryIO) -> str:
    """Hexadecimal SHA-256 of what there is to read; memory is bounded."""
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
