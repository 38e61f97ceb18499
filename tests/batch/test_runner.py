"""What a batch does again, what it keeps, and what it never touches. The clouds are worked on in this process."""

from __future__ import annotations

import os
import shutil
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dlogen.batch.discover import find_items
from dlogen.batch.item import Item
from dlogen.batch.job import Failure, Outcome, Plan, Task, run_job
from dlogen.batch.paths import as_unicode
from dlogen.batch.runner import Batch, BatchOptions
from dlogen.batch.store import Row, Store
from dlogen.config.reader import load_config
from dlogen.errors import OutputError
from dlogen.io.atomic import temporary_prefix
from dlogen.io.outputs import Outputs


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class Here:
    """A pool that works in this process.

    Args:
        plan: as of pools.
        failures: of clouds, by key.
    """

    def __init__(self, plan: Plan, failures: dict[str, Failure] | None = None) -> None:
        self.plan, self.failures = plan, failures or {}

    def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
        for task in tasks:
            failure = self.failures.get(task.key)
            yield run_job(self.plan, task) if failure is None else Outcome(task.key, failure)


@pytest.fixture
def folder(clouds: tuple[Path, ...], tmp_path: Path) -> Path:
    """Clouds a, b, c."""
    (tmp_path / "in").mkdir()
    for name, cloud in zip("abc", clouds, strict=False):
        shutil.copy(cloud, tmp_path / "in" / f"{name}.ply")
    return tmp_path / "in"


def run(
    folder: Path, plan: Plan, failures: dict[str, Failure] | None = None, *, items: list[Item] | None = None, **how: Any
) -> dict[str, Row]:
    """The records of what was done now, by key."""
    assert plan.folder is not None
    out = Path(plan.folder)
    store = Store(out)
    try:
        found = find_items([str(folder)], out=out) if items is None else items
        sent = replace(plan, folder=None) if how.get("ship") else plan
        batch = Batch(found, out, sent, store, BatchOptions(**how))
        rows = {row.key: row for row in batch.run(Here(sent, failures))}
        assert len(rows) == len(batch.todo)
        assert {row.key for row in batch.kept} | rows.keys() == {as_unicode(item.key) for item in found}
        # What is on record is what was said.
        on_record = {row.key: row.to_dict() for row in store.rows()}
        assert all(row.to_dict() == on_record[key] for key, row in rows.items())
        return rows
    finally:
        store.close()


def status(rows: dict[str, Row]) -> dict[str, str]:
    return {key: row.code or row.status for key, row in rows.items()}


def outputs(plan: Plan) -> list[str]:
    assert plan.folder is not None
    return sorted(
        name
        for name in names(Path(plan.folder))
        if not name.startswith((".dlogen.lock", "dlogen.sqlite")) and not name.startswith("summary.")
    )


def test_nothing_is_done_twice(folder: Path, plan: Plan) -> None:
    assert status(run(folder, plan)) == dict.fromkeys("abc", "done")
    assert outputs(plan) == [f"{key}{ending}" for key in "abc" for ending in (".json", ".report.json")]
    assert run(folder, plan) == {}
    assert status(run(folder, plan, force=True)) == dict.fromkeys("abc", "done")


def test_what_has_changed_is_done_again(folder: Path, plan: Plan, clouds: tuple[Path, ...]) -> None:
    run(folder, plan)
    # Other content of the same size, and an older time.
    assert clouds[3].stat().st_size == (folder / "a.ply").stat().st_size
    shutil.copy(clouds[3], folder / "a.ply")
    os.utime(folder / "a.ply", (1, 1))
    assert set(run(folder, plan)) == {"a"}
    # Touched only, the clock was wrong.
    os.utime(folder / "a.ply", (9e9, 9e9))
    assert run(folder, plan) == {}
    assert run(folder, plan) == {}
    # A new one, one less, one whose results were lost.
    shutil.copy(clouds[3], folder / "d.ply")
    (folder / "c.ply").unlink()
    assert plan.folder is not None
    Path(plan.folder, "b.report.json").unlink()
    assert set(run(folder, plan)) == {"b", "d"}
    # Settings of its own come, change and go.
    (folder / "b.yaml").write_text("e_max: 0.004\n")
    rows = run(folder, plan)
    assert set(rows) == {"b"}
    assert rows["b"].metrics["e_max"] == 0.004
    assert run(folder, plan) == {}
    (folder / "b.yaml").write_text("e_max: 0.005\n")
    assert set(run(folder, plan)) == {"b"}
    (folder / "b.yaml").unlink()
    assert set(run(folder, plan)) == {"b"}
    # Settings of all, and formats.
    everything = {"a", "b", "d"}
    assert set(run(folder, replace(plan, overrides=("e_max=0.004",)))) == everything
    assert set(run(folder, replace(plan, config=load_config(None, ["profile=paper"])))) == everything
    assert set(run(folder, replace(plan, outputs=Outputs(("json", "urdf"))))) == everything


