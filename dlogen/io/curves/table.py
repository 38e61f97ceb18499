"""Curves from tables of numbers: CSV and text."""

from __future__ import annotations

import numpy as np

from dlogen.errors import InputError
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.order import in_order
from dlogen.types import Array


def is_table(file: CurveFile) -> bool:
    """Text whose first row is numbers or names columns x, y, z; or any text that is called .csv."""
    if file.text.startswith((b"{", b"<", b"ply")) or b"\0" in file.data[:4096]:
        return False
    if file.path is not None and file.path.suffix.lower() == ".csv":
        return True
    rows, comments = _rows(file.data[:4096])
    names = {name for row in (*rows[:1], *comments) for name in _names(_fields(row))}
    return {"x", "y", "z"} <= names or (bool(rows) and len(_fields(rows[0])) >= 3 and _are_numbers(_fields(rows[0])))


def read_table(file: CurveFile) -> Array:
    """x, y, z separated by commas, semicolons, tabs or blanks; columns of other names (`s`) are left out.

    Without a header there must be three columns. A header may be a comment, as `numpy.savetxt` writes it.
    """
    rows, comments = _rows(file.data)
    first = _fields(rows[0]) if rows else []
    header: list[str] | None = None
    if rows and not _are_numbers(first):
        header, rows = _names(first), rows[1:]
    else:
        named = [_names(_fields(comment)) for comment in comments]
        header = next((names for names in named if len(names) == len(first) and {"x", "y", "z"} <= set(names)), None)
    if not rows:
        raise InputError("the table has no rows of numbers", "give one row of x, y, z for each point")
    if header is None and len(first) != 3:
        raise InputError(
            f"the table has {len(first)} columns and no header", "name the columns in a header, for instance: s,x,y,z"
        )
    if header is not None and any(header.count(axis) != 1 for axis in "xyz"):
        raise InputError(
            f"the table has no columns x, y and z, once each; its first row is {', '.join(header)!r}",
            "name the columns x, y and z; numbers have a point before their decimals",
        )
    columns = [0, 1, 2] if header is None else [header.index(axis) for axis in "xyz"]
    try:
        points = np.loadtxt(rows, delimiter=_delimiter(rows[0]), usecols=columns, ndmin=2, comments=None)
    except ValueError:
        raise _bad_row(file.data, rows, columns) from None
    return in_order(points)


def _bad_row(data: bytes, rows: list[str], columns: list[int]) -> InputError:
    """What to say of a table with a row that cannot be read, by its line in the file."""
    hint = "give numbers in every row, as many in each"
    lines = [line.strip() for line in data.decode("utf-8-sig", errors="replace").splitlines()]
    for row in rows:
        fields = _split_row(row, _delimiter(rows[0]))
        if len(fields) <= max(columns) or not _are_numbers([fields[column] for column in columns]):
            return InputError(f"line {lines.index(row) + 1} is not a point: {row[:60]!r}", hint)
    return InputError("the table cannot be read", hint)


def _rows(data: bytes) -> tuple[list[str], list[str]]:
    """The rows of a table, and its comments without their mark."""
    lines = [line.strip() for line in data.decode("utf-8-sig", errors="replace").splitlines()]
    return [x for x in lines if x and x[0] != "#"], [x.lstrip("# ") for x in lines if x.startswith("#")]


def _delimiter(row: str) -> str | None:
    """What separates the fields of a row; None is blanks."""
    return next((mark for mark in ";\t," if mark in row), None)


def _fields(row: str) -> list[str]:
    return _split_row(row, _delimiter(row))


def _split_row(row: str, delimiter: str | None) -> list[str]:
    return row.rstrip(delimiter).split(delimiter)


def _names(fields: list[str]) -> list[str]:
    return [field.strip(" \t\"'").lower() for field in fields]


def _are_numbers(fields: list[str]) -> bool:
    try:
        return bool([float(field) for field in fields])
    except ValueError:
        return False
