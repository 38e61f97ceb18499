"""Clouds that an editor saved as text in another encoding: with a byte order mark, or as UTF-16."""

from __future__ import annotations

import codecs
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dlogen.errors import InputError

#: Byte order marks, the longer ones first: that of UTF-32 starts like that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
#: How a PLY or PCD file starts; in UTF-16 without a mark there are zeros between.
_STARTS = (b"ply", b"# .pcd", b"version", b"fields")
#: Lines of PLY and PCD headers that say that what follows is no text.
_BINARY = re.compile(rb"^[ \t]*(format[ \t]+binary|DATA[ \t]+binary)", re.MULTILINE | re.IGNORECASE)
#: What a file that cannot be read as its encoding says is to be done with.
_AGAIN = "export the cloud again, or save it as UTF-8 without a byte order mark"

_CHUNK = 1 << 20


@contextmanager
def plain_text(path: Path) -> Iterator[Path]:
    """The file itself, or a copy as UTF-8 without a byte order mark where it is text in another encoding.

    Args:
        path: an ordinary file.

    Raises:
        InputError: its text is damaged, or its header says that the data are binary, which no text editor leaves whole.
    """
    with path.open("rb") as stream:
        found = _encoding(stream.read(8))
    if found is None:
        yield path
        return
    skipped, encoding = found
    with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
        copy = Path(folder) / "cloud"
        _transcode(path, copy, skipped, encoding)
        yield copy


def _encoding(head: bytes) -> tuple[int, str] | None:
    """Bytes of the mark and the encoding of a text that starts like this; None for anything else."""
    for mark, name in _MARKS:
        if head.startswith(mark):
            return len(mark), name
    for zeros, letters, name in ((head[1::2], head[::2], "utf-16-le"), (head[::2], head[1::2], "utf-16-be")):
        if (
            len(head) >= 6
            and not any(zeros)
            and letters.lower().startswith(tuple(start[: len(letters)] for start in _STARTS))
        ):
            return 0, name
    return None


def _transcode(path: Path, copy: Path, skipped: int, encoding: str) -> None:
    """Write the text behind the mark as UTF-8, piece by piece."""
    name = encoding.upper().removesuffix("-LE").removesuffix("-BE")
    decoder = codecs.getincrementaldecoder(encoding)()
    first = True
    with path.open("rb") as stream, copy.open("wb") as out:
        stream.seek(skipped)
        while True:
            chunk = stream.read(_CHUNK)
            if encoding == "utf-8":
                # Only the mark is in the way; comments need not be UTF-8.
                text = chunk
            else:
                try:
                    text = decoder.decode(chunk, final=not chunk).encode()
                except UnicodeError:
                    raise InputError(f"the file is saved as {name}, but is damaged", _AGAIN) from None
            if first and _BINARY.search(text):
                raise InputError(
                    f"a text editor saved this file as {name} text, but its header says that the data are binary",
                    "that destroys binary data: export the cloud again",
                )
            first = False
            out.write(text)
            if not chunk:
                return