def test_failures_come_again_when_asked_for_or_when_the_machine_is_to_blame(folder: Path, plan: Plan) -> None:
    failures = {"a": Failure("fit", "e"), "b": Failure("timeout", "e"), "c": Failure("worker-died", "e")}
    assert status(run(folder, plan, failures)) == {"a": "fit", "b": "timeout", "c": "worker-died"}
    failures = {"b": Failure("memory", "e"), "c": Failure("output", "e")}
    assert status(run(folder, plan, failures)) == {"b": "memory", "c": "output"}
    assert status(run(folder, plan)) == {"b": "done", "c": "done"}
    assert run(folder, plan) == {}
    assert status(run(folder, plan, retry=True)) == {"a": "done"}


def test_a_failure_is_forgotten_when_its_cause_changes(folder: Path, plan: Plan) -> None:
    good = (folder / "a.ply").read_bytes()
    (folder / "a.ply").write_bytes(b"")
    (folder / "b.yaml").write_text("e_maxx: 1\n")
    (folder / "c.ply").unlink()
    (folder / "c.ply").symlink_to(folder / "d.ply.there")
    rows = run(folder, plan)
    assert status(rows) == {"a": "input", "b": "config", "c": "input"}
    assert all(row.error and row.hint for row in rows.values())
    assert run(folder, plan) == {}
    (folder / "a.ply").write_bytes(good)
    (folder / "b.yaml").write_text("e_max: 0.004\n")
    (folder / "d.ply.there").write_bytes(good)
    assert status(run(folder, plan)) == dict.fromkeys("abc", "done")


def test_a_cloud_that_fails_now_has_no_model_any_more(folder: Path, plan: Plan) -> None:
    both = replace(plan, outputs=Outputs(("json", "urdf")))
    run(folder, both)
    (folder / "a.ply").write_bytes(b"")
    # In fewer formats than before.
    assert status(run(folder, plan)) == {"a": "input", "b": "done", "c": "done"}
    assert not [name for name in outputs(plan) if name.startswith("a.")]
    assert {"b.json", "b.urdf", "b.report.json"} <= set(outputs(plan))


def test_what_other_settings_have_made_does_not_stay_beside_the_results(folder: Path, plan: Plan) -> None:
    both = replace(plan, outputs=Outputs(("json", "urdf"), plot=True))
    run(folder, both)
    # Fewer formats of the same are added to what is there.
    run(folder, plan)
    run(folder, replace(plan, outputs=Outputs(("csv",))))
    everything = {"a.json", "a.urdf", "a.png", "a.skeleton.csv", "a.report.json"}
    assert {name for name in outputs(plan) if name.startswith("a.")} == everything
    # Formats of another cloud, or other settings, are not.
    (folder / "a.ply").write_bytes((folder / "a.ply").read_bytes() + b"x")
    assert set(run(folder, plan)) == {"a", "b", "c"}
    assert {name for name in outputs(plan) if name[0] == "a"} == {"a.json", "a.report.json"}
    assert {name for name in outputs(plan) if name[0] == "b"} == {name.replace("a", "b", 1) for name in everything}
    run(folder, replace(plan, overrides=("e_max=0.004",)))
    assert {name for name in outputs(plan) if name[0] == "b"} == {"b.json", "b.report.json"}
    assert run(folder, replace(plan, overrides=("e_max=0.004",))) == {}


def test_files_that_no_batch_made_are_left_alone(folder: Path, plan: Plan) -> None:
    assert plan.folder is not None
    out = Path(plan.folder)
    out.mkdir()
    (out / "a.json").write_text("mine")
    for again in range(2):
        rows = run(folder, plan)
        # A refused one does not become ours by being on record.
        assert status(rows) == {"a": "output", **({} if again else {"b": "done", "c": "done"})}
        assert "a.json" in str(rows["a"].error)
        assert "--force" in str(rows["a"].hint)
        assert (out / "a.json").read_text() == "mine"
    assert "a.report.json" not in outputs(plan)
    # A format that is new here.
    (out / "b.urdf").write_text("mine")
    both = replace(plan, outputs=Outputs(("json", "urdf")))
    assert status(run(folder, both)) == {"a": "output", "b": "output", "c": "done"}
    assert (out / "b.urdf").read_text() == "mine"
    # With what is there of ours, it is as before.
    assert status(run(folder, plan)) == {"a": "output", "b": "done", "c": "done"}
    # Where a cloud fails, what was there stays even with --force.
    failed = {"a": Failure("fit", "e")}
    assert status(run(folder, both, failed, force=True)) == {"a": "fit", "b": "done", "c": "done"}
    assert (out / "a.json").read_text() == "mine"
    assert (out / "b.urdf").read_text() != "mine"
    assert status(run(folder, both, retry=True, force=True)) == dict.fromkeys("abc", "done")
    assert (out / "a.json").read_text() != "mine"
    assert run(folder, both) == {}


