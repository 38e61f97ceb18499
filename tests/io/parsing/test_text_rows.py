"""Rows of numbers from text and to text."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.errors import InputError
from dlogen.io.parsing import text_rows as module
from dlogen.io.parsing.text_rows import TextRows, text_rows

NUMBERS = st.floats(allow_nan=True, allow_infinity=True, width=64)


def records(columns: list[list[float]]) -> np.ndarray:
    rows = np.empty(len(columns[0]), dtype=[(f"f{index}", "<f8") for index in range(len(columns))])
    for name, column in zip(rows.dtype.names or (), columns, strict=True):
        rows[name] = column
    return rows


@settings(deadline=None, max_examples=100)
@given(st.data(), st.integers(1, 5), st.integers(0, 40), st.integers(1, 30))
def test_what_is_written_is_read_bit_by_bit(data: st.DataObject, width: int, count: int, block: int) -> None:
    columns = [data.draw(st.lists(NUMBERS, min_size=count, max_size=count)) for _ in range(width)]
    text = b"".join(text_rows(records(columns)))
    wanted = data.draw(st.permutations(range(width)))[: data.draw(st.integers(0, width))]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_BLOCK", block)  # blocks end anywhere, also within numbers
        rows = TextRows(io.BytesIO(text))
        table = rows.table(count, "points", width, wanted)
        rows.refuse_more("points")
    expected = np.array(columns).T[:, wanted]
    assert table.shape == (count, len(wanted))
    assert np.array_equal(table, expected, equal_nan=True)
    assert np.array_equal(np.signbit(table[~np.isnan(table)]), np.signbit(expected[~np.isnan(expected)]))


def test_text_is_the_shortest_that_reads_back() -> None:
    rows = np.array([(0.1, 1, 200), (-0.0, 1e-300, 3)], dtype=[("a", "<f4"), ("b", ">f8"), ("c", "u1")])
    assert b"".join(text_rows(rows)) == b"0.10000000149011612 1.0 200\n-0.0 1e-300 3\n"
    assert b"".join(text_rows(rows[:0])) == b""


def test_blocks_of_rows_are_written_without_a_seam() -> None:
    rows = records([[float(i) for i in range(70_000)]])
    assert b"".join(text_rows(rows)).split() == [repr(float(i)).encode() for i in range(70_000)]


def test_rows_of_several_elements_follow_one_another() -> None:
    rows = TextRows(io.BytesIO(b"1 2\r\n\r\n3 4\r5\n\n6\n"))
    assert rows.table(2, "points", 2, [1, 0]).tolist() == [[2, 1], [4, 3]]
    assert rows.table(2, "more", 1, [0]).tolist() == [[5], [6]]
    rows.refuse_more("more")


def test_rows_of_unlike_width_are_collected() -> None:
    rows = TextRows(io.BytesIO(b"1\n2 3\n4 5 6\n"))
    seen = []

    def pick(values: np.ndarray, first: np.ndarray, row: int) -> np.ndarray:
        seen.append(row)
        return values[first[:-1]][:, np.newaxis]

    assert rows.collect(3, "points", 1, pick).tolist() == [[1], [2], [4]]
    assert seen == [0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"1 2\n3\n", "row 2 of the points has 1 numbers, not 2"),
        (b"1 2\n3 4 5\n", "row 2 of the points has 3 numbers, not 2"),
        (b"1 2\n", "the header claims 2 points, the file holds 1"),
        (b"1 2\n3 four\n", "row 2 of the points: 'four' is not a number"),
        (b"1 2\n3 1.#QNANx\n", "row 2 of the points: '1.#QNANx' is not a number"),
        (b"1 2\n3 4\n5 6\n", "the file goes on after the points of its header"),
        (b"1 2\n3 " + b"q" * 100 + b"\n", "q..."),
    ],
)
def test_refused(text: bytes, message: str) -> None:
    rows = TextRows(io.BytesIO(text))
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        rows.table(2, "points", 2, [0])
        rows.refuse_more("points")
    assert caught.value.hint


@pytest.mark.parametrize(
    ("row", "says"),
    [
        (b"0,25 1 2\n", "decimal comma"),
        (b"1 -1,5e-3 2\n", "decimal comma"),
        (b"1 2 ,5\n", "decimal comma"),
        (b"0.1,0.2,0.3\n", "not by commas"),
        (b"0.1, 0.2, 0.3\n", "not by commas"),
        (b"0,1;0,2;0,3\n", "not by commas"),
        (b"1;2;3\n", "not by semicolons"),
        (b"1 2 three\n", "cut off"),
    ],
)
def test_a_comma_is_named_where_it_is_one(row: bytes, says: str) -> None:
    with pytest.raises(InputError, match=r"row 2 of the points: '.*' is not a number") as caught:
        TextRows(io.BytesIO(b"1 2 3\n" + row)).table(2, "points", 3, [0, 1, 2])
    assert says in caught.value.hint
