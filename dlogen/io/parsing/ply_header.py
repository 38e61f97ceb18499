"""Headers of PLY files: elements, their properties, comments.

Read by hand, since plyfile refuses much of what is about: blanks at the ends of lines, comments beyond ASCII, 64-bit
integers, names with blanks in them, two properties of one name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import BinaryIO, Literal

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_header import DAMAGED, MAX_HEADER, bad_line, endless, shorten, whole_number

#: What the rows can be written in; the first is the default.
ENCODINGS = ("binary_little_endian", "ascii", "binary_big_endian")

#: Numpy's signs of the byte order.
BYTE_ORDERS: dict[str, Literal["<", ">"]] = {"binary_little_endian": "<", "binary_big_endian": ">"}

#: Types of PLY by numpy's codes. The first spelling of each is the original one of the format.
TYPES = {
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


@dataclass(frozen=True)
class Property:
    """One property of an element.

    Attributes:
        name: its name.
        type: numpy's code for a number, without the byte order ("f4").
        count: the same for the count of a list; empty where the property is a single number.
    """

    name: str
    type: str
    count: str = ""

    @property
    def smallest(self) -> int:
        """Bytes of a number, or of an empty list."""
        return int((self.count or self.type)[1])


@dataclass(frozen=True)
class Element:
    """One element of a header: so many rows, all with the same properties."""

    name: str
    rows: int
    properties: tuple[Property, ...]

    @property
    def what(self) -> str:
        """The rows, in messages."""
        return "points" if self.name == "vertex" else f"{shorten(self.name)!r} rows"

    @property
    def names(self) -> list[str]:
        """Of the properties."""
        return [item.name for item in self.properties]

    @property
    def has_lists(self) -> bool:
        """Whether rows can be of unlike size."""
        return any(item.count for item in self.properties)

    @property
    def smallest(self) -> int:
        """Bytes of a row whose lists are empty."""
        return sum(item.smallest for item in self.properties)


@dataclass(frozen=True)
class Header:
    """What stands before the rows."""

    encoding: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    shape: tuple[int, int]  # columns and rows of an organised cloud; 0 where the header does not say
    size: int  # in bytes

    def index(self, name: str) -> int | None:
        """Place of the first element of that name; if there is none, of one with other capitals."""
        names = [element.name for element in self.elements]
        if name not in names:
            names = [other.lower() for other in names]
        return names.index(name) if name in names else None


def read_header(stream: BinaryIO) -> Header:
    """The header that a file starts with.

    Raises:
        InputError: it is not that of a PLY file, it has no end, or a line of it makes no sense.
    """
    head = stream.read(MAX_HEADER)
    begin = re.match(rb"ply[ \t]*(\r\n|\n|\r)", head, re.IGNORECASE)
    if not begin:
        first = head[:40].splitlines()[0].decode("latin-1") if head else ""
        raise InputError(
            f"this is not a PLY file: its first line is {first!r}, not 'ply'",
            "if it is another format, give it the right name ending; else export it again as PLY",
        )
    # Where rows end with CR alone, an LF after the header is data already.
    line_end = rb"\r" if begin[1] == b"\r" else rb"\r?\n"
    end = re.search(rb"[\r\n][ \t]*end_header[ \t]*(" + line_end + rb"|\Z)", head, re.IGNORECASE)
    if not end:
        raise endless("PLY", "end_header", head, "damaged")
    builder = _HeaderBuilder()
    lines = re.split(r"\r\n|\n|\r", head[begin.end() : end.start()].decode("utf-8", errors="replace"))
    for number, line in enumerate(lines, start=2):
        try:
            builder.add(line)
        except InputError as error:
            raise bad_line("PLY", number, line, error.message) from None
    return builder.build(end.end())


class _HeaderBuilder:
    """Takes the lines of a header one by one."""

    def __init__(self) -> None:
        self.encoding = ""
        self.comments: list[str] = []
        self.info: list[str] = []
        self.elements: list[tuple[str, int, list[Property]]] = []

    def add(self, line: str) -> None:
        words = line.split()
        # The format has small letters only, but there are programs that write capitals.
        keyword = words[0].lower() if words else "comment"
        kind = words[1].lower() if len(words) > 1 else ""
        if keyword in ("comment", "obj_info"):
            text = line.strip()[len(keyword) :].strip()
            if text:
                (self.comments if keyword == "comment" else self.info).append(text)
        elif keyword == "format" and len(words) == 3 and not self.encoding:
            if kind not in ENCODINGS or words[2] != "1.0":
                raise InputError(f"unknown format, known are: {', '.join(ENCODINGS)}, version 1.0")
            self.encoding = kind
        elif keyword == "element" and len(words) >= 3:
            self.elements.append((" ".join(words[1:-1]), whole_number(words[-1], "the count"), []))
        elif keyword == "property" and len(words) >= 5 and kind == "list" and self.elements:
            item = Property(" ".join(words[4:]), _type(words[3]), _type(words[2]))
            if item.count[0] == "f":
                raise InputError("the count of a list is a whole number, not of this type")
            self.elements[-1][2].append(item)
        elif keyword == "property" and len(words) >= 3 and kind != "list" and self.elements:
            self.elements[-1][2].append(Property(" ".join(words[2:]), _type(words[1])))
        else:
            raise InputError("it makes no sense here")

    def build(self, size: int) -> Header:
        if not self.encoding:
            raise InputError("the PLY header has no line 'format'", DAMAGED)
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
    if name.lower() not in TYPES:
        raise InputError(f"unknown type {shorten(name)!r}")
    return TYPES[name.lower()]
