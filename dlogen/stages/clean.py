"""What every cloud goes through first: finite points, each place once, normals of unit length."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.errors import InputError
from dlogen.types import Array, BoolArray, Cloud, Dropped, IntArray

# PCL writes NaN for the few points whose neighbours span no plane. Where there are more, something else is wrong.
_MAX_UNUSABLE_NORMALS = 0.01


def clean(
    points: npt.ArrayLike, normals: npt.ArrayLike | None = None, *, viewpoint: npt.ArrayLike | None = None
) -> Cloud:
    """Leave out points that are not finite, and all but the first of points in exactly the same place.

    Args:
        points: (M, 3).
        normals: (M, 3), or None. They are brought to unit length. Those that are not finite or have no length become
            zero; where they are more than 1 %, all are left out.
        viewpoint: (3,) position of the sensor or (7,) its pose tx ty tz qw qx qy qz, or None.

    Returns:
        The points that are left, in their order, with counts of what was left out.

    Raises:
        InputError: wrong shape, or no finite point.
    """
    points = vectors(points, "points")
    keep = np.flatnonzero(np.isfinite(points).all(axis=1))
    non_finite = len(points) - len(keep)
    if not len(keep):
        what = f"all {len(points)} points are NaN or infinite" if len(points) else "there are no points"
        raise InputError(what, "nothing was in view of the sensor, or the export failed: look at the cloud in a viewer")
    if non_finite:
        points = points[keep]
    first = _first_occurrences(points)
    duplicates = len(points) - len(first)
    if duplicates:
        points, keep = points[first], keep[first]
    unit = None
    if normals is not None:
        normals = vectors(normals, "normals")
        if len(normals) != len(points) + non_finite + duplicates:
            raise InputError(
                f"there are {len(normals)} normals for {len(points) + non_finite + duplicates} points",
                "give one for each, or none",
            )
        unit = _unit(normals[keep])
    pose = None if viewpoint is None else np.asarray(viewpoint, dtype=np.float64)
    position, orientation = (None, None) if pose is None else (pose[:3], pose[3:] if len(pose) == 7 else None)
    return Cloud(points, unit, position, Dropped(non_finite, duplicates), orientation=orientation)


def vectors(values: npt.ArrayLike, what: str) -> Array:
    """(M, 3) numbers from whatever stands for them.

    Args:
        values: the numbers.
        what: what they are, for messages.

    Raises:
        InputError: they are not numbers, or of another shape.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"the {what} are not numbers: {error}",
            f"give the {what} as an (M, 3) array; dlogen.read_cloud reads a file",
        ) from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(
            f"the {what} have the shape {array.shape}, not (M, 3)", "give x, y and z of each point in a row"
        )
    return array


def _unit(normals: Array) -> Array | None:
    """Normals of unit length; zero where that is impossible, None where that happens too often."""
    with np.errstate(all="ignore"):
        unit: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    unusable = ~np.isfinite(unit).all(axis=1)
    if unusable.mean() > _MAX_UNUSABLE_NORMALS:
        return None
    unit[unusable] = 0.0
    return unit


def _first_occurrences(points: Array) -> IntArray:
    """Indices, in ascending order, of the first of each set of equal rows.

    Sorts 64-bit hashes of the rows, which is many times faster than sorting the rows. Rows that follow one another in
    that order are compared; two unlike rows of equal hash are as good as impossible, but not a reason to be wrong.
    """
    hashes = _row_hashes(points)
    order = np.argsort(hashes)
    same_row = _same_as_next(points.T, order)
    if (_same_as_next([hashes], order) & ~same_row).any():
        order = np.lexsort(points.T)
        same_row = _same_as_next(points.T, order)
    starts = np.flatnonzero(np.concatenate([[True], ~same_row]))
    return np.sort(np.minimum.reduceat(order, starts))


def _same_as_next(columns: Iterable[npt.NDArray[Any]], order: IntArray) -> BoolArray:
    """(M - 1,) whether the rows of these (M,) columns, taken in that order, are like the row after them."""
    same = np.ones(len(order) - 1, dtype=bool)
    for column in columns:
        values = column[order]
        same &= values[1:] == values[:-1]
    return same


def _row_hashes(points: Array) -> npt.NDArray[np.uint64]:
    """(M,) 64-bit hashes: each column is mixed in by multiplication with an odd constant (that of SplitMix64)."""
    bits = (points + 0.0).view(np.uint64)  # -0.0 + 0.0 is 0.0: they are the same place
    hashes = np.zeros(len(points), dtype=np.uint64)
    for column in bits.T:
        hashes ^= column
        hashes *= np.uint64(0xBF58476D1CE4E5B9)
        hashes ^= hashes >> np.uint64(32)
    return hashes
