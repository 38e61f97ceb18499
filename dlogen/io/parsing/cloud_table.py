"""Per-point records of cloud files: which fields hold the coordinates, and columns from and to binary records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_header import shorten
from dlogen.types import Array, IntArray

if TYPE_CHECKING:
    from dlogen.types import RawCloud

Bytes = npt.NDArray[np.uint8]

_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))


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


def gather(data: Bytes, places: IntArray, code: str) -> npt.NDArray[Any]:
    """(M,) numbers of numpy's type `code`; `places` (M,) are their first bytes."""
    numbers: npt.NDArray[Any] = data[places[:, np.newaxis] + np.arange(np.dtype(code).itemsize)].view(code)[:, 0]
    return numbers


def columns_table(columns: Sequence[npt.NDArray[Any]], rows: int) -> Array:
    """(rows, len(columns)) float64 of columns (rows,) of any types of numbers."""
    table = np.empty((rows, len(columns)))
    with np.errstate(invalid="ignore"):  # signalling NaN
        for index, column in enumerate(columns):
            table[:, index] = column
    return table


def records(cloud: RawCloud, normal: tuple[str, str, str]) -> npt.NDArray[Any]:
    """(M,) little-endian records of the coordinates x y z and, where there is one, the normal of each point.

    Single precision where that is exact for all three, double precision elsewhere, so that nothing is lost.

    Args:
        cloud: the points.
        normal: what the parts of the normal are called.
    """
    groups = [(("x", "y", "z"), cloud.points)]
    if cloud.normals is not None:
        groups.append((normal, cloud.normals))
    layout = [(name, "<" + smallest_type(values)) for names, values in groups for name in names]
    rows = np.empty(len(cloud.points), dtype=layout)
    for names, values in groups:
        for name, column in zip(names, values.T, strict=True):
            rows[name] = column
    return rows


def smallest_type(values: Array) -> str:
    """ "f4" when all numbers are exactly single precision numbers, else "f8"."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    return "f4" if np.array_equal(single.astype(np.float64), values, equal_nan=True) else "f8"
