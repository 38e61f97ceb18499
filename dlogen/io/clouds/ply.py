"""PLY, the Polygon File Format (Stanford): ascii, binary little and big endian.

Read: the element `vertex`, whatever other elements and properties there are. Two conventions of PCL are kept as
well: an element `camera` is the sensor pose, `obj_info num_cols` and `num_rows` make the cloud organised.
Written: coordinates (and normals) as `float` where that is exact and as `double` elsewhere, so nothing is lost.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dlogen.errors import InputError
from dlogen.io.parsing.ply_elements import Element, Property
from dlogen.io.registry import CloudFormat

if TYPE_CHECKING:
    from dlogen.types import Array, RawCloud

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 1 << 20
_DAMAGED = "the header is damaged: export the file again"
_AXES = tuple(f"{axis}_axis{part}" for axis in "xyz" for part in "xyz")
_CAMERA = ("view_px", "view_py", "view_pz", *_AXES)


@dataclass(frozen=True)
class Header:
    """What stands before the rows."""

    encoding: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    shape: tuple[int, int]  # columns and rows of an organised cloud; 0 where the header does not say
    size: int  # in bytes

    def index(self, name: str) -> int | None:
        """Place of the first element of that name."""
        return next((index for index, element in enumerate(self.elements) if element.name == name), None)


def sniff(head: bytes) -> bool:
    """Whether a file that starts like this is a PLY file."""
    return re.match(rb"ply[ \t]*[\r\n]", head) is not None or head.strip() == b"ply"


def read(path: Path) -> RawCloud:
    """The vertices of a PLY file.

    Numbers of ascii files are taken as they are written, also where the header calls them `float`.

    Raises:
        InputError: damaged, cut off, or without coordinates.
    """
    from dlogen.io.parsing.cloud_table import locate, refuse_claim, shorten, split
    from dlogen.io.parsing.ply_rows import read_binary, read_text
    from dlogen.types import RawCloud

    with path.open("rb") as stream:
        header = _read_header(stream.read(_MAX_HEADER))
        vertex = header.index("vertex")
        if vertex is None:
            names = ", ".join(element.name for element in header.elements) or "none"
            raise InputError(
                f"there is no element 'vertex' in the PLY header (elements: {shorten(names)})",
                "the file holds no points: export it again with its vertices",
            )
        fields = header.elements[vertex].names
        points, normals = locate(["" if item.count else item.name for item in header.elements[vertex].properties])
        wanted = {vertex: points + (normals or [])}
        camera = _camera(header)
        if camera is not None:
            wanted[camera] = [header.elements[camera].names.index(name) for name in _CAMERA]

        is_text = header.encoding == "ascii"
        available = path.stat().st_size - header.size
        for element in header.elements:
            # A number of an ascii file takes two bytes at least, but the separator after the last one may be missing.
            smallest = sum(2 if is_text else item.smallest for item in element.properties)
            refuse_claim(
                element.what, element.rows, smallest, available + is_text, at_most=is_text or element.has_lists
            )
        stream.seek(header.size)
        if is_text:
            tables = read_text(stream, header.elements, wanted)
        else:
            tables = read_binary(stream, header.elements, wanted, _BYTE_ORDERS[header.encoding])

    xyz, normal = split(tables[vertex])
    columns, rows = header.shape
    organised = rows > 1 and columns * rows == len(xyz)
    return RawCloud(
        points=xyz,
        normals=normal,
        viewpoint=None if camera is None else _pose(tables[camera][0]),
        width=columns if organised else len(xyz),
        height=rows if organised else 1,
        fields=tuple(fields),
        format="ply",
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

    from dlogen.geometry.rotations import from_quaternion
    from dlogen.io.parsing.cloud_table import smallest_type, text_rows

    groups = [(("x", "y", "z"), cloud.points)]
    if cloud.normals is not None:
        groups.append((("nx", "ny", "nz"), cloud.normals))
    keywords = {"f4": "float", "f8": "double"}
    order = _BYTE_ORDERS.get(encoding, "<")
    layout = [(name, smallest_type(values)) for names, values in groups for name in names]

    lines = ["ply", f"format {encoding} 1.0"]
    lines += [f"comment {' '.join(comment.split())}" for comment in cloud.comments]
    if cloud.organised:
        lines += [f"obj_info num_cols {cloud.width}", f"obj_info num_rows {cloud.height}"]
    lines += [f"element vertex {len(cloud.points)}"]
    lines += [f"property {keywords[code]} {name}" for name, code in layout]
    pose = None
    if cloud.viewpoint is not None:
        pose = np.concatenate([cloud.viewpoint[:3], from_quaternion(cloud.viewpoint[3:]).ravel()])
    if pose is not None:
        lines += ["element camera 1", *(f"property double {name}" for name in _CAMERA)]
    lines += ["end_header", ""]

    with path.open("wb") as stream:
        stream.write("\n".join(lines).encode())
        if encoding == "ascii":
            stream.writelines(text_rows(np.hstack([values for _, values in groups])))
            if pose is not None:
                stream.writelines(text_rows(pose[np.newaxis]))
            return
        rows = np.empty(len(cloud.points), dtype=[(name, order + code) for name, code in layout])
        for names, values in groups:
            for name, column in zip(names, values.T, strict=True):
                rows[name] = column
        stream.write(rows.tobytes())
        if pose is not None:
            stream.write(pose.astype(order + "f8").tobytes())


def _read_header(head: bytes) -> Header:
    begin = re.match(rb"ply[ \t]*(\r\n|\n|\r)", head)
    if not begin:
        first = head[:40].splitlines()[0].decode("latin-1") if head else ""
        raise InputError(
            f"this is not a PLY file: its first line is {first!r}, not 'ply'",
            "if it is another format, give it the right name ending; else export it again as PLY",
        )
    # Where rows end with CR alone, an LF after the header is data already.
    line_end = rb"\r" if begin[1] == b"\r" else rb"\r?\n"
    end = re.search(rb"[\r\n][ \t]*end_header[ \t]*(" + line_end + rb"|\Z)", head)
    if not end:
        raise InputError(
            "the PLY header has no end: there is no line 'end_header'"
            + (f" in its first {_MAX_HEADER} bytes" if len(head) == _MAX_HEADER else ""),
            "the file is cut off or damaged: copy or export it again",
        )
    from dlogen.io.parsing.cloud_table import shorten

    builder = _HeaderBuilder()
    lines = re.split(r"\r\n|\n|\r", head[begin.end() : end.start()].decode("utf-8", errors="replace"))
    for number, line in enumerate(lines, start=2):
        try:
            builder.add(line)
        except InputError as error:
            raise InputError(f"PLY header, line {number} ({shorten(line)!r}): {error.message}", _DAMAGED) from None
    return builder.build(end.end())


class _HeaderBuilder:
    """Takes the lines of a header one by one."""

    def __init__(self) -> None:
        self.encoding = ""
        self.comments: list[str] = []
        self.info: list[str] = []
        self.elements: list[tuple[str, int, list[Property]]] = []

    def add(self, line: str) -> None:
        from dlogen.io.parsing.cloud_table import whole_number

        words = line.split()
        keyword = words[0] if words else "comment"
        if keyword in ("comment", "obj_info"):
            text = line.strip()[len(keyword) :].strip()
            if text:
                (self.comments if keyword == "comment" else self.info).append(text)
        elif keyword == "format" and len(words) == 3 and not self.encoding:
            if words[1] not in FORMAT.encodings or words[2] != "1.0":
                raise InputError(f"unknown format, known are: {', '.join(FORMAT.encodings)}, version 1.0")
            self.encoding = words[1]
        elif keyword == "element" and len(words) >= 3:
            self.elements.append((" ".join(words[1:-1]), whole_number(words[-1], "the count"), []))
        elif keyword == "property" and len(words) >= 5 and words[1] == "list" and self.elements:
            item = Property(" ".join(words[4:]), _type(words[3]), _type(words[2]))
            if item.count[0] == "f":
                raise InputError("the count of a list is a whole number, not of this type")
            self.elements[-1][2].append(item)
        elif keyword == "property" and len(words) >= 3 and words[1] != "list" and self.elements:
            self.elements[-1][2].append(Property(" ".join(words[2:]), _type(words[1])))
        else:
            raise InputError("it makes no sense here")

    def build(self, size: int) -> Header:
        if not self.encoding:
            raise InputError("the PLY header has no line 'format'", _DAMAGED)
        shape = {}
        for text in list(self.info):
            # PCL's way to say that the vertices are the pixels of an image.
            match = re.fullmatch(r"num_(cols|rows)\s+(\d{1,9})", text)
            if match:
                shape[match[1]] = int(match[2])
                self.info.remove(text)
        return Header(
            self.encoding,
            tuple(Element(name, rows, tuple(properties)) for name, rows, properties in self.elements),
            (*self.comments, *self.info),
            (shape.get("cols", 0), shape.get("rows", 0)),
            size,
        )


def _type(name: str) -> str:
    from dlogen.io.parsing.cloud_table import shorten

    if name not in _TYPES:
        raise InputError(f"unknown type {shorten(name)!r}")
    return _TYPES[name]


def _camera(header: Header) -> int | None:
    """The element that has the sensor pose, as PCL writes it."""
    index = header.index("camera")
    if index is None:
        return None
    camera = header.elements[index]
    usable = camera.rows == 1 and not camera.has_lists and set(_CAMERA) <= set(camera.names)
    return index if usable else None


def _pose(camera: Array) -> Array | None:
    """(12,) position and axes -> (7,) position and unit quaternion w x y z, upright where the axes are no rotation."""
    import numpy as np

    from dlogen.geometry.rotations import quaternion

    if not np.isfinite(camera[:3]).all():
        return None
    axes = camera[3:].reshape(3, 3)
    with np.errstate(all="ignore"):
        is_rotation = np.allclose(axes @ axes.T, np.eye(3), atol=1e-3) and np.linalg.det(axes) > 0.0
    if not is_rotation:
        return np.concatenate([camera[:3], [1.0, 0.0, 0.0, 0.0]])
    return np.concatenate([camera[:3], quaternion(axes)])


FORMAT = CloudFormat(
    name="ply",
    suffixes=(".ply",),
    description="Polygon File Format: points, normals, sensor pose",
    sniff=sniff,
    read=read,
    write=write,
    encodings=("binary_little_endian", "ascii", "binary_big_endian"),
)
