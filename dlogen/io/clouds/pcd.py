"""PCD, the point cloud files of the Point Cloud Library, versions 0.5 to 0.7: ascii, binary, binary_compressed.

https://pointclouds.org/documentation/tutorials/pcd_file_format.html
Read as PCL does where files leave something out: SIZE is 4, TYPE is F, COUNT is 1, HEIGHT is 1.
Written: coordinates (and normals) as F 4 where that is exact and as F 8 elsewhere, so nothing is lost.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from dlogen.errors import InputError, UsageError
from dlogen.io.parsing.cloud_header import (
    CUT_OFF,
    DAMAGED,
    MAX_HEADER,
    bad_line,
    endless,
    refuse_claim,
    refuse_text_claim,
    shorten,
    whole_number,
)
from dlogen.io.registry import CloudFormat

if TYPE_CHECKING:
    from dlogen.types import Array, RawCloud

_KEYWORDS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_TYPES = {
    ("I", 1): "i1",
    ("I", 2): "<i2",
    ("I", 4): "<i4",
    ("I", 8): "<i8",
    ("U", 1): "u1",
    ("U", 2): "<u2",
    ("U", 4): "<u4",
    ("U", 8): "<u8",
    ("F", 4): "<f4",
    ("F", 8): "<f8",
}
_TITLE = ".PCD v0.7 - Point Cloud Data file format"


@dataclass(frozen=True)
class _Field:
    name: str
    size: int  # in bytes, of one number
    type: str
    count: int

    @property
    def bytes(self) -> int:
        return self.size * self.count

    @property
    def code(self) -> str:
        """Numpy's code for a coordinate."""
        name, kind = shorten(self.name), shorten(self.type)
        if self.count != 1:
            raise InputError(f"the field {name!r} has {self.count} numbers for each point", DAMAGED)
        if (self.type, self.size) not in _TYPES:
            raise InputError(f"the field {name!r} is of TYPE {kind} and SIZE {self.size}: unknown", DAMAGED)
        return _TYPES[self.type, self.size]


@dataclass(frozen=True)
class _Header:
    fields: tuple[_Field, ...]
    width: int
    height: int
    viewpoint: tuple[float, ...] | None
    encoding: str
    comments: tuple[str, ...]
    size: int  # in bytes

    @property
    def points(self) -> int:
        return self.width * self.height


def sniff(head: bytes) -> bool:
    """Whether a file that starts like this is a PCD file."""
    for line in head.splitlines():
        words = line.split()
        if words and not words[0].startswith(b"#"):
            return bool(re.match(rb"(FIELDS|COLUMNS)\s+\w|VERSION\s+0?\.\d", line.strip(), re.IGNORECASE))
        if words and re.match(rb"#\s*\.PCD v", line.strip(), re.IGNORECASE):
            return True
    return False


def read(path: Path) -> RawCloud:
    """The points of a PCD file.

    Numbers of ascii files are taken as they are written, whatever SIZE and TYPE say. Bytes after the last point of a
    binary file are taken for padding.

    Raises:
        InputError: damaged, cut off, or without coordinates.
    """
    import numpy as np

    from dlogen.io.parsing.cloud_table import locate, split
    from dlogen.types import RawCloud

    with path.open("rb") as stream:
        header = _read_header(stream.read(MAX_HEADER))
        names = [item.name for item in header.fields]
        points, normals = locate(names)
        columns = {index: header.fields[index].code for index in points + (normals or [])}
        available = path.stat().st_size - header.size
        stream.seek(header.size)
        if header.encoding == "ascii":
            table = _read_text(stream, header, columns, available)
        elif header.points == 0:
            table = np.empty((0, len(columns)))
        elif header.encoding == "binary":
            table = _read_binary(stream, header, columns, available)
        else:
            table = _read_compressed(stream, header, columns, available)
    xyz, normal = split(table)
    return RawCloud(
        points=xyz,
        normals=normal,
        viewpoint=None if header.viewpoint is None else np.array(header.viewpoint),
        width=header.width,
        height=header.height,
        fields=tuple(names),
        format="pcd",
        encoding=header.encoding,
        comments=header.comments,
    )


