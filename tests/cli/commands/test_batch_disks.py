"""Disks that are full, read-only or no folder at all."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from batch_runs import (
    DLOGEN,
    PATIENCE,
    QUICK,
    run,
)

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")


INSIDE = f"""
import json, os, subprocess, sys
from pathlib import Path

def mount(*arguments):
    subprocess.run(["mount", *arguments], check=True)

def batch(out, *more):
    command = {[*DLOGEN, "batch", "in", *QUICK, "--format", "json", "-j", "1", "-o"]!r}
    done = subprocess.run([*command, out, *more], capture_output=True, text=True)
    return [done.returncode, done.stderr]

def names(out):
    return sorted(str(path.relative_to(out)) for path in Path(out).rglob("*") if path.is_file())

def rows(out):
    import sqlite3
    database = sqlite3.connect(f"{{out}}/dlogen.sqlite")
    assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    found = [status for status, in database.execute("SELECT status FROM clouds")]
    database.close()
    return found

os.mkdir("disk")
said = {{}}
"""


def inside(folder: Path, code: str) -> Any:
    """What a program says that may mount things, where this may be done at all."""
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-rm", "mount", "-t", "tmpfs", "none", folder]).returncode != 0:
        pytest.skip("nothing can be mounted here")
    program = f"{INSIDE}\n{code}\nprint(json.dumps(said))"
    result = subprocess.run(
        [unshare, "-rm", sys.executable, "-c", program],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=4 * PATIENCE,
    )
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_a_disk_that_is_full(workshop: Path) -> None:
    said = inside(
        workshop,
        """
mount("-t", "tmpfs", "-o", "size=400k", "none", "disk")
said["middle"] = batch("disk/out")
said["rows"] = rows("disk/out")
said["again"] = batch("disk/out")
mount("-o", "remount,size=10m", "disk")
said["with room"] = batch("disk/out")
said["names"] = names("disk/out")
os.mkdir("disk/full")
with open("disk/more", "wb", buffering=0) as stream:
    try:
        while True: stream.write(bytes(1 << 12))
    except OSError: pass
said["full before"] = batch("disk/full")
os.unlink("disk/more")
said["and then"] = batch("disk/full")
""",
    )
    for when in ("middle", "again"):
        code, err = said[when]
        assert code == 1, err
        assert "No space left" in err or "full" in err
        assert "clouds are done and recorded" in err
        assert "free some space and run the same command again" in err
        assert "Traceback" not in err
    assert 0 < said["rows"].count("done") < 10
    assert said["rows"].count("failed") == 0
    assert f"{said['rows'].count('done')} of 10 clouds are done and recorded" in said["middle"][1]
    assert said["with room"][0] == 0, said["with room"][1]
    assert len(said["names"]) == 2 * 10 + 4
    code, err = said["full before"]
    assert code in (1, 2)
    assert "full" in err or "No space left" in err or "disk I/O" in err
    assert "space" in err.partition("hint: ")[2]
    assert "Traceback" not in err
    assert said["and then"][0] == 0, said["and then"][1]


def test_a_disk_without_room_for_more_files(workshop: Path) -> None:
    said = inside(
        workshop,
        """
mount("-t", "tmpfs", "-o", "nr_inodes=14", "none", "disk")
said["full"] = batch("disk/out")
said["rows"] = rows("disk/out")
mount("-o", "remount,nr_inodes=200", "disk")
said["with room"] = batch("disk/out")
said["names"] = names("disk/out")
os.mkdir("disk/other")
try:
    for i in range(200): Path(f"disk/{i}").touch()
except OSError: pass
said["before"] = batch("disk/other")
""",
    )
    code, err = said["full"]
    assert code == 1
    assert "No space left" in err
    assert "Traceback" not in err
    assert said["rows"].count("failed") == 0
    assert said["with room"][0] == 0, said["with room"][1]
    assert len(said["names"]) == 2 * 10 + 4
    code, err = said["before"]
    assert code in (1, 2)
    assert "hint: " in err
    assert "Traceback" not in err


def test_a_disk_that_is_read_only(workshop: Path) -> None:
    said = inside(
        workshop,
        """
mount("-t", "tmpfs", "-o", "size=10m", "none", "disk")
os.mkdir("disk/empty")
said["first"] = batch("disk/done")
mount("-o", "remount,ro", "disk")
said["refused"] = [batch(f"disk/{name}") for name in ("new", "empty", "done")]
said["names"] = names("disk")
""",
    )
    assert said["first"][0] == 0
    for code, err in said["refused"]:
        assert code == 2, err
        assert "disk/" in err
        assert "hint: choose another" in err
        assert "Traceback" not in err
    assert len(said["names"]) == 2 * 10 + 4


def test_a_folder_that_is_none(captures: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "dlogen.sqlite").write_text("no database, but long enough to be looked at " * 100)
    for out in ("file", "file/below", "out"):
        result = run(captures, "in", "-o", tmp_path / out)
        assert result.returncode == 2, result.stderr
        assert str(tmp_path / out) in result.stderr
        assert "hint: " in result.stderr
        assert "Traceback" not in result.stderr
    assert (tmp_path / "file").read_text() == "mine"
    assert (tmp_path / "out" / "dlogen.sqlite").read_text().startswith("no database")
