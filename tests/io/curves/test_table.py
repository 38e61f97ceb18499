"""Curves from tables: all separators and headers, and rows that are no points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from curve_files import HOOK, refused, table, written
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.io.curves.curve import load_curve
from dlogen.io.curves.curve_file import CurveFile
from dlogen.io.curves.table import is_table, read_table


@pytest.mark.parametrize(
    "text",
    [
        table(HOOK),
        table(HOOK, ";"),
        table(HOOK, "\t"),
        table(HOOK, "  "),
        table(HOOK, ", "),
        table(HOOK).replace("\n", "\r\n"),
        table(HOOK).replace("\n", ",\n"),
        "\ufeff" + table(HOOK, header="x,y,z"),
        "\n# measured by hand\n\n" + table(HOOK) + "\n\n",
        table(HOOK, header="X,Y,Z"),
        table(HOOK, ";", header='"x";"y";"z"'),
        table(HOOK[:, [2, 0, 1]], header="z,x,y"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], header="s,x,y,z"),
        table(np.c_[HOOK, HOOK], " ", header="x y z vx vy vz"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], " ", header="# s x y z"),
        table(np.c_[[0, 0.35, 0.6, 1], HOOK], header="# s, x, y, z"),
    ],
)
@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a"])
def test_tables(tmp_path: Path, text: str, name: str) -> None:
    curve = load_curve(written(tmp_path, name, text))
    assert (curve.kind, curve.is_chain) == ("csv", False)
    assert curve.points == pytest.approx(HOOK, abs=1e-15)


def test_a_table_with_words_in_a_column_that_is_not_used(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "name,x,y,z\nstart,0,0,0\nend,1,2,3\n")
    assert load_curve(path).points.tolist() == [[0, 0, 0], [1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0,0,0\n1,1,1,1\n", "4 columns and no header"),
        ("0,0\n1,1\n", "2 columns and no header"),
        ("x,y\n1,1\n", "no columns x, y and z"),
        ("x,y,z,x\n1,1,1,1\n", "once each"),
        ("1,5;2,5;3,5\n1,5;2,5;3,6\n", "no columns x, y and z"),
        ("x,y,z\n0,0,0\n# one\n1,one,1\n", "line 4 is not a point: '1,one,1'"),
        ("x,y,z\n0,0,0\n1,1\n", "line 3 is not a point: '1,1'"),
        ("x,y,z\n", "no rows of numbers"),
        ("# nothing\n", "no rows of numbers"),
        ("0,0,0\n1,nan,1\n", "not finite"),
        ("0,0,0\n", "1 point in one place"),
    ],
)
def test_tables_that_are_no_curve(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.csv", text), words)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6, allow_nan=False)] * 3), min_size=2, max_size=20, unique=True))
def test_tables_keep_every_digit(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, ...]]) -> None:
    points = np.array(rows) + 0.0
    if (points == points[0]).all():
        return
    path = written(tmp_path_factory.mktemp("t"), "a.csv", table(points))
    assert np.array_equal(load_curve(path).points, points)


@pytest.mark.parametrize(
    ("data", "name", "expected"),
    [
        (b"1 2 3\n", None, True),
        (b"# x y z\n1 2 3\n", None, True),
        (b"z;y;x\n", None, True),
        (b"1 2\n", None, False),
        (b"name,size\n", None, False),
        (b"name,size\n", "a.csv", True),
        (b"name,size\n", "a.txt", False),
        (b"{}", "a.csv", False),
        (b"<robot/>", "a.csv", False),
        (b"ply\n", "a.csv", False),
        (b"1 2 3\0", "a.csv", False),
    ],
)
def test_what_is_a_table(tmp_path: Path, data: bytes, name: str | None, expected: bool) -> None:
    path = None if name is None else written(tmp_path, name, data)
    assert is_table(CurveFile("a", data, path)) == expected


def test_columns_are_found_by_their_names() -> None:
    file = CurveFile("a", b"z,s,x,y\n3,0,1,2\n6,1,4,5\n", None)
    assert read_table(file).tolist() == [[1, 2, 3], [4, 5, 6]]