def write(path: Path, cloud: RawCloud, encoding: str) -> None:
    """Write points, normals, shape and sensor pose of a cloud; the same cloud gives the same bytes.

    Args:
        path: the file.
        cloud: its comments become comments, its fields beyond x y z and the normal are not in it.
        encoding: one of `FORMAT.encodings`.
    """
    import numpy as np

    from dlogen.io.parsing.cloud_table import records
    from dlogen.io.parsing.lzf import compress
    from dlogen.io.parsing.text_rows import text_rows

    rows = records(cloud, ("normal_x", "normal_y", "normal_z"))
    names = rows.dtype.names or ()
    pose = (0, 0, 0, 1, 0, 0, 0) if cloud.viewpoint is None else cloud.viewpoint.tolist()
    lines = [
        f"# {_TITLE}",
        *(f"# {' '.join(comment.split())}" for comment in cloud.comments),
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(str(rows.dtype[name].itemsize) for name in names)}",
        f"TYPE {' '.join('F' for _ in names)}",
        f"COUNT {' '.join('1' for _ in names)}",
        f"WIDTH {cloud.width if cloud.organised else len(cloud.points)}",
        f"HEIGHT {cloud.height if cloud.organised else 1}",
        f"VIEWPOINT {' '.join(repr(number).removesuffix('.0') for number in pose)}",
        f"POINTS {len(cloud.points)}",
        f"DATA {encoding}",
        "",
    ]
    with path.open("wb") as stream:
        stream.write("\n".join(lines).encode())
        if encoding == "ascii":
            stream.writelines(text_rows(rows))
        elif encoding == "binary":
            stream.write(rows.tobytes())
        else:
            # One field after the other: their bytes are more alike than those of a point.
            body = b"".join(rows[name].tobytes() for name in names)
            packed = compress(body)
            if max(len(body), len(packed)) >= 1 << 32:
                raise UsageError("binary_compressed holds 4 GiB at most", "write it as binary")
            stream.write(np.array([len(packed), len(body)], dtype="<u4").tobytes() + packed)


def _read_header(head: bytes) -> _Header:
    end = re.search(rb"^[ \t]*DATA\b[^\r\n]*(\r?\n|\Z)", head, re.MULTILINE | re.IGNORECASE)
    if not end:
        raise endless("PCD", "DATA", head, "not a PCD file")
    entries: dict[str, list[str]] = {}
    comments: list[str] = []
    for number, line in enumerate(re.split(r"\r?\n", head[: end.end()].decode("utf-8", errors="replace")), start=1):
        keyword, *values = line.split() or ["#"]
        keyword = keyword.upper()
        if keyword.startswith("#"):
            comment = line.strip().lstrip("#").strip()
            if comment and not comment.upper().startswith(".PCD V"):
                comments.append(comment)
        elif keyword not in _KEYWORDS or keyword in entries or not values:
            raise bad_line("PCD", number, line, "it makes no sense here")
        else:
            entries[keyword] = values

    version = entries.get("VERSION", [".7"])[0]
    if not re.fullmatch(r"0?\.[1-7]", version):
        raise InputError(f"PCD version {shorten(version)!r} is unknown", "dlogen reads the versions up to 0.7")
    encoding = entries["DATA"][0].lower()
    if encoding not in FORMAT.encodings:
        raise InputError(f"PCD data {shorten(encoding)!r} are unknown", f"known: {', '.join(FORMAT.encodings)}")
    width, height = _shape(entries)
    return _Header(_fields(entries), width, height, _viewpoint(entries), encoding, tuple(comments), end.end())


def _fields(entries: dict[str, list[str]]) -> tuple[_Field, ...]:
    names = entries.get("FIELDS") or entries.get("COLUMNS")
    if not names:
        raise InputError("the PCD header has no line 'FIELDS'", DAMAGED)
    columns = {
        "SIZE": entries.get("SIZE", ["4"] * len(names)),
        "TYPE": [kind.upper() for kind in entries.get("TYPE", ["F"] * len(names))],
        "COUNT": entries.get("COUNT", ["1"] * len(names)),
    }
    for keyword, values in columns.items():
        if len(values) != len(names):
            raise InputError(f"the PCD header has {len(names)} FIELDS, but {len(values)} values of {keyword}", DAMAGED)
    sizes = [whole_number(value, "SIZE") for value in columns["SIZE"]]
    counts = [whole_number(value, "COUNT") for value in columns["COUNT"]]
    for name, size, count in zip(names, sizes, counts, strict=True):
        if size < 1 or count < 1:
            raise InputError(f"the field {shorten(name)!r} has SIZE {size} and COUNT {count}", DAMAGED)
    return tuple(map(_Field, names, sizes, columns["TYPE"], counts))


