from __future__ import annotations

import os
import stat
import tempfile
import threading
from pathlib import Path
from typing import Any

import pytest

from dlogen.errors import UsageError
from dlogen.io.atomic import refuse_existing, write_all, write_with

ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def everything(folder) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else b"<folder>"
        for path in sorted(folder.rglob("*"))
    }


def test_writes_all_files_and_makes_folders(tmp_path) -> None:
    write_all({tmp_path / "a.txt": b"one", tmp_path / "new" / "deep" / "b.bin": b"\x00\xff", tmp_path / "c": b""})
    assert everything(tmp_path) == {
        "a.txt": b"one",
        "c": b"",
        "new": b"<folder>",
        "new/deep": b"<folder>",
        "new/deep/b.bin": b"\x00\xff",
    }


def test_overwrites_in_one_step(tmp_path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")
    with path.open("rb") as reader:  # somebody reads the old file meanwhile
        write_all({path: b"new"})
        assert reader.read() == b"old"
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("umask", [0o022, 0o027, 0o077, 0o000])
def test_modes_follow_the_umask(tmp_path, umask: int) -> None:
    before = os.umask(umask)
    try:
        write_all({tmp_path / "a": b""})
        (tmp_path / "b").write_bytes(b"")
        assert os.umask(umask) == umask  # left as it was
    finally:
        os.umask(before)
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in "ab"]
    assert modes[0] == modes[1] == 0o666 & ~umask


def test_a_writer_that_fails_leaves_nothing_behind(tmp_path) -> None:
    (tmp_path / "a.txt").write_bytes(b"old")
    before = everything(tmp_path)

    def disk_full(path) -> None:
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(UsageError, match="No space left on device") as error:
        write_with(
            {
                tmp_path / "a.txt": lambda path: path.write_bytes(b"new"),
                tmp_path / "new" / "b.txt": disk_full,
            }
        )
    assert error.value.path == tmp_path / "new" / "b.txt"
    assert error.value.hint
    assert everything(tmp_path) == before


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_other_failures_leave_nothing_behind_either(tmp_path, failure) -> None:
    def fails(path) -> None:
        path.write_bytes(b"half")
        raise failure

    with pytest.raises(failure):
        write_with({tmp_path / "a": lambda path: path.write_bytes(b"x"), tmp_path / "b": fails})
    assert everything(tmp_path) == {}


@pytest.mark.parametrize("first", ["a", "z"])
def test_a_folder_in_place_of_a_file(tmp_path, first: str) -> None:
    (tmp_path / "m").mkdir()
    for contents in ({first: b"1", "m": b"2"}, {"m": b"2", first: b"1"}):
        with pytest.raises(UsageError, match="it is a folder") as error:
            write_all({tmp_path / name: data for name, data in contents.items()})
        assert error.value.path == tmp_path / "m"
        assert everything(tmp_path) == {"m": b"<folder>"}


def test_a_file_in_place_of_a_folder(tmp_path) -> None:
    (tmp_path / "out").write_bytes(b"a file")
    with pytest.raises(UsageError, match="cannot write"):
        write_all({tmp_path / "a": b"1", tmp_path / "out" / "b": b"2"})
    assert everything(tmp_path) == {"out": b"a file"}


@pytest.mark.skipif(ROOT, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(tmp_path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    with pytest.raises(UsageError, match="Permission denied"):
        write_all({tmp_path / "a": b"1", locked / "b": b"2"})
    assert everything(tmp_path) == {"locked": b"<folder>"}


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a place that nobody can write")
def test_a_place_where_nothing_can_be_made(tmp_path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        write_all({tmp_path / "a": b"1", Path("/proc/self/dlogen/b"): b"2"})
    assert everything(tmp_path) == {}


def test_a_name_that_is_too_long(tmp_path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        write_all({tmp_path / "a": b"1", tmp_path / ("b" * 300): b"2"})
    assert everything(tmp_path) == {}


def test_nothing_to_write(tmp_path) -> None:
    write_all({})
    assert everything(tmp_path) == {}


def test_temporary_names_keep_the_ending(tmp_path) -> None:
    seen = []

    def writer(path) -> None:  # as libraries that choose the format by the name
        seen.append(path)
        path.write_bytes(b"x")

    write_with({tmp_path / "cloud.truth.json": writer})
    assert seen[0].suffix == ".json"
    assert seen[0].parent == tmp_path
    assert seen[0].name.startswith(".")


def test_readers_never_see_half_a_file(tmp_path) -> None:
    path, size = tmp_path / "big", 2_000_000
    write_all({path: b"0" * size})
    seen, done = set(), threading.Event()

    def read() -> None:
        while not done.is_set():
            data = path.read_bytes()
            seen.add((len(data), data[:1], data[-1:]))

    thread = threading.Thread(target=read)
    thread.start()
    for k in range(30):
        write_all({path: str(k % 10).encode() * size})
    done.set()
    thread.join()
    assert all(length == size and first == last for length, first, last in seen)


def test_refuse_existing(tmp_path) -> None:
    a, b, c = (tmp_path / name for name in "abc")
    refuse_existing([a, b, c], force=False)
    a.write_bytes(b"")
    with pytest.raises(UsageError, match=r"output exists: .*/a \(") as error:
        refuse_existing([a, b, c], force=False)
    assert error.value.exit_code == 2
    assert "--force" in error.value.hint
    b.write_bytes(b"")
    with pytest.raises(UsageError, match="a and 1 more"):
        refuse_existing([a, b, c], force=False)
    refuse_existing([a, b, c], force=True)
    assert everything(tmp_path) == {"a": b"", "b": b""}


def test_a_link_that_leads_nowhere_exists(tmp_path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "gone")
    with pytest.raises(UsageError, match="output exists"):
        refuse_existing([link], force=False)


def test_a_folder_that_another_process_removes_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # It had made it, could not write there, and tidied up: between our look at the folder and our file in it.
    make, removed = tempfile.mkstemp, []

    def mkstemp(*arguments: Any, **options: Any) -> tuple[int, str]:
        if not removed:
            (tmp_path / "a").rmdir()
            removed.append("a")
        return make(*arguments, **options)

    monkeypatch.setattr(tempfile, "mkstemp", mkstemp)
    write_all({tmp_path / "a" / "x": b"1", tmp_path / "a" / "y": b"2"})
    assert removed
    assert {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()} == {"x": b"1", "y": b"2"}
