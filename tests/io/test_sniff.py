"""What files are that dlogen does not read: by what they start with, and by their names."""

from __future__ import annotations

import gzip
import io
import json
import sqlite3
import zipfile
from pathlib import Path

import numpy as np
import pytest

from dlogen.io.sniff import _STARTS, _SUFFIXES, by_content, by_suffix


def content(head: bytes) -> str | None:
    found = by_content(head)
    return None if found is None else found[0]


def npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.zeros((3, 3)))
    return stream.getvalue()


def archive(*names: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name in names:
            made.writestr(name, "x")
    return stream.getvalue()


def test_files_as_other_programs_write_them(tmp_path: Path) -> None:
    database = tmp_path / "a.db3"
    with sqlite3.connect(database) as connection:
        connection.execute("create table t (x)")
    assert content(npy()) == "a numpy array"
    assert content(gzip.compress(b"ply\n")) == "gzip data"
    assert content(archive("a.ply")) == "a zip archive"
    assert content(archive()) == "an empty zip archive"
    assert "SQLite" in str(content(database.read_bytes()))
    assert content(json.dumps([1, 2]).encode()) == content(b'{"a": 1}') == "a JSON file"


@pytest.mark.parametrize("start", [row[0] for row in _STARTS])
def test_a_beginning_is_known_only_at_the_beginning(start: bytes) -> None:
    what, hint = by_content(start + bytes(20)) or ("", "")
    expected = next(row for row in _STARTS if row[0] == start)
    assert (what, hint) == expected[1:]
    assert hint
    assert content(b"\x00" + start) != what


@pytest.mark.parametrize(
    ("head", "what"),
    [
        (b"\n  <HTML><body>", "a web page"),
        (b"\xef\xbb\xbf<?xml version='1.0'?>\n<robot name='a'>", "a URDF model"),
        (b"<?xml version='1.0'?><sdf>", "an XML file"),
        (b"vn 0 0 1\n", "an OBJ mesh"),
        (b"# cube\nv 1.0 -2 .5\n", "an OBJ mesh"),
        (b"1 2 3\n", "a table of numbers"),
        (b"-1.5e-3;+.5;7.\n", "a table of numbers"),
    ],
)
def test_text_is_told_by_what_it_says(head: bytes, what: str) -> None:
    assert str(content(head)).startswith(what)


@pytest.mark.parametrize("head", [b"", b"one two\n", b"1\n", b"1.2.3 4\n", b"velocity 3\n", b"1e 2e\n", b"nan nan\n"])
def test_what_cannot_be_told_is_not(head: bytes) -> None:
    assert by_content(head) is None


def test_names() -> None:
    assert by_suffix(".STL") == by_suffix(".stl") == _SUFFIXES[".stl"]
    assert (by_suffix(".las") or "")[0] == "a LAS file"
    assert by_suffix(".ply") is None and by_suffix("stl") is None and by_suffix("") is None
    assert all(hint for _, hint in _SUFFIXES.values())
