"""Writing PLY files, by plyfile as far as it can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO, Literal

import numpy.typing as npt

from dlogen.io.parsing.ply_header import BYTE_ORDERS
from dlogen.io.parsing.text_rows import text_rows


def write_ply(
    stream: BinaryIO,
    elements: Mapping[str, npt.NDArray[Any]],
    encoding: str,
    comments: Sequence[str] = (),
    info: Sequence[str] = (),
) -> None:
    """Write elements; the same elements give the same bytes.

    Args:
        stream: where to.
        elements: name -> (rows,) structured array with the types that are to be written, in any byte order. A field is
            a number, or in binary files n numbers: a list with its length as uchar.
        encoding: one of `ply_header.ENCODINGS`.
        comments: a line each.
        info: the same, as `obj_info`.

    Raises:
        ValueError: lists in an ascii file, or together with comments beyond ASCII.
    """
    from plyfile import PlyData, PlyElement

    is_text = encoding == "ascii"
    order: Literal["<", ">", "="] = "=" if is_text else BYTE_ORDERS[encoding]
    parts = [PlyElement.describe(rows, name) for name, rows in elements.items()]
    if not is_text and all(comment.isascii() for comment in comments):
        PlyData(parts, byte_order=order, comments=comments, obj_info=info).write(stream)
        return
    if any(rows.dtype[name].shape for rows in elements.values() for name in rows.dtype.names or ()):
        raise ValueError("lists are written to binary files with comments in ASCII only")
    # By hand, but for the header: plyfile refuses comments beyond ASCII, and it writes numbers as "%.18g" (0.1 becomes
    # 0.100000000000000006), 11 times as slowly as `text_rows`.
    lines = PlyData(parts, is_text, order, obj_info=info).header.split("\n")
    lines[2:2] = [f"comment {comment}" for comment in comments]
    stream.write("\n".join([*lines, ""]).encode())
    for rows in elements.values():
        if is_text:
            stream.writelines(text_rows(rows))
        else:
            stream.write(rows.astype(rows.dtype.newbyteorder(order), copy=False).tobytes())
