"""A file that may hold a curve: its text, its JSON, points in metres, and a place that can be read again."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from curve_files import HOOK, refused, truth, written

from dlogen.errors import InputError
from dlogen.io.curves.curve import load_curve
from dlogen.io.curves.curve_file import CurveFile


@pytest.mark.parametrize(("units", "scale"), [("mm", 1e-3), ({"length": "cm"}, 1e-2), ("m", 1.0), (None, 1.0)])
def test_units_of_json_are_heeded(tmp_path: Path, units: object, scale: float) -> None:
    content = {"schema": "dlogen.truth/1", "points": (HOOK / scale).tolist()} | ({"units": units} if units else {})
    assert load_curve(written(tmp_path, "t.json", json.dumps(content))).points == pytest.approx(HOOK)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"schema": "dlogen.truth/1", "points": [[0, 0', "not valid JSON"),
        ("[" * 10_000, "JSON"),
        ('{"a":' * 100_000, "not valid JSON"),
        (b'{"schema": "\xff\xfe"}', "not valid JSON"),
        ('{"schema": "dlogen.chain/9", "joints": []}', "dlogen.chain/9"),
        ('{"schema": ["dlogen.chain/1"]}', "not a curve"),
        ('{"points": [[0, 0, 0], [1, 1, 1]]}', "schema None"),
        ('{"schema": "dlogen.chain/1"}', "joints is missing"),
        ('{"schema": "dlogen.truth/1", "points": null}', "points is missing"),
        (truth([[0, 0, 0], [1, 0, 0]], units="inch"), "inch"),
        (truth([[0, 0, 0], [1, 0]]), "not a list of points"),
        (truth([[0, 0, "a"]]), "not a list of points"),
        (truth([[0, 0, 10**400], [0, 0, 1]]), "not a list of points"),
        (truth({"x": 1}), "not a list of points"),
        (truth([[0, 0], [1, 0]]), "(2, 2)"),
        (truth([]), "shape"),
        (truth([[0, 0, 0], [0, 0, math.nan], [1, 1, math.inf]]), "2 of 3 points are not finite, the first is number 2"),
        (truth([[0, 0, None], [1, 1, 1]]), "not finite"),
        (truth([[1, 2, 3]]), "1 point in one place"),
        (truth([[1, 2, 3]] * 4), "4 points in one place"),
        (truth([[0, 0, 0], [1e200, 0, 0]]), "1e+200 m"),
    ],
)
def test_json_that_is_no_curve(tmp_path: Path, content: str | bytes, words: str) -> None:
    refused(written(tmp_path, "t.json", content), words)


def test_marks_and_blanks_before_the_content_are_passed_over() -> None:
    file = CurveFile("a", b'\xef\xbb\xbf \r\n\t{"schema": "x/1"}', None)
    assert file.text == b'{"schema": "x/1"}'
    assert file.json == {"schema": "x/1"}
    assert file.schema == "x/1"


@pytest.mark.parametrize("data", [b"", b"ply\n", b"[1, 2]", b"x,y,z"])
def test_what_is_no_object_has_no_schema(data: bytes) -> None:
    file = CurveFile("a", data, None)
    assert file.json == {}
    assert file.schema is None


@pytest.mark.parametrize(("units", "scale"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001)])
def test_points_are_at_their_keys_and_in_metres(units: str, scale: float) -> None:
    content = {"units": {"length": units, "angle": "rad"}, "a": {"b": HOOK.tolist()}, "b": [[1, 2, 3]]}
    file = CurveFile("a", json.dumps(content).encode(), None)
    assert file.points("a", "b") == pytest.approx(scale * HOOK)
    assert file.points("b") == pytest.approx(scale * np.array([[1.0, 2.0, 3.0]]))
    with pytest.raises(InputError, match=r"a\.c is missing"):
        file.points("a", "c")
    with pytest.raises(InputError, match=r"b\.c is missing"):
        file.points("b", "c")


def test_a_file_is_read_where_it_is_and_a_pipe_from_a_copy(tmp_path: Path) -> None:
    path = written(tmp_path, "a.ply", "one")
    with CurveFile("a.ply", b"one", path).seekable() as place:
        assert place == path
    with CurveFile("stdin", b"two", None).seekable() as place:
        assert place.read_bytes() == b"two"
    assert not place.exists()
