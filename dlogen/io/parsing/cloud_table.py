"""Per-point records of cloud files: which fields hold the coordinates, and rows of numbers from and to text."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from itertools import starmap
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.types import Array, BoolArray, IntArray

Bytes = npt.NDArray[np.uint8]
#: Where a number of each row stands in binary data: the first byte and the stride, or the first byte of each.
Place = tuple[int, int] | IntArray

CUT_OFF = "the file is cut off, or its header is wrong: copy or export it again"

_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
_BLOCK = 1 << 20
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan(\(\w*\))?|inf|infinity)", re.IGNORECASE)
# How Microsoft's older C library prints what is not a number.
_MICROSOFT = re.compile(rb"1\.#(QNAN|SNAN|IND|(INF))\d*", re.IGNORECASE)


def locate(names: Sequence[str]) -> tuple[list[int], list[int] | None]:
    """Which fields are x y z, and which are the normal, if there is one. Upper and lower case are the same.

    Raises:
        InputError: a coordinate is missing.
    """
    points = [_index(names, name) for name in ("x", "y", "z")]
    missing = [name for name, index in zip("xyz", points, strict=True) if index is None]
    if missing:
        raise InputError(
            f"the points have no {' and no '.join(missing)} coordinate (fields: {shorten(' '.join(names)) or 'none'})",
            "dlogen needs points in space, with fields called x, y and z",
        )
    for triple in _NORMALS:
        normals = [_index(names, name) for name in triple]
        if None not in normals:
            return points, normals  # type: ignore[return-value]
    return points, None  # type: ignore[return-value]


def _index(names: Sequence[str], wanted: str) -> int | None:
    if wanted in names:
        return names.index(wanted)
    return next((index for index, name in enumerate(names) if name.lower() == wanted), None)


def split(table: Array) -> tuple[Array, Array | None]:
    """Points and normals of a table of (M, 3) or (M, 6) columns."""
    if table.shape[1] == 3:
        return table, None
    return np.ascontiguousarray(table[:, :3]), np.ascontiguousarray(table[:, 3:])


def whole_number(text: str, what: str) -> int:
    """A count in a header.

    Raises:
        InputError: it is not one.
    """
    if not re.fullmatch(r"\+?[0-9]{1,18}", text):
        raise InputError(
            f"{what} is {shorten(text)!r}, not a whole number", "the header is damaged: export the file again"
        )
    return int(text)


def shorten(text: str) -> str:
    """Text from a file as it can stand in a message: one line of printable characters, not too long."""
    printable = "".join(character if character.isprintable() else "?" for character in text)
    return printable if len(printable) <= 60 else printable[:57] + "..."


def refuse_claim(what: str, rows: int, row_size: int, available: int, at_most: bool = False) -> None:
    """Refuse a header that claims more than the file can hold, before any memory is asked for.

    Args:
        what: the rows, for the message ("points").
        rows: how many the header claims.
        row_size: bytes that one takes.
        available: bytes that there are.
        at_most: a row may also be larger than `row_size`.

    Raises:
        InputError: it does claim too much.
    """
    if rows * row_size > max(available, 0):
        holds = max(available, 0) // row_size
        room = f"has room for {holds} at most" if at_most else f"holds {holds}"
        raise InputError(f"the header claims {rows} {what}, the file {room}", CUT_OFF)


def gather(data: Bytes, place: Place, code: str, rows: int) -> npt.NDArray[Any]:
    """(rows,) numbers of numpy's type `code` that stand at `place`."""
    if rows == 0:
        return np.empty(0, dtype=code)
    if isinstance(place, tuple):
        offset, stride = place
        return np.ndarray((rows,), dtype=code, buffer=data, offset=offset, strides=(stride,))
    return data[place[:, np.newaxis] + np.arange(np.dtype(code).itemsize)].view(code)[:, 0]


def gather_table(data: Bytes, columns: Sequence[tuple[Place, str]], rows: int) -> Array:
    """(rows, len(columns)) numbers, each column given by its place and numpy's type."""
    table = np.empty((rows, len(columns)))
    with np.errstate(invalid="ignore"):  # signalling NaN
        for index, (place, code) in enumerate(columns):
            table[:, index] = gather(data, place, code, rows)
    return table


