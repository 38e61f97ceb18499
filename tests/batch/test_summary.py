"""The two files at the end of a batch."""

from __future__ import annotations

import csv
import json
import statistics
from pathlib import Path

import pytest

from dlogen.batch.metrics import METRICS
from dlogen.batch.store import Row, Store
from dlogen.batch.summary import Causes, write_summary
from dlogen.errors import UsageError


def done(key: str, length: float, verdict: str = "good", findings: str = "", **more: float) -> Row:
    metrics = {item.name: 1 if item.whole else 0.5 for item in METRICS} | {"length": length} | more
    return Row(key, f"in/{key}.ply", "done", verdict=verdict, findings=findings, metrics=metrics, sha256="ab")


def failed(key: str, error: str, code: str = "input", stage: str | None = None, hint: str | None = "h") -> Row:
    return Row(key, f"in/{key}.ply", "failed", code=code, error=error, hint=hint, stage=stage)


def summary(folder: Path, *rows: Row) -> tuple[list[dict[str, str]], dict[str, object]]:
    store = Store(folder)
    for row in rows:
        store.write(row)
    write_summary(store, folder)
    store.close()
    with (folder / "summary.csv").open(newline="", encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    return table, json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_numbers(tmp_path: Path) -> None:
    lengths = [3.0, 1.0, 2.0, 10.0]
    table, totals = summary(
        tmp_path,
        *(done(f"d{i}", length) for i, length in enumerate(lengths)),
        done("e", 4.0, "doubtful", "gap touching"),
        done("f", 5.0, "bad", "gap"),
        failed("g", "no points"),
        Row("h", "in/h.ply", "running"),
    )
    assert totals["clouds"] == 8
    assert (totals["done"], totals["failed"], totals["unfinished"]) == (6, 1, 1)
    assert totals["verdicts"] == {"good": 4, "doubtful": 1, "bad": 1}
    assert totals["findings"] == {"gap": 2, "touching": 1}
    assert totals["figures"]["length"] == {"min": 1.0, "median": 3.5, "p95": 10.0, "max": 10.0}  # type: ignore[index]
    assert [row["key"] for row in table] == ["d0", "d1", "d2", "d3", "e", "f", "g", "h"]
    assert float(table[0]["length"]) == 3.0
    assert table[6]["error"] == "no points"
    assert table[6]["length"] == ""
    # Times differ from run to run, these files do not.
    assert not {"seconds", "timings"} & set(table[0])


def test_of_nothing(tmp_path: Path) -> None:
    table, totals = summary(tmp_path)
    assert table == []
    assert totals["clouds"] == 0
    assert totals["figures"]["length"] is None  # type: ignore[index]
    assert totals["failures"] == []


@pytest.mark.parametrize("lengths", [[3.0], [3.0, 1.0], [9.0, 1.0, 4.0], [1.0, 7.0, 2.0, 5.0, 3.0]])
def test_spread_of_few(tmp_path: Path, lengths: list[float]) -> None:
    _, totals = summary(tmp_path, *(done(f"{i}", length) for i, length in enumerate(lengths)))
    spread = totals["figures"]["length"]  # type: ignore[index]
    expected = (min(lengths), statistics.median(lengths), max(lengths))
    assert (spread["min"], spread["median"], spread["max"]) == expected


def test_percentile_of_many(tmp_path: Path) -> None:
    _, totals = summary(tmp_path, *(done(f"{i:03}", float(i)) for i in range(1, 101)))
    spread = totals["figures"]["length"]  # type: ignore[index]
    assert (spread["min"], spread["median"], spread["max"]) == (1.0, 50.5, 100.0)
    assert spread["p95"] == pytest.approx(95.5, abs=0.5)


def test_names_survive_the_table(tmp_path: Path) -> None:
    keys = sorted(["a b", "new\nline", "cr\rcr", "tab\tx", 'quo"te', "comma,x", "grüße-日本", "-dash", "\\xff", "=1+1"])
    table, _ = summary(tmp_path, *(done(key, 1.0) for key in keys))
    assert [row["key"] for row in table] == keys
    assert all(row["sha256"] == "ab" for row in table)


def test_failures_with_the_same_reason_are_together(tmp_path: Path) -> None:
    _, totals = summary(
        tmp_path,
        *(failed(f"a{i}", f"the header claims {500 + i} points, the file holds {i}") for i in range(5)),
        failed("b1", "a/b1.yaml: line 3: unknown key 'e_maxx'", "config"),
        failed("b2", "/c/b2.yaml: line 14: unknown key 'taux'", "config"),
        failed("c1", "too short", "fit", "ordering"),
        failed("c2", "too short", "fit", "segmentation"),
    )
    causes = totals["failures"]
    assert [(cause["code"], cause["stage"], cause["count"]) for cause in causes] == [  # type: ignore[attr-defined]
        ("input", None, 5),
        ("config", None, 2),
        ("fit", "ordering", 1),
        ("fit", "segmentation", 1),
    ]
    assert causes[0]["clouds"] == ["in/a0.ply", "in/a1.ply", "in/a2.ply"]  # type: ignore[index]
    assert causes[0]["error"] == "the header claims 500 points, the file holds 0"  # type: ignore[index]
    assert causes[0]["hint"] == "h"  # type: ignore[index]


def test_causes_are_the_same_in_any_order() -> None:
    rows = [failed(f"a{i}", "one") for i in range(2)] + [failed(f"b{i}", "two") for i in range(3)]
    for order in (rows, rows[::-1]):
        causes = Causes()
        for row in order:
            causes.add(row)
        assert [(cause.error, cause.count) for cause in causes.sorted()] == [("two", 3), ("one", 2)]


def test_all_or_nothing_is_written(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(done("a", 1.0))
    (tmp_path / "summary.json").mkdir()
    with pytest.raises(UsageError, match="folder"):
        write_summary(store, tmp_path)
    store.close()
    assert not (tmp_path / "summary.csv").exists()
    assert not list(tmp_path.glob(".dlogen-*"))
