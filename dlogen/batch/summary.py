"""What came out of a batch, in two files: `summary.csv`, a row for every cloud, and `summary.json`."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlogen._version import __version__
from dlogen.batch.metrics import METRICS
from dlogen.batch.store import Row, Store
from dlogen.io.atomic import write_with
from dlogen.io.json_text import dump_json

CSV_NAME, JSON_NAME = "summary.csv", "summary.json"

SCHEMA = "dlogen.batch/1"

#: How many clouds are named for a cause.
_EXAMPLES = 3

# No seconds: the same clouds and settings give the same bytes. They are in the records.
_COLUMNS = (
    *("key", "cloud", "status", "verdict", "findings"),
    *(item.name for item in METRICS),
    *("code", "stage", "error", "sha256"),
)


@dataclass
class Cause:
    """Failures that have the same reason.

    Attributes:
        code: kind of failure.
        stage: that it happened in, if any.
        error: the message of the first.
        hint: what to try.
        clouds: some of them; `count` of all.
    """

    code: str
    stage: str | None
    error: str
    hint: str | None
    clouds: list[str] = field(default_factory=list)
    count: int = 0

    def add(self, row: Row) -> None:
        """Count one more."""
        self.count += 1
        if len(self.clouds) < _EXAMPLES:
            self.clouds.append(row.cloud)


class Causes:
    """Failures grouped: by code, stage, and message but for its numbers and names."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str | None, str], Cause] = {}

    def add(self, row: Row) -> None:
        """Take one in."""
        code, error = row.code or "", row.error or ""
        cause = self._found.setdefault(
            (code, row.stage, _without_specifics(error)), Cause(code, row.stage, error, row.hint)
        )
        cause.add(row)

    def sorted(self) -> list[Cause]:
        """The most frequent first."""
        return sorted(self._found.values(), key=lambda cause: (-cause.count, cause.code, cause.error))


def _without_specifics(message: str) -> str:
    return re.sub(r"'[^']*'|\S*/\S*|[-+]?\d[\d.,e+-]*", "#", message)


def write_summary(store: Store, folder: Path) -> None:
    """Write both files from all records of the folder.

    Raises:
        OutputError: they cannot be written.
    """
    totals = _Totals()

    def table(path: Path) -> None:
        # Names of files that are not Unicode were made so in the records.
        with path.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            # A lone carriage return ends a line for readers, but is no reason for the writer to quote.
            quoting = csv.writer(stream, lineterminator="\n", quoting=csv.QUOTE_ALL)
            writer.writerow(_COLUMNS)
            for row in store.rows():
                totals.add(row)
                values = row.values()
                fields = ["" if values[name] is None else values[name] for name in _COLUMNS]
                (quoting if any("\r" in str(field) for field in fields) else writer).writerow(fields)

    def totals_file(path: Path) -> None:
        path.write_text(dump_json(totals.to_dict()), encoding="utf-8")

    write_with({folder / CSV_NAME: table, folder / JSON_NAME: totals_file})


class _Totals:
    def __init__(self) -> None:
        self.status: Counter[str] = Counter()
        self.verdicts: Counter[str] = Counter()
        self.findings: Counter[str] = Counter()
        self.causes = Causes()
        self.values: dict[str, list[float]] = {item.name: [] for item in METRICS}

    def add(self, row: Row) -> None:
        self.status[row.status] += 1
        if row.verdict is not None:
            self.verdicts[row.verdict] += 1
        self.findings.update((row.findings or "").split())
        if row.status == "failed":
            self.causes.add(row)
        for name, values in self.values.items():
            if (value := row.metrics.get(name)) is not None:
                values.append(value)

    def to_dict(self) -> dict[str, Any]:
        return {
            "schema": SCHEMA,
            "dlogen": __version__,
            "units": {"length": "m"},
            "clouds": sum(self.status.values()),
            "done": self.status["done"],
            "failed": self.status["failed"],
            "unfinished": self.status["running"],
            "verdicts": {name: self.verdicts[name] for name in ("good", "doubtful", "bad")},
            "findings": dict(sorted(self.findings.items())),
            "figures": {name: _spread(values) for name, values in self.values.items()},
            "failures": [vars(cause) for cause in self.causes.sorted()],
        }


def _spread(values: Iterable[float]) -> dict[str, float] | None:
    ordered = sorted(values)
    if not ordered:
        return None
    n = len(ordered)
    return {
        "min": ordered[0],
        "median": 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2]),
        "p95": ordered[min(n - 1, int(0.95 * n))],
        "max": ordered[-1],
    }
