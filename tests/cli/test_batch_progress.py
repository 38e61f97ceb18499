"""What a batch says while it runs and at its end, with a pool that does nothing."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dlogen.batch.executors.worker import NotStarted
from dlogen.batch.item import Item
from dlogen.batch.job import Failure, Outcome, Plan, Task
from dlogen.batch.metrics import METRICS, Threshold
from dlogen.batch.runner import Batch
from dlogen.batch.store import Store
from dlogen.cli.batch_progress import run_batch
from dlogen.cli.console import Console
from dlogen.errors import DlogenError, Interrupted, OutputError, UsageError


def good(key: str, **metrics: float) -> Outcome:
    values = {item.name: 1 if item.whole else 0.5 for item in METRICS} | metrics
    return Outcome(key, verdict="good", metrics=values, sha256="ab", seconds=0.1, timings={"input": 0.1})


def bad(key: str, message: str = "no points", code: str = "input") -> Outcome:
    return Outcome(key, Failure(code, message, "try this"))


class Said:
    """A pool whose outcomes are known.

    Args:
        outcomes: in this order; what is called instead raises something.
    """

    def __init__(self, *outcomes: Outcome | Callable[[], Any]) -> None:
        self.outcomes = outcomes
        self.closed = False

    def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
        try:
            list(tasks)
            for outcome in self.outcomes:
                if isinstance(outcome, Outcome):
                    yield outcome
                else:
                    outcome()
        finally:
            self.closed = True


class Setting:
    def __init__(self, folder: Path, plan: Plan) -> None:
        self.folder, self.plan = folder, plan

    def run_batch(self, pool: Said, keys: str = "", level: int = 0, **how: Any) -> None:
        """Clouds whose keys are single letters, by default those that the pool knows of."""
        names = keys or "".join(item.key for item in pool.outcomes if isinstance(item, Outcome))
        store = Store(self.folder)
        try:
            batch = Batch([Item(f"in/{name}.ply", name) for name in names], self.folder, self.plan, store)
            run_batch(batch, pool, Console(level), **how)
        finally:
            store.close()

    def summary(self) -> dict[str, Any]:
        return json.loads((self.folder / "summary.json").read_text())  # type: ignore[no-any-return]


@pytest.fixture
def setting(tmp_path: Path, plan: Plan) -> Setting:
    return Setting(tmp_path / "out", plan)


def test_all_good(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    setting.run_batch(Said(good("a"), good("b")))
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == f"2 clouds in 0 s: 2 done (2 good), 0 failed; {setting.folder / 'summary.csv'}\n"
    assert setting.summary()["done"] == 2


def test_one_cloud_is_not_clouds(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    setting.run_batch(Said(good("a")))
    assert capsys.readouterr().err.startswith("1 cloud in 0 s: 1 done")


def test_failures_are_grouped_by_cause(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    pool = Said(good("a"), *(bad(key, f"line {i} is wrong") for i, key in enumerate("bcdef")), bad("g", "odd", "fit"))
    with pytest.raises(DlogenError, match="6 of 7 clouds failed") as raised:
        setting.run_batch(pool)
    assert raised.value.exit_code == 1
    assert capsys.readouterr().err.splitlines()[1:] == [
        "warning: 5 x line 0 is wrong [input]: in/b.ply, in/c.ply, in/d.ply, ...",
        "hint: try this",
        "warning: 1 x odd [fit]: in/g.ply",
        "hint: try this",
    ]
    assert [cause["count"] for cause in setting.summary()["failures"]] == [5, 1]
    # They may, and it is said all the same.
    setting.run_batch(Said(), "abcdefg", tolerant=True)
    assert "5 x line 0 is wrong" in capsys.readouterr().err


def test_many_causes_are_not_all_named(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["".join((a, b)) for a in "xyzw" for b in "xyzw"]
    with pytest.raises(DlogenError):
        setting.run_batch(Said(*(bad(key, word) for key, word in zip("abcdefghijklmnop", words, strict=True))))
    said = capsys.readouterr().err.splitlines()
    assert len([line for line in said if line.startswith("warning: 1 x")]) == 10
    assert said[-1].startswith("warning: and 6 other causes: see ")


def test_quiet_and_verbose(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DlogenError):
        setting.run_batch(Said(good("a"), bad("b")), level=-1)
    assert capsys.readouterr().err == ""
    with pytest.raises(DlogenError):
        setting.run_batch(Said(good("c", length=1.5), bad("d")), level=1)
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "in/c.ply: 1.5000 m, 1 segments, deviation 500.00 mm, good"
    assert said[1] == "in/d.ply: no points [input]"


def test_names_do_not_garble_the_terminal(setting: Setting, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    store = Store(setting.folder)
    batch = Batch([Item("in/\x1b[31m\n.ply", "x")], setting.folder, setting.plan, store)
    with pytest.raises(DlogenError):
        run_batch(batch, Said(bad("x")), Console(1))
    store.close()
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert len(said.splitlines()) == 4


def test_lines_of_json(setting: Setting, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    with pytest.raises(DlogenError):
        setting.run_batch(Said(good("a"), bad("ü")), as_json=True)
    lines = [json.loads(line) for line in capfdbinary.readouterr().out.decode("utf-8").splitlines()]
    assert [(line["key"], line["status"]) for line in lines] == [("a", "done"), ("ü", "failed")]
    assert lines[0]["length"] == 0.5
    assert (lines[1]["code"], lines[1]["error"], lines[1]["hint"]) == ("input", "no points", "try this")
    # What was there before comes as well, and says so.
    with pytest.raises(DlogenError):
        setting.run_batch(Said(), "aü", as_json=True)
    # Clouds that do not exist come again: their results are not there.
    assert capfdbinary.readouterr().out.decode("utf-8").count('"kept": true') == 1


def test_limits_hold_for_what_was_done_before_as_well(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    limits = [Threshold("max_deviation", 0.01), Threshold("length", 10.0)]
    pool = Said(good("a", max_deviation=0.02), good("b", max_deviation=0.01), bad("c"))
    with pytest.raises(DlogenError, match=r"1 of 3 clouds failed; max_deviation is above 0[.]01 for 1 "):
        setting.run_batch(pool, thresholds=limits)
    assert "1 x max_deviation is above 0.01: in/a.ply (0.02)" in capsys.readouterr().err


def test_clouds_above_a_limit_are_not_all_named(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    limits = [Threshold("length", 1.0)]
    for count in (10, 11, 13):
        pool = Said(*(good(key, length=2.0) for key in "abcdefghijklm"[:count]))
        with pytest.raises(DlogenError, match=f"length is above 1 for {count}"):
            Setting(setting.folder / str(count), setting.plan).run_batch(pool, thresholds=limits)
        (said,) = (line for line in capsys.readouterr().err.splitlines() if " x length is above 1: " in line)
        named = re.findall(r"in/\w[.]ply [(]2[)]", said)
        assert len(named) == 10
        left = re.search(r" and (\d+) more$", said)
        assert len(named) + (int(left[1]) if left else 0) == count


def test_strict_wants_good_models(setting: Setting, capsys: pytest.CaptureFixture[str]) -> None:
    pool = Said(good("a"), replace(good("b"), verdict="doubtful"), replace(good("c"), verdict="bad"))
    with pytest.raises(DlogenError, match="the verdict is not good for 2"):
        setting.run_batch(pool, strict=True)
    assert "2 x the verdict is not good: in/b.ply (doubtful), in/c.ply (bad)" in capsys.readouterr().err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_tidily(setting: Setting, number: signal.Signals, code: int) -> None:
    before = signal.getsignal(signal.SIGTERM)
    pool = Said(good("a"), lambda: os.kill(os.getpid(), number), good("b"))
    with pytest.raises(Interrupted, match="1 of 2 clouds are done and recorded") as raised:
        setting.run_batch(pool)
    assert raised.value.exit_code == code
    assert pool.closed
    assert (setting.summary()["done"], setting.summary()["unfinished"]) == (1, 1)
    assert signal.getsignal(signal.SIGTERM) is before


def test_whatever_ends_it_what_has_been_done_is_summed_up(setting: Setting) -> None:
    def stop(error: Exception) -> Callable[[], None]:
        def wrong() -> None:
            raise error

        return wrong

    keys = iter("acegik")
    for error, kind, text in (
        (OutputError("disk full", "h", for_all=True), DlogenError, "disk full; 1 of 2 clouds are done"),
        (NotStarted("no worker", "h"), DlogenError, "no worker; 1 of 2 clouds are done"),
        (UsageError("wrong address", "h"), UsageError, "^wrong address [(]h[)]$"),
        (BrokenPipeError("gone"), BrokenPipeError, "gone"),
        (ZeroDivisionError("bug"), ZeroDivisionError, "bug"),
    ):
        pool = Said(good(key := next(keys)), stop(error))
        done = setting.summary()["done"] if (setting.folder / "summary.json").exists() else 0
        with pytest.raises(kind, match=text) as raised:
            setting.run_batch(pool, key + chr(ord(key) + 1))
        if kind is DlogenError:
            assert raised.value.exit_code == 1
        assert pool.closed
        assert setting.summary()["done"] == done + 1


def test_nothing_to_do(setting: Setting, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    cloud = tmp_path / "a.ply"
    cloud.write_bytes(b"")
    for again in range(2):
        store = Store(setting.folder)
        batch = Batch([Item(str(cloud), "a")], setting.folder, setting.plan, store)
        with pytest.raises(DlogenError, match="1 of 1 cloud failed"):
            run_batch(batch, Said(*([] if again else [bad("a")])), Console())
        store.close()
    said = capsys.readouterr().err
    assert "0 of 1 cloud is done already, 1 failed before: --retry does them again" in said
    assert "1 cloud, nothing to do: 0 done, 1 failed" in said