def test_a_file_that_came_after_a_failure_is_not_ours(folder: Path, plan: Plan) -> None:
    run(folder, plan, {"a": Failure("timeout", "e")})
    assert plan.folder is not None
    Path(plan.folder, "a.json").write_text("mine")
    assert status(run(folder, plan)) == {"a": "output"}
    assert Path(plan.folder, "a.json").read_text() == "mine"


class Killed(Exception):
    pass


def test_after_a_kill_what_was_under_way_is_done_again_and_tidied_up(folder: Path, plan: Plan) -> None:
    assert plan.folder is not None
    out = Path(plan.folder)
    odd = os.fsdecode(b"od\xffd")
    (folder / odd).mkdir()
    shutil.copy(folder / "a.ply", folder / odd / "a.ply")
    items = find_items([str(folder)], out=out)

    class Dies(Here):
        def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
            for task in tasks:
                place = out / Path(task.key).parent
                place.mkdir(exist_ok=True)
                (place / f"{temporary_prefix(5)}x.json").write_text("half")
                # One of two files.
                (out / f"{task.key}.json").write_text("done")
                if task.key == "b":
                    continue
                if task.key != "a":
                    raise Killed
                yield run_job(self.plan, task)

    store = Store(out)
    with pytest.raises(Killed):
        list(Batch(items[:2] + items[-1:], out, plan, store).run(Dies(plan)))
    states = {row.key: row.status for row in store.rows()}
    assert states == {"a": "done", "b": "running", as_unicode(f"{odd}/a"): "running"}
    store.close()
    (out / f"{temporary_prefix(5)}summary.csv").write_text("half")
    assert status(run(folder, plan)) == {"b": "done", "c": "done", as_unicode(f"{odd}/a"): "done"}
    assert not list(out.rglob(f"{temporary_prefix()}*"))
    assert names(out / odd) == ["a.json", "a.report.json"]


def test_when_nothing_can_be_written_the_cloud_is_not_to_blame(folder: Path, plan: Plan) -> None:
    full = Failure("output", "no space left", "h", stops_all=True)
    with pytest.raises(OutputError, match="no space left") as raised:
        run(folder, plan, {"b": full})
    assert raised.value.for_all
    assert plan.folder is not None
    store = Store(Path(plan.folder))
    assert {row.key: row.status for row in store.rows()} == {"a": "done", "b": "running"}
    store.close()
    assert status(run(folder, plan)) == {"b": "done", "c": "done"}


def test_bytes_that_travel_give_the_same_files(folder: Path, plan: Plan, tmp_path: Path) -> None:
    run(folder, plan)
    there = replace(plan, folder=str(tmp_path / "there"))
    (folder / "missing.ply").symlink_to("nowhere")
    os.mkfifo(folder / "pipe.ply")
    assert status(run(folder, there, ship=True)) == {
        **dict.fromkeys("abc", "done"),
        "missing": "input",
        "pipe": "input",
    }
    assert plan.folder is not None
    for name in outputs(plan):
        assert (tmp_path / "there" / name).read_bytes() == Path(plan.folder, name).read_bytes()
    (tmp_path / "file").write_text("")
    blocked = replace(plan, folder=str(tmp_path / "blocked"))
    (tmp_path / "blocked" / "a.json").mkdir(parents=True)
    assert status(run(folder, blocked, ship=True, force=True))["a"] == "output"


def test_names_are_on_record_as_unicode() -> None:
    assert as_unicode(os.fsdecode(b"a\xff\xc3\xbc")) == "a\\xffü"
    assert as_unicode("new\nline") == "new\nline"


def test_configurations_that_cannot_be_read_fail_with_their_cloud(folder: Path, plan: Plan, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "odd.yaml").write_bytes(b"e_max: 0.01 # \xff\n")
    configs = [str(tmp_path / name) for name in ("pipe.yaml", "odd.yaml", "missing.yaml")]
    items = [Item(str(folder / f"{key}.ply"), key, config) for key, config in zip("abc", configs, strict=True)]
    assert status(run(folder, plan, items=items)) == dict.fromkeys("abc", "config")
    assert run(folder, plan, items=items) == {}


def test_clouds_that_go_between_listing_and_reading_fail_alone(folder: Path, plan: Plan) -> None:
    assert plan.folder is not None
    items = find_items([str(folder)], out=Path(plan.folder))
    (folder / "a.ply").unlink()
    content = (folder / "b.ply").read_bytes()
    (folder / "b.ply").write_bytes(content[: len(content) // 2])
    rows = run(folder, plan, items=items)
    assert status(rows) == {"a": "input", "b": "input", "c": "done"}
    assert "No such file" in str(rows["a"].error)