def _shape(entries: dict[str, list[str]]) -> tuple[int, int]:
    """Width and height; POINTS stands in for what is missing."""
    given = {key: whole_number(entries[key][0], key) for key in ("WIDTH", "HEIGHT", "POINTS") if key in entries}
    if not {"WIDTH", "POINTS"} & set(given):
        raise InputError("the PCD header has neither 'POINTS' nor 'WIDTH'", DAMAGED)
    height = given.get("HEIGHT", 1)
    width = given.get("WIDTH", given.get("POINTS", 0) // max(height, 1))
    points = given.get("POINTS", width * height)
    if width * height != points:
        raise InputError(
            f"the PCD header contradicts itself: WIDTH {width} x HEIGHT {height} is {width * height}, POINTS {points}",
            "correct the header, or export the file again",
        )
    return width, height


def _viewpoint(entries: dict[str, list[str]]) -> tuple[float, ...] | None:
    """Sensor position and quaternion; None where the file has none or it is not finite."""
    import math

    words = entries.get("VIEWPOINT")
    if words is None:
        return None
    try:
        pose = tuple(float(word) for word in words)
    except ValueError:
        pose = ()
    if len(pose) != 7:
        raise InputError(f"VIEWPOINT is {shorten(' '.join(words))!r}, not seven numbers", DAMAGED)
    return pose if all(map(math.isfinite, pose)) else None


def _read_text(stream: BinaryIO, header: _Header, columns: dict[int, str], available: int) -> Array:
    from dlogen.io.parsing.text_rows import TextRows

    width = sum(item.count for item in header.fields)
    places = [sum(item.count for item in header.fields[:index]) for index in columns]
    refuse_text_claim("points", header.points, width, available)
    rows = TextRows(stream)
    table = rows.table(header.points, "points", width, places)
    rows.refuse_more("points")
    return table


def _read_binary(stream: BinaryIO, header: _Header, columns: dict[int, str], available: int) -> Array:
    import numpy as np

    from dlogen.io.parsing.cloud_table import columns_table

    stride = sum(item.bytes for item in header.fields)
    refuse_claim("points", header.points, stride, available)
    data = np.fromfile(stream, dtype=np.uint8, count=header.points * stride)
    starts = list(accumulate((item.bytes for item in header.fields), initial=0))
    found = [
        np.ndarray((header.points,), dtype=code, buffer=data, offset=starts[index], strides=(stride,))
        for index, code in columns.items()
    ]
    return columns_table(found, header.points)


def _read_compressed(stream: BinaryIO, header: _Header, columns: dict[int, str], available: int) -> Array:
    """One field after the other, all points of each."""
    import numpy as np

    from dlogen.io.parsing.cloud_table import columns_table
    from dlogen.io.parsing.lzf import MAX_RATIO, decompress

    if available < 8:
        raise InputError(f"the header claims {header.points} points, the file ends with it", CUT_OFF)
    packed_size, size = (int(number) for number in np.fromfile(stream, dtype="<u4", count=2))
    if packed_size > available - 8:
        raise InputError(f"{packed_size} compressed bytes are announced, the file holds {available - 8}", CUT_OFF)
    # PCL leaves padding fields out of compressed data, though it names them in the header.
    for fields in (header.fields, tuple(item for item in header.fields if item.name != "_")):
        expected = header.points * sum(item.bytes for item in fields)
        if size == expected:
            break
    else:
        raise InputError(
            f"the header claims {header.points} points, which take {expected} bytes; the compressed data hold {size}",
            CUT_OFF,
        )
    if size > MAX_RATIO * packed_size:
        raise InputError(f"{packed_size} compressed bytes cannot hold the {size} that are announced", CUT_OFF)
    try:
        data = decompress(stream.read(packed_size), size)
    except ValueError as error:
        raise InputError(f"the compressed data are damaged: {error}", "copy or export the file again") from None
    starts = list(accumulate((item.bytes * header.points for item in fields), initial=0))
    found = []
    for index, code in columns.items():
        start = starts[fields.index(header.fields[index])]
        found.append(np.frombuffer(data, dtype=code, count=header.points, offset=start))
    return columns_table(found, header.points)


FORMAT = CloudFormat(
    name="pcd",
    suffixes=(".pcd",),
    description="Point Cloud Library: points, normals, sensor pose, organised clouds",
    sniff=sniff,
    read=read,
    write=write,
    encodings=("binary", "ascii", "binary_compressed"),
)