class TextRows:
    """The rows of numbers of an ascii file, read block by block. Blank rows are skipped.

    Rows end with LF, CR LF or CR, numbers are set apart by blanks or tabs.

    Args:
        stream: where the rows start.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._rest = b""
        self._text = b""
        self._starts: IntArray = np.empty(0, dtype=np.intp)  # of each number, in bytes
        self._first: IntArray = np.zeros(1, dtype=np.intp)  # number that each row of the block starts with, and the end
        self._next = 0  # row of the block

    def take(self, count: int, what: str) -> Iterator[tuple[Array, IntArray]]:
        """The next `count` rows, or as many as there are, in blocks of k rows.

        Args:
            count: how many rows.
            what: what they are, for messages.

        Yields:
            The numbers of all rows, one after the other, and (k + 1,) where each row starts among them, and the end.

        Raises:
            InputError: something is not a number.
        """
        done = 0
        while done < count and self._fill():
            rows = min(count - done, len(self._first) - 1 - self._next)
            first = self._first[self._next : self._next + rows + 1]
            begin = self._starts[first[0]]
            end = self._starts[first[-1]] if first[-1] < len(self._starts) else len(self._text)
            first = first - first[0]
            yield _numbers(self._text[begin:end], first, done, what), first
            self._next += rows
            done += rows

    def refuse_more(self, what: str) -> None:
        """Refuse rows beyond the last that the header speaks of.

        Raises:
            InputError: there are some.
        """
        if self._fill():
            raise InputError(
                f"the file goes on after the {what} of its header",
                "the count in the header is too small: correct it, or export the file again",
            )

    def _fill(self) -> bool:
        """Make sure that the block has a row left; False at the end of the file."""
        while self._next >= len(self._first) - 1:
            text, size = self._rest, _BLOCK
            while True:
                more = self._stream.read(size)
                text += more
                cut = max(text.rfind(b"\n"), text.rfind(b"\r")) + 1
                if not more or cut:
                    break
                size = len(text)  # a very long row: double, so that the copying stays linear
            if not text:
                return False
            if not more:
                cut = len(text)
            self._text, self._rest = text[:cut], text[cut:]
            self._starts, self._first = _structure(self._text)
            self._next = 0
        return True


def _structure(text: bytes) -> tuple[IntArray, IntArray]:
    """Where each number starts, and which number each non-blank row starts with."""
    codes = np.frombuffer(text, dtype=np.uint8)
    filled = codes > 32
    starts = np.flatnonzero(filled[1:] & ~filled[:-1]) + 1
    if filled[0]:
        starts = np.concatenate([[0], starts])
    row_ends = np.flatnonzero((codes == 10) | (codes == 13))
    bounds = np.searchsorted(starts, np.concatenate([[0], row_ends, [len(text)]]))
    first = bounds[np.concatenate([[True], np.diff(bounds) > 0])]
    return starts, first


def _numbers(text: bytes, first: IntArray, row: int, what: str) -> Array:
    """All numbers of some text; `first` and `row` say how many there have to be, and which row a bad one is in."""
    values = _parse(text)
    if values is None and b"#" in text:
        values = _parse(_MICROSOFT.sub(lambda match: b"inf" if match[2] else b"nan", text))
    if values is not None and len(values) == first[-1]:
        return values
    for index, token in enumerate(text.split()):
        if not _NUMBER.fullmatch(token) and not _MICROSOFT.fullmatch(token.lstrip(b"+-")):
            row += int(np.searchsorted(first, index, side="right"))
            raise InputError(
                f"row {row} of the {what}: {shorten(token.decode('latin-1'))!r} is not a number",
                "the file is cut off, or does not write numbers like -1.5e-3 with blanks between: export it again",
            )
    raise InputError(f"the rows of the {what} are not text", CUT_OFF)


def _parse(text: bytes) -> Array | None:
    with warnings.catch_warnings():
        # Older numpy warns where newer numpy raises.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            return None


def refuse_rows(wrong: BoolArray, first: IntArray, row: int, what: str, expected: str) -> None:
    """Refuse rows with too few or too many numbers.

    Args:
        wrong: (k,) whether each row of a block is such a row.
        first: (k + 1,) the number that each row of the block starts with, and the end.
        row: rows before this block.
        what: what the rows are.
        expected: how many numbers they should have, for the message.

    Raises:
        InputError: some are wrong.
    """
    if wrong.any():
        index = int(wrong.argmax())
        count = first[index + 1] - first[index]
        raise InputError(f"row {row + index + 1} of the {what} has {count} numbers, not {expected}", CUT_OFF)


def smallest_type(values: Array) -> str:
    """ "f4" when all numbers are exactly single precision numbers, else "f8"."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    return "f4" if np.array_equal(single.astype(np.float64), values, equal_nan=True) else "f8"


def text_rows(table: Array) -> Iterator[bytes]:
    """The rows as text: the shortest decimals that read back as the same numbers."""
    row = " ".join(["{}"] * table.shape[1]) + "\n"
    for start in range(0, len(table), 1 << 16):
        numbers = map(repr, table[start : start + (1 << 16)].ravel().tolist())
        yield "".join(starmap(row.format, zip(*[numbers] * table.shape[1], strict=True))).encode("ascii")
