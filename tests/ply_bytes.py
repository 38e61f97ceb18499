"""PLY files made byte by byte, so that reader and writer are not tested against one another only."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

POINTS = np.array([[0.1, -2.5, 3.0], [4.0, 5.25, -6.0], [1e-3, 7.0, 8.5], [9.0, -10.0, 0.0]])
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def header(encoding: str, *lines: str, end: str = "\n") -> bytes:
    """A header with these lines between the format and its end."""
    return end.join(["ply", f"format {encoding} 1.0", *lines, "end_header", ""]).encode()


def vertex(count: int, *properties: str, kind: str = "float") -> list[str]:
    """The lines for vertices whose properties are of one type."""
    return [f"element vertex {count}", *(f"property {kind} {name}" for name in properties)]


def ascii_rows(rows: Iterable[Iterable[object]], end: str = "\n") -> bytes:
    """Rows of numbers as text."""
    return "".join(" ".join(str(value) for value in row) + end for row in rows).encode()
