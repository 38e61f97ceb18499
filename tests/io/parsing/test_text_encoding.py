"""Clouds as editors save them: byte order marks, UTF-16, UTF-32, capitals."""

from __future__ import annotations

import codecs
import hashlib
from pathlib import Path

import numpy as np
import pytest

from dlogen.errors import InputError
from dlogen.io.cloud_files import cloud_bytes, read_raw
from dlogen.io.parsing import text_encoding
from dlogen.io.parsing.text_encoding import plain_text

POINTS = np.random.default_rng(0).normal(size=(50, 3))
SAVED = {
    "utf-8": codecs.BOM_UTF8,
    "utf-16-le": codecs.BOM_UTF16_LE,
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32-le": codecs.BOM_UTF32_LE,
    "utf-32-be": codecs.BOM_UTF32_BE,
}


def text(name: str) -> str:
    return cloud_bytes(name, POINTS, encoding="ascii").decode()


@pytest.mark.parametrize("name", ["a.ply", "a.pcd"])
@pytest.mark.parametrize("encoding", SAVED)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_mark_is_skipped_and_the_hash_is_that_of_the_file(
    tmp_path: Path, name: str, encoding: str, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_encoding, "_CHUNK", 1001)  # pieces end within letters
    path = tmp_path / name
    path.write_bytes(SAVED[encoding] + text(name).replace("\n", end).encode(encoding))
    cloud = read_raw(path)
    assert np.array_equal(cloud.points, POINTS)
    assert cloud.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", ["a.ply", "a.pcd"])
@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_a_mark(tmp_path: Path, name: str, encoding: str) -> None:
    path = tmp_path / name
    path.write_bytes(text(name).encode(encoding))
    assert np.array_equal(read_raw(path).points, POINTS)


def test_comments_need_not_be_utf_8_where_only_a_mark_is_in_the_way(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(codecs.BOM_UTF8 + text("a.ply").encode().replace(b"\nelement", b"\ncomment gr\xfcn\nelement", 1))
    assert np.array_equal(read_raw(path).points, POINTS)


@pytest.mark.parametrize("name", ["a.ply", "a.pcd"])
def test_binary_data_that_went_through_an_editor_are_refused_with_the_reason(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(codecs.BOM_UTF8 + cloud_bytes(name, POINTS).decode("latin-1").encode())
    with pytest.raises(InputError, match=r"a text editor saved this file as UTF-8 text.* binary") as caught:
        read_raw(path)
    assert "export" in caught.value.hint


def test_damaged_text_is_refused_with_the_encoding(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(codecs.BOM_UTF16_LE + text("a.ply").encode("utf-16-le") + b"7")
    with pytest.raises(InputError, match="saved as UTF-16, but is damaged"):
        read_raw(path)


@pytest.mark.parametrize("data", [b"", b"ply\n", b"p\0l\0y", b"\0\0\0\0\0\0\0\0", b"1\0002\0003\0004\0"])
def test_other_files_are_left_as_they_are(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a"
    path.write_bytes(data)
    with plain_text(path) as found:
        assert found == path


@pytest.mark.parametrize("name", ["a.ply", "a.pcd"])
def test_headers_in_capitals(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    end = "end_header\n" if name == "a.ply" else "DATA ascii\n"
    header, rows = text(name).split(end)
    for change in (str.upper, str.lower):
        path.write_text(change(header + end) + rows)
        cloud = read_raw(path)
        assert np.array_equal(cloud.points, POINTS)
        assert (cloud.format, cloud.encoding) == (name[2:], "ascii")


def test_the_magic_word_alone_in_capitals(tmp_path: Path) -> None:
    for encoding in ("binary_little_endian", "ascii"):
        path = tmp_path / "a.ply"
        path.write_bytes(b"PLY" + cloud_bytes("a.ply", POINTS, encoding=encoding)[3:])
        assert np.array_equal(read_raw(path).points, POINTS)
