"""What the headers of cloud files have in common: words from them in messages, and claims that cannot be true."""

from __future__ import annotations

import re

from dlogen.errors import InputError

#: Bytes of a file in which its header has to end.
MAX_HEADER = 1 << 20

DAMAGED = "the header is damaged: export the file again"
CUT_OFF = "the file is cut off, or its header is wrong: copy or export it again"


def shorten(text: str) -> str:
    """Text from a file as it can stand in a message: one line of printable characters, not too long."""
    printable = "".join(character if character.isprintable() else "?" for character in text)
    return printable if len(printable) <= 60 else printable[:57] + "..."


def whole_number(text: str, what: str) -> int:
    """A count in a header.

    Raises:
        InputError: it is not one.
    """
    if not re.fullmatch(r"\+?[0-9]{1,18}", text):
        raise InputError(f"{what} is {shorten(text)!r}, not a whole number", DAMAGED)
    return int(text)


def endless(kind: str, keyword: str, head: bytes, or_else: str) -> InputError:
    """What to say of a header without its last line.

    Args:
        kind: the format ("PLY").
        keyword: what the last line starts with.
        head: the first bytes of the file, up to `MAX_HEADER`.
        or_else: what the file may be if it is not cut off.
    """
    where = f" in its first {MAX_HEADER} bytes" if len(head) == MAX_HEADER else ""
    return InputError(
        f"the {kind} header has no end: there is no line {keyword!r}{where}",
        f"the file is cut off or {or_else}: copy or export it again",
    )


def bad_line(kind: str, number: int, line: str, message: str) -> InputError:
    """What to say of a line of a header."""
    return InputError(f"{kind} header, line {number} ({shorten(line)!r}): {message}", DAMAGED)


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
        raise _claims(what, rows, f"has room for {holds} at most" if at_most else f"holds {holds}")


def refuse_text_claim(what: str, rows: int, numbers: int, available: int) -> None:
    """`refuse_claim` for rows of text, of at least so many numbers each."""
    # A number takes two bytes at least, but the separator after the last one may be missing.
    refuse_claim(what, rows, 2 * numbers, available + 1, at_most=True)


def refuse_missing(what: str, rows: int, found: int) -> None:
    """Refuse a file with fewer rows than its header claims.

    Args:
        what: the rows, for the message.
        rows: how many the header claims.
        found: how many there are.

    Raises:
        InputError: there are fewer.
    """
    if found < rows:
        raise _claims(what, rows, f"holds {found}")


def _claims(what: str, rows: int, says: str) -> InputError:
    return InputError(f"the header claims {rows} {what}, the file {says}", CUT_OFF)
