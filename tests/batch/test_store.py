"""The records of a batch: what is put in comes out, whatever happens to the process or the file."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from dlogen.batch.metrics import METRICS
from dlogen.batch.store import LOCK, NAME, Row, Store
from dlogen.errors import OutputError, UsageError


def full_row(key: str = "a/x") -> Row:
    return Row(
        key,
        "in/x.ply",
        "done",
        verdict="good",
        findings="gap touching",
        metrics={item.name: i if item.whole else i / 7 for i, item in enumerate(METRICS)},
        seconds=0.25,
        timings='{"input": 0.1}',
        size=2**40,
        modified_ns=2**62,
        sha256="ab" * 32,
        digest="cd" * 32,
        version="0.1",
        formats="urdf json",
    )


def test_records_come_back_as_they_were(tmp_path: Path) -> None:
    failed = Row("b", "in/new\nline 'ü'.ply", "failed", code="fit", error="e", hint="h", stage="s")
    store = Store(tmp_path / "made" / "here")
    for row in (failed, full_row("c"), full_row(), Row("c", "in/c.ply", "running")):
        store.write(row)
    store.close()
    again = Store(tmp_path / "made" / "here")
    nothing = {item.name: None for item in METRICS}
    failed.metrics = nothing
    # In the order of the keys; the last one with a key counts.
    assert list(again.rows()) == [full_row(), failed, Row("c", "in/c.ply", "running", metrics=nothing)]
    again.close()


def test_a_line_of_json_is_for_users() -> None:
    line = full_row().to_dict()
    assert line["findings"] == ["gap", "touching"]
    assert line["timings"] == {"input": 0.1}
    assert line["segment_count"] == full_row().metrics["segment_count"]
    assert "digest" not in line
    assert "formats" not in line
    assert "error" not in line
    failed = Row("b", "b.ply", "failed", code="fit", error="e", hint="h", stage="s").to_dict()
    assert failed == {
        "key": "b",
        "cloud": "b.ply",
        "status": "failed",
        "code": "fit",
        "error": "e",
        "hint": "h",
        "stage": "s",
    }


def test_one_process_at_a_time(tmp_path: Path) -> None:
    hold = "import sys; from dlogen.batch.store import *; "
    hold += "store = Store(Path(sys.argv[1])); print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(UsageError, match="another dlogen process") as raised:
            Store(tmp_path)
        assert raised.value.exit_code == 2
        assert raised.value.hint
        # However it ends.
        other.kill()
    Store(tmp_path).close()
    # In this process as well.
    first = Store(tmp_path)
    with pytest.raises(UsageError):
        Store(tmp_path)
    first.close()
    Store(tmp_path).close()


def test_readers_are_not_in_the_way(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(full_row("a"))
    reader = sqlite3.connect(tmp_path / NAME)
    rows = reader.execute("SELECT key FROM clouds")
    assert rows.fetchone() == ("a",)
    store.write(full_row("b"))
    assert reader.execute("SELECT count(*) FROM clouds").fetchone() == (2,)
    reader.close()
    store.close()


@pytest.mark.parametrize("moment", [1, 20, 200])
def test_killed_while_it_writes(tmp_path: Path, moment: int) -> None:
    code = (
        "import sys; from dlogen.batch.store import *; l = Store(Path(sys.argv[1])); i = 0\n"
        "while True: l.write(Row(f'{i:09}', 'x' * 5000, 'done')); print(i, flush=True); i += 1\n"
    )
    with subprocess.Popen([sys.executable, "-c", code, tmp_path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        for _ in range(moment):
            process.stdout.readline()
        process.kill()
    store = Store(tmp_path)
    keys = [int(row.key) for row in store.rows()]
    store.close()
    assert len(keys) >= moment
    assert keys == list(range(len(keys)))
    database = sqlite3.connect(tmp_path / NAME)
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    database.close()


def refused(folder: Path) -> OutputError:
    with pytest.raises((OutputError, UsageError)) as raised:
        Store(folder)
    assert raised.value.exit_code == 2
    assert raised.value.hint
    return raised.value  # type: ignore[return-value]


def test_what_is_not_the_records_of_a_batch_is_left_alone(tmp_path: Path) -> None:
    for i, content in enumerate((b"certainly not a database " * 100, b"SQLite format 3\0" + bytes(range(256)) * 20)):
        folder = tmp_path / str(i)
        folder.mkdir()
        (folder / NAME).write_bytes(content)
        error = refused(folder)
        assert error.path == folder / NAME
        assert "rename" in str(error.hint)
        assert (folder / NAME).read_bytes() == content
        # The lock is not kept.
        (folder / NAME).unlink()
        Store(folder).close()


def test_records_of_another_layout(tmp_path: Path) -> None:
    database = sqlite3.connect(tmp_path / NAME)
    database.execute("PRAGMA user_version = 99")
    database.close()
    assert "layout 99" in refused(tmp_path).message
    (tmp_path / NAME).unlink()
    database = sqlite3.connect(tmp_path / NAME)
    database.execute("CREATE TABLE clouds (name TEXT)")
    database.commit()
    database.close()
    with pytest.raises(OutputError, match="column") as raised:
        list(Store(tmp_path).rows())
    assert "rename" in str(raised.value.hint)


def test_folders_that_cannot_be_one(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    assert refused(tmp_path / "file").path == tmp_path / "file"
    assert refused(tmp_path / "file" / "below").path == tmp_path / "file" / "below"
    assert (tmp_path / "file").read_text() == "mine"
    for name in (LOCK, NAME):
        (tmp_path / "out" / name).mkdir(parents=True)
        refused(tmp_path / "out")
        (tmp_path / "out" / name).rmdir()


def test_a_full_disk_says_so(tmp_path: Path) -> None:
    store = Store(tmp_path)
    pages = store._database.execute("PRAGMA page_count").fetchone()[0]
    store._database.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(OutputError, match="full") as raised:
        for i in range(1000):
            store.write(Row(str(i), "x" * 5000, "done"))
    assert raised.value.for_all
    assert "space" in str(raised.value.hint)
    store.close()


def test_the_columns_are_documented_in_the_type() -> None:
    assert json.loads(json.dumps(full_row().values())) == full_row().values()
    assert Row.of(full_row().values()) == full_row()
