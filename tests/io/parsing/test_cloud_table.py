"""Which fields are coordinates, and columns from and to records."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_table import columns_table, gather, locate, records, smallest_type, split
from dlogen.types import RawCloud

POINTS = np.array([[0.5, 0.25, 3.0], [-1.0, np.nan, np.inf]])
NORMALS = np.array([[0.1, 0.2, 0.3], [0.0, -0.0, 1.0]])
NORMAL = ("nx", "ny", "nz")


@pytest.mark.parametrize("order", list(itertools.permutations(range(4))))
def test_coordinates_in_any_order(order: tuple[int, ...]) -> None:
    names = [("x", "y", "z", "red")[place] for place in order]
    points, normals = locate(names)
    assert [names[index] for index in points] == ["x", "y", "z"]
    assert normals is None


def test_normals_of_either_name() -> None:
    assert locate(["ny", "x", "nx", "y", "nz", "z"]) == ([1, 3, 5], [2, 0, 4])
    assert locate(["x", "y", "z", "normal_x", "normal_y", "normal_z"]) == ([0, 1, 2], [3, 4, 5])
    assert locate(["x", "y", "z", "nx", "ny", "normal_z"]) == ([0, 1, 2], None)


def test_upper_case_stands_in_where_there_is_no_lower_case() -> None:
    assert locate(["X", "Y", "Z"]) == ([0, 1, 2], None)
    assert locate(["X", "x", "y", "z"]) == ([1, 2, 3], None)


def test_missing_coordinates_are_named() -> None:
    with pytest.raises(InputError, match=r"no x and no z coordinate \(fields: u y\)"):
        locate(["u", "y"])
    with pytest.raises(InputError, match=r"\(fields: none\)"):
        locate([])


def test_points_and_normals_apart() -> None:
    table = np.arange(12.0).reshape(2, 6)
    points, normals = split(table)
    assert points.tolist() == [[0, 1, 2], [6, 7, 8]]
    assert normals is not None and normals.tolist() == [[3, 4, 5], [9, 10, 11]]
    assert split(table[:, :3])[1] is None


@pytest.mark.parametrize("code", ["<f4", ">f8", "<i8", ">u2", "u1"])
def test_numbers_that_stand_anywhere(code: str) -> None:
    values = np.array([3, 1, 200]).astype(code)
    size = values.itemsize
    data = np.full(64, 77, dtype=np.uint8)
    places = np.array([41, 3, 18])
    for index, place in enumerate(places):
        data[place : place + size] = values[index : index + 1].view(np.uint8)
    assert gather(data, places, code).tolist() == [3, 1, 200]
    assert gather(data, places[:0], code).tolist() == []


def test_columns_of_many_types() -> None:
    columns = [np.array([1, 2], dtype=">i2"), np.array([0.5, np.nan], dtype="<f4"), np.array([2**53, 7], dtype="<u8")]
    table = columns_table(columns, 2)
    assert table.dtype == np.float64
    assert np.array_equal(table, [[1, 0.5, 2.0**53], [2, np.nan, 7]], equal_nan=True)
    assert columns_table([], 5).shape == (5, 0)


def test_records_are_single_precision_where_that_is_exact_for_all_three() -> None:
    rows = records(RawCloud(POINTS, NORMALS), NORMAL)
    assert rows.dtype.descr == [(name, "<f4") for name in "xyz"] + [(name, "<f8") for name in NORMAL]
    for names, values in (("xyz", POINTS), (NORMAL, NORMALS)):
        for name, column in zip(names, values.T, strict=True):
            assert np.array_equal(rows[name].astype(float), column, equal_nan=True)
            assert np.array_equal(np.signbit(rows[name]), np.signbit(column))
    assert records(RawCloud(POINTS), NORMAL).dtype.names == ("x", "y", "z")
    assert records(RawCloud(np.empty((0, 3))), NORMAL).dtype.itemsize == 12


@pytest.mark.parametrize(
    ("value", "code"),
    [
        (0.1, "f8"),
        (float(np.float32(0.1)), "f4"),
        (1e300, "f8"),
        (1e-45, "f8"),
        (float(np.float32(1e-45)), "f4"),
        (np.inf, "f4"),
        (np.nan, "f4"),
        (16777217.0, "f8"),
    ],
)
def test_smallest_type(value: float, code: str) -> None:
    assert smallest_type(np.array([[0.5, value, 1.0]])) == code
