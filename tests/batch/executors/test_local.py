"""Worker processes that die, hang, do not start, or are not needed any more."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dlogen.batch.executors import worker as module
from dlogen.batch.executors.local import LocalPool
from dlogen.batch.executors.worker import NotStarted
from dlogen.batch.job import Outcome, Plan, Task
from dlogen.io.atomic import temporary_prefix

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class Then:
    """What a worker that is sent it does as soon as it has it, before it can answer."""

    def __init__(self, code: str) -> None:
        self.code = code

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, (self.code,)


def die() -> Then:
    return Then("import os; os.kill(os.getpid(), 9)")


def once(flag: Path, code: str) -> Then:
    """Not the second time."""
    return Then(f"import os\ntry: os.mkdir({str(flag)!r})\nexcept FileExistsError: pass\nelse: {code}")


def task(cloud: Path, key: str, extra: Then | None = None) -> Task:
    # What `exec` returns arrives: None, as in tasks without a configuration.
    return Task(str(cloud), key, config=extra)  # type: ignore[arg-type]


def collect(pool: LocalPool, *tasks: Task) -> dict[str, Outcome]:
    outcomes = list(pool.run(iter(tasks)))
    assert sorted(outcome.key for outcome in outcomes) == sorted(task.key for task in tasks)
    return {outcome.key: outcome for outcome in outcomes}


def children() -> set[int]:
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == os.getpid() and fields[0] != "Z":
                found.add(int(entry.name))
    return found


@pytest.fixture(autouse=True)
def no_process_remains() -> Iterator[None]:
    if not sys.platform.startswith("linux"):
        yield
        return
    before = children()
    yield
    assert children() <= before


def test_a_cloud_whose_worker_is_killed_is_tried_again_and_others_are_not_touched(
    clouds: tuple[Path, ...], plan: Plan, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    leave = f"open({str(folder)!r} + '/{temporary_prefix()}%d-x.json' % os.getpid(), 'w')"
    kill = "os.kill(os.getpid(), 9)"
    outcomes = collect(
        LocalPool(plan, 2),
        task(clouds[0], "a"),
        task(clouds[1], "once", once(tmp_path / "flag", f"{leave}; {kill}")),
        task(clouds[2], "always", die()),
        task(clouds[3], "exit", Then("import os; os._exit(3)")),
        *(task(clouds[i % 4], f"z{i}") for i in range(5)),
    )
    failed = {key: outcome.failure for key, outcome in outcomes.items() if outcome.failure is not None}
    assert set(failed) == {"always", "exit"}
    assert {failure.code for failure in failed.values()} == {"worker-died"}
    assert "signal 9, SIGKILL" in failed["always"].message
    assert "exit code 3" in failed["exit"].message
    assert all(failure.hint for failure in failed.values())
    # The half-written file of the one that died is gone.
    assert names(folder) == sorted(
        f"{key}{ending}" for key in outcomes.keys() - failed.keys() for ending in (".json", ".report.json")
    )


def test_a_cloud_that_takes_too_long_is_given_up_and_not_tried_again(
    clouds: tuple[Path, ...], plan: Plan, tmp_path: Path
) -> None:
    # The second time it would not hang.
    hang = once(tmp_path / "flag", "import time; time.sleep(1e6)")
    outcomes = collect(
        LocalPool(plan, 1, timeout=3.0), task(clouds[0], "a"), task(clouds[1], "hangs", hang), task(clouds[2], "z")
    )
    assert [outcomes[key].failure for key in ("a", "z")] == [None, None]
    failure = outcomes["hangs"].failure
    assert failure is not None
    assert failure.code == "timeout"
    assert "3 s" in failure.message


def test_one_process_does_many_clouds_one_after_another(clouds: tuple[Path, ...], plan: Plan, tmp_path: Path) -> None:
    log = tmp_path / "pids"
    note = Then(f"import os; print(os.getpid(), file=open({str(log)!r}, 'a'))")
    collect(LocalPool(plan, 1), *(task(clouds[0], f"c{i}", note) for i in range(4)))
    assert len(log.read_text().split()) == 4
    assert len(set(log.read_text().split())) == 1


def test_tasks_are_taken_as_they_are_needed(clouds: tuple[Path, ...], plan: Plan) -> None:
    taken = 0

    def tasks() -> Iterator[Task]:
        nonlocal taken
        for i in range(8):
            taken += 1
            yield task(clouds[0], f"c{i}")

    for ended, _ in enumerate(LocalPool(plan, 2).run(tasks())):
        # Two at work, one that waits, and the ones that have ended.
        assert taken <= ended + 1 + 3
    assert taken == 8


def test_no_task_needs_no_process(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_start", lambda log: pytest.fail("started a process"))
    assert list(LocalPool(plan, 2).run(iter(()))) == []


def test_closing_ends_what_is_under_way(clouds: tuple[Path, ...], plan: Plan) -> None:
    hang = Then("import time; time.sleep(1e6)")
    outcomes = LocalPool(plan, 2).run(iter([task(clouds[0], "a"), *(task(clouds[1], f"h{i}", hang) for i in range(5))]))
    assert next(outcomes).key == "a"
    outcomes.close()  # no process remains: the fixture looks


def test_processes_that_do_not_start_say_why(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", ["/nowhere"])
    with pytest.raises(NotStarted, match="No module named") as raised:
        collect(LocalPool(plan, 2), task(clouds[0], "a"), task(clouds[0], "b"))
    assert raised.value.hint


def test_no_room_for_all_processes_is_room_for_fewer(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = module._start
    room = threading.Semaphore(1)

    def room_for_one(log: object) -> object:
        if not room.acquire(blocking=False):
            raise BlockingIOError(11, "Resource temporarily unavailable")
        return start(log)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "_start", room_for_one)
    outcomes = collect(LocalPool(plan, 3), *(task(clouds[i % 4], f"c{i}") for i in range(6)))
    assert all(outcome.failure is None for outcome in outcomes.values())


def test_no_room_for_any_process(clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(log: object) -> object:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(module, "_start", full)
    with pytest.raises(NotStarted, match="Resource temporarily unavailable"):
        collect(LocalPool(plan, 3), *(task(clouds[i % 4], f"c{i}") for i in range(6)))


def test_a_process_that_is_killed_while_it_starts_is_started_again(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = module._start
    count = 0

    def killed(log: object) -> object:
        nonlocal count
        process = start(log)  # type: ignore[arg-type]
        count += 1
        if count == 1:
            process.kill()
        return process

    monkeypatch.setattr(module, "_start", killed)
    assert collect(LocalPool(plan, 1), task(clouds[0], "a"))["a"].failure is None
    assert count == 2


def test_without_room_for_a_log_workers_start_all_the_same(
    clouds: tuple[Path, ...], plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr("tempfile.TemporaryFile", full)
    assert collect(LocalPool(plan, 1), task(clouds[0], "a"))["a"].failure is None


@linux
def test_modules_of_the_current_folder_are_not_taken_for_others(
    clouds: tuple[Path, ...], plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("numpy.py", "pickle.py", "dlogen.py", "queue.py"):
        (tmp_path / name).write_text("raise SystemExit('the wrong one')\n")
    monkeypatch.chdir(tmp_path)
    assert collect(LocalPool(plan, 1), task(clouds[0], "a"))["a"].failure is None


@linux
def test_memory_is_limited_for_each_cloud_and_its_process_goes_on(
    clouds: tuple[Path, ...], plan: Plan, tmp_path: Path
) -> None:
    big = tmp_path / "big.ply"
    header = b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000\n"
    header += b"".join(b"property double %c\n" % axis for axis in b"xyz") + b"end_header\n"
    with big.open("wb") as stream:
        stream.write(header)
        stream.truncate(len(header) + 48_000_000)
    log = tmp_path / "pids"
    note = Then(f"import os; print(os.getpid(), file=open({str(log)!r}, 'a'))")
    outcomes = collect(
        # Less than the buffer that OpenBLAS takes when it is first used: without room for that it tries for ever.
        LocalPool(replace(plan, overrides=("profile=refined",)), 1, memory=30 << 20),
        *(task(clouds[0], "a", note), task(big, "big", note), task(clouds[1], "z", note)),
    )
    assert outcomes["a"].failure is None
    assert outcomes["z"].failure is None
    failure = outcomes["big"].failure
    assert failure is not None
    assert failure.code == "memory"
    assert len(set(log.read_text().split())) == 1


@linux
def test_workers_end_when_their_parent_is_killed(clouds: tuple[Path, ...], tmp_path: Path) -> None:
    import subprocess

    log = tmp_path / "pid"
    code = (
        "import sys; from dlogen.batch.executors.local import *; from dlogen.batch.job import *\n"
        f"note = \"import os; print(os.getpid(), file=open({str(log)!r}, 'w'))\"\n"
        "class Note:\n    def __reduce__(self): return exec, (note,)\n"
        f"tasks = (Task({str(clouds[0])!r}, str(i), config=Note()) for i in range(10 ** 9))\n"
        f"for _ in LocalPool(Plan({str(tmp_path / 'out')!r}), 1).run(tasks): pass\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 60
    while not (log.exists() and log.read_text().strip()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    parent.kill()
    parent.wait()
    worker = Path(f"/proc/{log.read_text().strip()}")
    while worker.exists() and worker.joinpath("stat").read_text().rpartition(")")[2].split()[0] != "Z":
        assert time.monotonic() < deadline
        time.sleep(0.01)
