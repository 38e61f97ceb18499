"""Rows of numbers from text and to text."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_header import CUT_OFF, refuse_missing, shorten
from dlogen.types import Array, BoolArray, IntArray

_BLOCK = 1 << 20
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan(\(\w*\))?|inf|infinity)", re.IGNORECASE)
# As the settings of many countries have it.
_DECIMAL_COMMA = re.compile(rb"[+-]?\d*,\d+([eE][+-]?\d+)?")
# How Microsoft's older C library prints what is not a number.
_MICROSOFT = re.compile(rb"1\.#(QNAN|SNAN|IND|(INF))\d*", re.IGNORECASE)


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

    def table(self, count: int, what: str, width: int, columns: Sequence[int]) -> Array:
        """Some columns of the next `count` rows: (count, len(columns)).

        Args:
            count: how many rows the header claims.
            what: what they are, for messages.
            width: how many numbers each has.
            columns: which of them are wanted.

        Raises:
            InputError: there are fewer rows, one has another width, or something is not a number.
        """

        def pick(values: Array, first: IntArray, row: int) -> Array:
            refuse_rows(np.diff(first) != width, first, row, what, str(width))
            return values.reshape(-1, width)[:, columns]

        return self.collect(count, what, len(columns), pick)

    def collect(self, count: int, what: str, columns: int, pick: Callable[[Array, IntArray, int], Array]) -> Array:
        """The next `count` rows: (count, columns), of rows that may be of unlike width.

        Args:
            count: how many rows the header claims.
            what: what they are, for messages.
            columns: of the table.
            pick: (numbers of a block of rows, where each row starts among them, rows before) -> (k, columns).

        Raises:
            InputError: there are fewer rows, or something is not a number.
        """
        table = np.empty((count, columns))
        done = 0
        for values, first in self.take(count, what):
            rows = len(first) - 1
            table[done : done + rows] = pick(values, first, done)
            done += rows
        refuse_missing(what, count, done)
        return table

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
                f"row {row} of the {what}: {shorten(token.decode('latin-1'))!r} is not a number", _number_hint(token)
            )
    raise InputError(f"the rows of the {what} are not text", CUT_OFF)


def _number_hint(token: bytes) -> str:
    """What to do about something that is not a number."""
    if _DECIMAL_COMMA.fullmatch(token):
        return "it has a decimal comma: export the file again with a decimal point, as -1.5e-3"
    if b"," in token or b";" in token:
        mark = "commas" if b"," in token else "semicolons"
        return f"numbers are set apart by blanks, not by {mark}: export the file again"
    return "the file is cut off, or does not write numbers like -1.5e-3 with blanks between: export it again"


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


def text_rows(rows: npt.NDArray[Any]) -> Iterator[bytes]:
    """Records of numbers as text: the shortest decimals that read back as the same numbers.

    plyfile prints "%.18g" (0.1 becomes 0.100000000000000006) and takes 11 times as long.

    Args:
        rows: (M,) structured array of numbers.

    Yields:
        The lines, many at a time.
    """
    names = rows.dtype.names or ()
    line = " ".join(["{}"] * len(names)) + "\n"
    for start in range(0, len(rows), 1 << 16):
        block = rows[start : start + (1 << 16)]
        columns = [map(repr, block[name].tolist()) for name in names]
        yield "".join(map(line.format, *columns)).encode("ascii")
