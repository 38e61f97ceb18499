"""The records of a batch: `dlogen.sqlite`, a row for every cloud, written as the results come in.

Every change is a transaction of its own in a write-ahead log: whoever reads it sees whole rows, and a process that is
killed leaves a consistent file.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlogen.batch.metrics import METRICS
from dlogen.errors import OutputError, UsageError

NAME = "dlogen.sqlite"
LOCK = ".dlogen.lock"

#: Layout of the tables; a file with another number was made by another version.
_LAYOUT = 1

_COLUMNS = {
    "key": "TEXT PRIMARY KEY",
    "cloud": "TEXT NOT NULL",
    "status": "TEXT NOT NULL",
    "code": "TEXT",
    "error": "TEXT",
    "hint": "TEXT",
    "stage": "TEXT",
    "verdict": "TEXT",
    "findings": "TEXT",
    **{item.name: "INTEGER" if item.whole else "REAL" for item in METRICS},
    "seconds": "REAL",
    "timings": "TEXT",
    "size": "INTEGER",
    "modified_ns": "INTEGER",
    "sha256": "TEXT",
    "digest": "TEXT",
    "version": "TEXT",
    "formats": "TEXT",
}


@dataclass
class Row:
    """The record of a cloud.

    Attributes:
        key: where its results are, below the folder of the batch and without an ending.
        cloud: the file, as it was named.
        status: "running", "done" or "failed".
        code, error, hint, stage: of a failure.
        verdict, findings: of a model; codes with blanks between them.
        metrics: of a model, by the names of `METRICS`.
        seconds: that it took; `timings` of its stages, JSON.
        size, modified_ns, sha256: of the cloud's file.
        digest: of settings, wanted files and version.
        version: of dlogen.
        formats: of which it has, or may have, files that a batch made; `Outputs.names` with blanks between them.
    """

    key: str
    cloud: str
    status: str
    code: str | None = None
    error: str | None = None
    hint: str | None = None
    stage: str | None = None
    verdict: str | None = None
    findings: str | None = None
    metrics: dict[str, float | None] = field(default_factory=dict)
    seconds: float | None = None
    timings: str | None = None
    size: int | None = None
    modified_ns: int | None = None
    sha256: str | None = None
    digest: str | None = None
    version: str | None = None
    formats: str = ""

    def values(self) -> dict[str, Any]:
        """By column."""
        out = dict(vars(self))
        out |= {item.name: out["metrics"].get(item.name) for item in METRICS}
        del out["metrics"]
        return {name: out[name] for name in _COLUMNS}

    @classmethod
    def of(cls, values: dict[str, Any]) -> Row:
        """The opposite of `values`."""
        rest = dict(values)
        metrics = {item.name: rest.pop(item.name) for item in METRICS}
        return cls(**rest, metrics=metrics)

    def to_dict(self) -> dict[str, Any]:
        """As it stands in the lines of `--json`: without what is empty or only for dlogen itself."""
        own = ("timings", "size", "modified_ns", "digest", "version", "formats")
        out = {name: value for name, value in self.values().items() if value is not None and name not in own}
        if self.findings is not None:
            out["findings"] = self.findings.split()
        if self.timings is not None:
            out["timings"] = json.loads(self.timings)
        return out


class Store:
    """The records in a folder, for one process at a time.

    Args:
        folder: of the results; made if it is not there.

    Raises:
        UsageError: another process writes to it.
        OutputError: it cannot be written, or the records there are damaged or of another version.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot make the folder: {error.strerror or error}", "choose another with -o", path=folder
            ) from error
        self._lock = _lock(folder)
        try:
            with self._errors():
                self._open()
        except BaseException:
            self._lock.close()
            raise

    def _open(self) -> None:
        self._database = sqlite3.connect(self.path, isolation_level=None, timeout=30.0)
        self._database.row_factory = sqlite3.Row
        (layout,) = self._database.execute("PRAGMA user_version").fetchone()
        if layout not in (0, _LAYOUT):
            raise UsageError(
                f"its records have layout {layout}, this version of dlogen writes {_LAYOUT}",
                "choose another folder with -o, or use the version of dlogen that made it",
                path=self.path,
            )
        # Readers do not wait for the writer. Where the file system cannot do that, sqlite stays with its older way.
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = NORMAL")
        columns = ", ".join(f"{name} {kind}" for name, kind in _COLUMNS.items())
        self._database.execute("BEGIN IMMEDIATE")
        self._database.execute(f"CREATE TABLE IF NOT EXISTS clouds ({columns})")
        self._database.execute(f"PRAGMA user_version = {_LAYOUT}")
        self._database.execute("COMMIT")

    def rows(self) -> Iterator[Row]:
        """All records, in the order of their keys."""
        with self._errors():
            for row in self._database.execute(_READ):
                yield Row.of(dict(row))

    def write(self, row: Row) -> None:
        """Put a record in the place of the one with the same key.

        Raises:
            OutputError: the disk is full, or the file is no longer there.
        """
        with self._errors():
            self._database.execute(_WRITE, tuple(row.values().values()))

    def close(self) -> None:
        """Let others have the folder."""
        with contextlib.suppress(sqlite3.Error):
            self._database.close()
        self._lock.close()

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            if "full" in str(error):
                hint = "free some space and run the same command again: it goes on where it stopped"
            elif type(error) is sqlite3.DatabaseError or "column" in str(error):
                hint = "the file is damaged, or not of dlogen: rename it, and all clouds are done again"
            else:
                hint = "choose another folder with -o, or check its permissions and free space"
            raise OutputError(f"cannot keep the records: {error}", hint, path=self.path, for_all=True) from error


_READ = f"SELECT {', '.join(_COLUMNS)} FROM clouds ORDER BY key"
_WRITE = f"INSERT OR REPLACE INTO clouds ({', '.join(_COLUMNS)}) VALUES ({', '.join('?' * len(_COLUMNS))})"


def _lock(folder: Path) -> sqlite3.Connection:
    """Hold the folder until the connection is closed or the process ends, however it does.

    An exclusive transaction on an empty database: a lock that works in the same way on all systems.
    """
    lock = None
    try:
        lock = sqlite3.connect(folder / LOCK, isolation_level=None, timeout=0.0)
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if lock is not None:
            lock.close()
        if "locked" in str(error):
            raise UsageError(
                "another dlogen process is writing to this folder",
                "wait until it has ended, or choose another folder with -o",
                path=folder,
            ) from None
        raise OutputError(
            f"cannot write: {error}",
            "choose another folder with -o, or check its permissions and free space",
            path=folder,
            for_all=True,
        ) from error
    return lock
