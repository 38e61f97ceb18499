"""`dlogen batch` from the outside, with its processes, signals and files."""

from __future__ import annotations

import contextlib
import csv
import fcntl
import json
import os
import pty
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import termios
import time
import uuid
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")

DLOGEN = [sys.executable, "-m", "dlogen"]
QUICK = ["--profile", "paper", "--set", "mdtw.samples=50"]
#: For what takes a moment on an idle machine.
PATIENCE = 120.0
AXES = "".join(f"property float {axis}\n" for axis in "xyz")


def tube(seed: int) -> np.ndarray:
    return sample_tube(random_centre_line(seed, clearance=0.08), 0.015, 400, seed).points


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the folder `in`: ten clouds in it and below it."""
    top = tmp_path_factory.mktemp("captures")
    for i in range(10):
        path = top / "in" / ("day 2" if i % 2 else "") / f"c{i}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_cloud(path, tube(i))
    return top


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the folder `in`: a cloud that is read for a while, most of it NaN, between small ones."""
    top = tmp_path_factory.mktemp("slow")
    (top / "in").mkdir()
    for i, name in enumerate(("a0", "a1", "z0", "z1")):
        write_cloud(top / "in" / f"{name}.ply", tube(i))
    nothing = 3_000_000
    with (top / "in" / "big.ply").open("w") as stream:
        stream.write(f"ply\nformat ascii 1.0\nelement vertex {nothing + 400}\n{AXES}end_header\n")
        stream.write("nan nan nan\n" * nothing)
        np.savetxt(stream, tube(5))
    return top


@pytest.fixture(scope="module")
def undisturbed(captures: Path) -> dict[str, bytes]:
    """The files of a run of one process."""
    result = run(captures, "in", "-o", "undisturbed", "-j", 1)
    assert result.returncode == 0, result.stderr
    return files(captures / "undisturbed")


class Run:
    """A batch that runs by itself, in a process group of its own.

    All its processes have a mark in their environment, by which they are found whoever their parent is now.
    """

    def __init__(self, folder: Path, *arguments: object, **options: Any) -> None:
        self.mark = f"DLOGEN_TEST={uuid.uuid4()}"
        name, _, value = self.mark.partition("=")
        self.process = subprocess.Popen(
            [*DLOGEN, "batch", *QUICK, *map(str, arguments)],
            cwd=folder,
            env=os.environ | {name: value},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            **options,
        )

    def workers(self) -> set[int]:
        """Numbers of its worker processes."""
        found = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self.process.pid:
                with contextlib.suppress(OSError):
                    # Of a process that has ended it is empty.
                    if self.mark.encode() in (entry / "environ").read_bytes():
                        found.add(int(entry.name))
        return found

    def end(self) -> tuple[str, str]:
        out, err = self.process.communicate(timeout=PATIENCE)
        wait_for(lambda: not self.workers(), "workers are left")
        return out.decode(), err.decode()


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < deadline, what
        time.sleep(0.005)
    return found


@contextlib.contextmanager
def running(folder: Path, *arguments: object, **options: Any) -> Iterator[Run]:
    started = Run(folder, *arguments, **options)
    try:
        yield started
    finally:
        for number in (started.process.pid, *started.workers()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        started.process.communicate()


def run(folder: Path, *arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [*DLOGEN, "batch", *QUICK, *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, capture_output=True, timeout=2 * PATIENCE, encoding="utf-8", errors="replace", **options
    )


def files(folder: Path) -> dict[str, bytes]:
    """All but the records, with what they hold."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(("dlogen.sqlite", ".dlogen.lock"))
    }


def records(folder: Path) -> dict[str, sqlite3.Row]:
    """By key; nothing if there are none yet."""
    if not (folder / "dlogen.sqlite").exists():
        return {}
    with contextlib.closing(sqlite3.connect(folder / "dlogen.sqlite", timeout=60.0)) as database:
        database.row_factory = sqlite3.Row
        try:
            return {row["key"]: row for row in database.execute("SELECT * FROM clouds")}
        except sqlite3.OperationalError:  # not yet
            return {}


def status(folder: Path) -> dict[str, str]:
    return {key: row["code"] or row["status"] for key, row in records(folder).items()}


def summary(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "summary.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


# Good and bad clouds


BAD = {
    "ball": ("fit", "line"),
    "claims": ("input", "claims 1000000000000 points"),
    "cut": ("input", "the header claims 400 points"),
    "empty": ("input", "the file is empty"),
    "gone": ("input", "No such file"),
    "lfs": ("input", "Git LFS pointer"),
    "nan": ("input", "NaN or infinite"),
    "own": ("config", "own.yaml: line 2: unknown key 'e_maxx'"),
    "pipe": ("input", "a pipe or a device, not a file"),
    "pixels": ("fit", "pixel data"),
    "plane": ("fit", "line"),
    "text": ("input", "not a PLY file"),
    "value": ("config", "diameter"),
    **({} if os.geteuid() == 0 else {"unreadable": ("input", "Permission denied")}),
}


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A folder with every kind of bad file in `in`, and how a run over it ended."""
    top = tmp_path_factory.mktemp("bad")
    folder = top / "in"
    folder.mkdir()
    for i in range(3):
        write_cloud(folder / f"good{i}.ply", tube(i))
    good = (folder / "good0.ply").read_bytes()
    random = np.random.default_rng(0)
    directions = random.normal(size=(500, 3))
    write_cloud(folder / "ball.ply", directions / np.linalg.norm(directions, axis=1, keepdims=True))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\n{AXES}end_header\n"
    (folder / "claims.ply").write_bytes(header.encode() + bytes(1200))
    (folder / "cut.ply").write_bytes(good[:-100])
    (folder / "empty.ply").write_bytes(b"")
    (folder / "gone.ply").symlink_to("nowhere.ply")
    (folder / "lfs.ply").write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{'4d7a' * 16}\nsize 12345\n"
    )
    write_cloud(folder / "nan.ply", np.full((50, 3), np.nan))
    shutil.copy(folder / "good1.ply", folder / "own.ply")
    (folder / "own.yaml").write_text("# one of its own\ne_maxx: 0.01\n")
    os.mkfifo(folder / "pipe.ply")
    write_cloud(folder / "pixels.ply", np.c_[random.integers(0, 640, (500, 2)), np.zeros(500)])
    write_cloud(folder / "plane.ply", np.c_[random.uniform(0, 1, (500, 2)), 1e-4 * random.normal(size=500)])
    (folder / "text.ply").write_text("this is a text\n")
    (folder / "folder.ply").mkdir()
    write_cloud(folder / "folder.ply" / "good3.ply", tube(3))
    if os.geteuid() != 0:
        shutil.copy(folder / "good1.ply", folder / "unreadable.ply")
        (folder / "unreadable.ply").chmod(0)
    write_cloud(top / "value.ply", tube(4))
    write_cloud(top / "good4.ply", tube(4))
    (top / "list.csv").write_text("cloud,r,e_max\nvalue.ply,0.5,\ngood4.ply,,0.004\n")
    return top, run(top, "in", "@list.csv", "-o", "out", "-j", 2, "--json", "--profile", "refined")


GOOD = {"good0", "good1", "good2", "folder.ply/good3", "good4"}


def test_bad_clouds_are_recorded_and_good_ones_are_done(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    top, result = bad
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    rows = records(top / "out")
    assert {key: row["code"] for key, row in rows.items() if row["status"] == "failed"} == {
        key: code for key, (code, _) in BAD.items()
    }
    for key, (_, message) in BAD.items():
        assert message in rows[key]["error"]
        assert rows[key]["hint"]
        assert rows[key]["seconds"] is not None
        assert not (top / "out" / f"{key}.json").exists()
    assert {key for key, row in rows.items() if row["status"] == "done"} == GOOD
    for key in GOOD:
        chain = json.loads((top / "out" / f"{key}.json").read_text())
        assert rows[key]["segment_count"] == chain["segment_count"]
        assert rows[key]["sha256"] == chain["provenance"]["sha256"]
    assert rows["good4"]["e_max"] == 0.004


def test_its_summary_has_the_right_numbers(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    top, _ = bad
    totals = summary(top / "out")
    assert (totals["clouds"], totals["done"], totals["failed"]) == (len(GOOD) + len(BAD), len(GOOD), len(BAD))
    assert sum(totals["verdicts"].values()) == len(GOOD)
    assert sum(cause["count"] for cause in totals["failures"]) == len(BAD)
    assert ["in/claims.ply", "in/cut.ply"] in [cause["clouds"] for cause in totals["failures"]]
    rows = {row["key"]: row for row in table(top / "out")}
    assert rows.keys() == GOOD | BAD.keys()
    lengths = [float(rows[key]["length"]) for key in GOOD]
    assert totals["figures"]["length"]["max"] == max(lengths)
    assert totals["figures"]["length"]["min"] == min(lengths)


def test_its_failures_are_told_by_cause(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    _, result = bad
    lines = result.stderr.splitlines()
    assert lines[0].startswith(f"{len(GOOD) + len(BAD)} clouds in ")
    assert f"{len(GOOD)} done" in lines[0]
    assert f"{len(BAD)} failed; out/summary.csv" in lines[0]
    assert lines[1].startswith("warning: 2 x ")
    assert any(line.startswith("hint: did you mean 'e_max'?") for line in lines)
    assert lines[-2:] == [
        f"error: {len(BAD)} of {len(GOOD) + len(BAD)} clouds failed",
        "hint: out/summary.csv names them all",
    ]


def test_its_lines_are_json(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    _, result = bad
    lines = {line["key"]: line for line in map(json.loads, result.stdout.splitlines())}
    assert {key for key, line in lines.items() if line["status"] == "done"} == GOOD
    for key, (code, message) in BAD.items():
        assert lines[key]["code"] == code
        assert message in lines[key]["error"]
        assert lines[key]["hint"]


def test_again_it_has_nothing_to_do(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    top, _ = bad
    before = files(top / "out")
    again = run(top, "in", "@list.csv", "-o", "out", "--json", "--profile", "refined")
    assert again.returncode == 1
    assert f"{len(GOOD)} of {len(GOOD) + len(BAD)} clouds are done already, {len(BAD)} failed before" in again.stderr
    assert "nothing to do" in again.stderr
    assert f"error: {len(BAD)} of " in again.stderr
    assert all(json.loads(line)["kept"] for line in again.stdout.splitlines())
    assert files(top / "out") == before


def test_a_list_that_is_wrong_is_refused_before_the_work(bad: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    top, _ = bad
    (top / "wrong.csv").write_text("cloud,e_max\ngood4.ply,0.004\nvalue.ply,a lot\n")
    result = run(top, "in", "@wrong.csv", "-o", "wrong")
    assert result.returncode == 2
    assert "wrong.csv" in result.stderr
    assert "line 3" in result.stderr
    assert not (top / "wrong").exists()


# The same bytes


def test_the_same_bytes_with_any_number_of_processes(captures: Path, undisturbed: dict[str, bytes]) -> None:
    assert len(undisturbed) == 3 * 10 + 2
    assert "day 2/c1.urdf" in undisturbed
    result = run(captures, "in", "-o", "three", "-j", 3)
    assert result.returncode == 0, result.stderr
    assert files(captures / "three") == undisturbed


def test_the_same_bytes_as_of_fit(captures: Path, undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    command = [*DLOGEN, "fit", "in/day 2/c3.ply", "-o", tmp_path, *QUICK]
    subprocess.run(command, cwd=captures, check=True, capture_output=True)
    for name in ("c3.json", "c3.urdf"):
        assert (tmp_path / name).read_bytes() == undisturbed[f"day 2/{name}"]
    reports = [
        json.loads(text) for text in ((tmp_path / "c3.report.json").read_bytes(), undisturbed["day 2/c3.report.json"])
    ]
    assert reports[0].pop("timings")
    assert reports[0] == reports[1]


def test_folders_in_all_relations_to_one_another(captures: Path, undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    shutil.copytree(captures / "in", tmp_path / "in")
    # Results among the clouds, then below them, then through a link.
    for out in (".", "results/of today", "link"):
        if out == "link":
            (tmp_path / "elsewhere").mkdir()
            (tmp_path / "in" / "link").symlink_to("../elsewhere")
        result = run(tmp_path / "in", ".", "-o", out, "-j", 1)
        assert result.returncode == 0, result.stderr
        # Results of earlier runs are no clouds.
        assert "10 clouds in " in result.stderr
        made = files(tmp_path / "in" / out)
        assert {name: made[name] for name in undisturbed if not name.startswith("summary")} == {
            name: data for name, data in undisturbed.items() if not name.startswith("summary")
        }
    assert "nothing to do" in run(tmp_path / "in", ".", "-o", ".").stderr


def test_strange_surroundings(captures: Path, undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    # Modules in the current folder, no room for temporary files, no locale, few files, and more processes than clouds.
    for name in ("numpy", "pickle", "dlogen", "queue"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong one')\n")
    script = Path(sys.executable).with_name("dlogen")
    if not script.exists():
        pytest.skip("dlogen is not installed")
    environment = os.environ | {"LC_ALL": "C", "TMPDIR": "/nowhere", "PYTHONIOENCODING": "ascii"}
    command = 'set -e; ulimit -n 40; if "$0" batch "$@"; then echo worked; fi; false; echo not here'
    result = subprocess.run(
        ["bash", "-c", command, script, captures / "in", "-o", tmp_path / "out", "-j", "1000", "--json", *QUICK],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        timeout=PATIENCE,
    )
    lines = result.stdout.decode().splitlines()
    assert lines[-1] == "worked", result.stderr
    assert len(lines) == 11
    made = files(tmp_path / "out")
    # Names of clouds are absolute here.
    assert {name: data for name, data in made.items() if not name.startswith("summary")} == {
        name: data for name, data in undisturbed.items() if not name.startswith("summary")
    }


def test_from_a_program_of_ones_own(captures: Path, undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    # No guard against being imported again by the workers.
    code = "import sys; print('once'); from dlogen.cli.main import main; main()"
    result = subprocess.run(
        [sys.executable, "-c", code, "batch", "in", "-o", tmp_path / "out", "-j", "1", *QUICK],
        cwd=captures,
        capture_output=True,
        timeout=PATIENCE,
    )
    assert (result.returncode, result.stdout) == (0, b"once\n")
    assert files(tmp_path / "out") == undisturbed


# Workers that die


def is_reading(number: int, size: int) -> bool:
    """Whether a process has read so many bytes."""
    try:
        return int(Path(f"/proc/{number}/io").read_text().split()[1]) > size
    except OSError:
        return False


def at_the_big_one(started: Run, out: Path, but: set[int]) -> int:
    """Number of the worker that is at the big cloud, other than those."""

    def look() -> int | None:
        if status(out).get("big") != "running":
            assert started.process.poll() is None
            return None
        # Its modules are half of that, the cloud is four times as much.
        return next((number for number in started.workers() - but if is_reading(number, 25_000_000)), None)

    return wait_for(look, "no worker reads the big cloud")  # type: ignore[no-any-return]


@pytest.mark.parametrize("times", [1, 2])
def test_a_worker_that_is_killed_costs_its_cloud_a_second_try(slow: Path, tmp_path: Path, times: int) -> None:
    killed: set[int] = set()
    with running(slow, "in", "-o", tmp_path, "-j", 2, "--format", "json") as started:
        for _ in range(times):
            number = at_the_big_one(started, tmp_path, killed)
            killed.add(number)
            os.kill(number, signal.SIGKILL)
        _, err = started.end()
    others = dict.fromkeys(("a0", "a1", "z0", "z1"), "done")
    assert status(tmp_path) == others | {"big": "done" if times == 1 else "worker-died"}
    assert started.process.returncode == times - 1
    if times == 2:
        assert "signal 9, SIGKILL" in err
        assert "[worker-died]: in/big.ply" in err
        # It may have been the machine: it is tried again without being asked.
        assert run(slow, "in", "-o", tmp_path, "--format", "json").returncode == 0
        assert status(tmp_path) == others | {"big": "done"}
    assert not list(tmp_path.glob(".dlogen-*"))


def test_a_worker_that_hangs_is_ended_in_time(slow: Path, tmp_path: Path) -> None:
    with running(slow, "in", "-o", tmp_path, "-j", 1, "--timeout", 5, "--format", "json") as started:
        # It hangs well: a process that is stopped does nothing.
        number = at_the_big_one(started, tmp_path, set())
        os.kill(number, signal.SIGSTOP)
        _, err = started.end()
    assert started.process.returncode == 1
    assert "took longer than 5 s [timeout]: in/big.ply" in err
    assert status(tmp_path) == dict.fromkeys(("a0", "a1", "z0", "z1"), "done") | {"big": "timeout"}


def test_a_cloud_may_take_so_much_memory(slow: Path, tmp_path: Path) -> None:
    result = run(slow, "in", "-o", tmp_path, "-j", 1, "--memory", "10M", "--format", "json")
    assert result.returncode == 1
    assert "not enough memory for this cloud [memory]: in/big.ply" in result.stderr
    assert status(tmp_path) == dict.fromkeys(("a0", "a1", "z0", "z1"), "done") | {"big": "memory"}


# The parent ends before its time


def check_consistent(out: Path) -> None:
    """No half file under a name of its own, and records that sqlite likes."""
    if not out.exists():
        return
    for path in out.rglob("*"):
        if path.name.startswith("."):
            continue
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".urdf":
            ElementTree.parse(path)
    if (out / "dlogen.sqlite").exists():
        with contextlib.closing(sqlite3.connect(out / "dlogen.sqlite")) as database:
            assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    for key, row in records(out).items():
        if row["status"] == "done":
            assert (out / f"{key}.json").exists()
            assert (out / f"{key}.urdf").exists()
            assert (out / f"{key}.report.json").exists()


def test_killed_at_any_moment_it_goes_on_where_it_was(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "killed"
    moments: list[Callable[[Run], object]] = [
        lambda started: out.exists(),
        lambda started: (out / "dlogen.sqlite").exists(),
        lambda started: started.workers(),
        lambda started: list(out.glob(".dlogen-*")) or "done" in status(out).values(),
        *(lambda started, n=n: list(status(out).values()).count("done") >= n for n in (3, 7)),
    ]
    for moment in moments:
        with running(captures, "in", "-o", "killed", "-j", 2) as started:
            wait_for(lambda: moment(started) or started.process.poll() is not None, "the moment did not come")  # noqa: B023
            started.process.kill()
            started.end()
        check_consistent(out)
    result = run(captures, "in", "-o", "killed", "-j", 2)
    assert result.returncode == 0, result.stderr
    assert files(out) == undisturbed
    assert set(status(out).values()) == {"done"}


def test_signals_end_it_tidily(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "signalled"
    for number, to_all, enough in (
        # Workers that are about to start, and workers at work.
        (signal.SIGINT, True, lambda started: started.workers()),
        (signal.SIGTERM, False, lambda started: started.workers()),
        (signal.SIGINT, True, lambda started: list(status(out).values()).count("done") >= 1),
        (signal.SIGTERM, True, lambda started: list(status(out).values()).count("done") >= 3),
    ):
        with running(captures, "in", "-o", "signalled", "-j", 2) as started:
            wait_for(lambda: enough(started), "the moment did not come")  # noqa: B023
            # As a terminal does it; or a service manager, which does not know who belongs to whom.
            if number == signal.SIGTERM and to_all:
                for worker in started.workers():
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(worker, number)
            (os.killpg if to_all else os.kill)(started.process.pid, number)
            _, err = started.end()
        assert started.process.returncode == 128 + number, err
        assert "Traceback" not in err
        done = list(status(out).values()).count("done")
        assert f"error: interrupted: {done} of 10 clouds are done and recorded" in err
        assert "hint: run the same command again" in err
        assert summary(out)["done"] == done
        assert summary(out)["failed"] == 0
        check_consistent(out)
    result = run(captures, "in", "-o", "signalled", "-j", 2)
    assert result.returncode == 0, result.stderr
    assert f"{done} of 10 clouds are done already" in result.stderr
    assert files(out) == undisturbed


def test_nobody_reads_its_lines_any_more(captures: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with running(captures, "in", "-o", out, "-j", 1, "--json") as started:
        # Before there is anything to read: it finds out when it prints its first line.
        assert started.process.stdout is not None
        started.process.stdout.close()
        assert started.process.stderr is not None
        assert started.process.stderr.read() == b""
        assert started.process.wait(PATIENCE) != 0
        wait_for(lambda: not started.workers(), "workers are left")
    check_consistent(out)
    assert 0 < summary(out)["done"] == list(status(out).values()).count("done") < 10
    assert run(captures, "in", "-o", out).returncode == 0


def test_standard_streams_that_lead_nowhere(captures: Path, tmp_path: Path) -> None:
    def said(streams: str) -> tuple[int, str, dict[str, str]]:
        command = [*DLOGEN, "batch", "in/c0.ply", "in/c2.ply", "-j", "1", "-o", tmp_path / streams, "--json", *QUICK]
        shell = ["bash", "-c", f'"$0" "$@" {streams.replace("_", "/")}', *map(str, command)]
        result = subprocess.run(shell, cwd=captures, capture_output=True, text=True, timeout=PATIENCE)
        return result.returncode, result.stderr, status(tmp_path / streams)

    done = {"in/c0": "done", "in/c2": "done"}
    assert said("<&- >&- 2>&-") == (0, "", done)
    code, err, _ = said(">_dev_full")
    assert code == 1
    assert "error: cannot print: No space left on device; 1 of 2 clouds are done and recorded\nhint: " in err
    assert "Traceback" not in err


def test_a_second_run_on_the_same_folder_says_so(captures: Path, undisturbed: dict[str, bytes]) -> None:
    out = captures / "twice"
    with running(captures, "in", "-o", "twice", "-j", 1) as first:
        wait_for(first.workers, "no worker starts")
        os.kill(first.process.pid, signal.SIGSTOP)
        before = status(out)
        second = run(captures, "in", "-o", "./twice")
        assert second.returncode == 2
        assert "another dlogen process is writing to this folder" in second.stderr
        assert "hint: " in second.stderr
        assert status(out) == before
        os.kill(first.process.pid, signal.SIGCONT)
        first.end()
    assert first.process.returncode == 0
    assert files(out) == undisturbed


# Places that cannot be written


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


@pytest.fixture
def workshop(captures: Path, tmp_path: Path) -> Path:
    """A folder with `in` in it."""
    (tmp_path / "in").symlink_to(captures / "in")
    return tmp_path


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


# Names


NAMES = [
    b"a b",
    b"new\nline",
    b"carriage\rreturn",
    b"escape\x1b[31m",
    "gr\u00fc\u00dfe-\u65e5\u672c".encode(),
    b"-dash",
    b"--json",
    b"not\xffunicode",
    b"dots.in.it",
    b"[x] * ?",
    b"'quotes\" and \\ and ,",
    b"not\xffunicode/below",
    # Room for its longest ending, .report.json, and none.
    b"y" * 243,
    b"x" * 251,
]


def test_names_of_all_kinds(tmp_path: Path) -> None:
    write_cloud(tmp_path / "cloud.ply", tube(0))
    for name in NAMES:
        path = tmp_path / "in" / os.fsdecode(name + b".ply")
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(tmp_path / "cloud.ply", path)
    result = run(tmp_path, "in", "-o", "out", "-j", 1, "--json", "--format", "json")
    assert result.returncode == 1
    assert "File name too long" in result.stderr
    assert "shorter name" in result.stderr
    assert "\x1b" not in result.stderr
    short = {name for name in NAMES if len(name) < 251}
    on_record = {name.decode("utf-8", "backslashreplace") for name in NAMES}
    made = {os.fsencode(path) for path in files(tmp_path / "out")} - {b"summary.csv", b"summary.json"}
    assert made == {name + ending for name in short for ending in (b".json", b".report.json")}
    lines = [json.loads(line) for line in result.stdout.split("\n") if line]
    assert {line["key"] for line in lines} == on_record
    assert [line["key"] for line in lines if line["status"] == "failed"] == ["x" * 251]
    assert {row["key"] for row in table(tmp_path / "out")} == on_record == set(status(tmp_path / "out"))
    again = run(tmp_path, "in", "-o", "out", "--format", "json")
    assert f"{len(short)} of {len(NAMES)} clouds are done already" in again.stderr


def test_names_that_look_like_options(tmp_path: Path) -> None:
    for name in ("-dash.ply", "--json.ply"):
        write_cloud(tmp_path / name, tube(0))
    result = run(tmp_path, "-o", "-out", "--", "-dash.ply", "--json.ply")
    assert result.returncode == 0, result.stderr
    assert {"-dash.json", "--json.json"} <= set(files(tmp_path / "-out"))


# What it says, and how it ends


def test_limits_and_strictness(captures: Path, undisturbed: dict[str, bytes]) -> None:
    rows = table(captures / "undisturbed")
    deviations = sorted(float(row["max_deviation"]) for row in rows)
    limit = (deviations[7] + deviations[8]) / 2
    above = run(
        captures, "in", "-o", "undisturbed", "--fail-above", f"max_deviation={limit}", "--fail-above", "length=9"
    )
    assert above.returncode == 1
    assert "nothing to do" in above.stderr
    assert f"warning: 2 x max_deviation is above {limit:g}: in/" in above.stderr
    assert "length is above" not in above.stderr
    below = run(captures, "in", "-o", "undisturbed", "--fail-above", f"max_deviation={deviations[-1]}")
    assert below.returncode == 0, below.stderr
    strict = run(captures, "in", "-o", "undisturbed", "--strict")
    assert strict.returncode == (0 if all(row["verdict"] == "good" for row in rows) else 1)
    wrong = run(captures, "in", "-o", "undisturbed", "--fail-above", "deviation=1")
    assert wrong.returncode == 2
    assert "hint: " in wrong.stderr
    assert files(captures / "undisturbed") == undisturbed


def test_quiet_and_verbose(captures: Path, tmp_path: Path) -> None:
    quiet = run(captures, "in/c0.ply", "in/c2.ply", "-j", 1, "-o", tmp_path, "-q")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    verbose = run(captures, "in/c0.ply", "in/c2.ply", "-j", 1, "-o", tmp_path, "-v", "--force")
    lines = verbose.stderr.splitlines()
    assert sorted(line.partition(":")[0] for line in lines[:2]) == ["in/c0.ply", "in/c2.ply"]
    assert all("segments, deviation" in line for line in lines[:2])
    assert lines[2].startswith("2 clouds in ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing", "-o", "out"], "there is no missing"),
        (["empty", "-o", "out"], "there is no cloud in empty"),
        (["in", "-o", "out", "--set", "e_maxx=1"], "e_maxx"),
        (["in", "-o", "out", "--format", "urdff"], "urdff"),
        (["in", "-o", "out", "-c", "missing.yaml"], "missing.yaml"),
        (["in", "-o", "out", "--memory", "much"], "much"),
        (["in", "-o", "out", "--jobs", "0"], "0"),
        (["in", "-o", "out", "--timeout", "inf"], "inf"),
        (["in", "-o", "out", "--timeout", "nan"], "nan"),
        (["in"], "-o"),
    ],
)
def test_what_is_wrong_for_all_is_said_before_the_work(workshop: Path, arguments: list[str], said: str) -> None:
    (workshop / "empty").mkdir()
    result = run(workshop, *arguments)
    assert result.returncode == 2
    assert said in result.stderr
    assert "Traceback" not in result.stderr
    assert not (workshop / "out").exists()


def test_files_of_others_are_not_overwritten(captures: Path, tmp_path: Path) -> None:
    (tmp_path / "c0.json").write_text("mine")
    for _ in range(2):
        result = run(captures / "in", "c0.ply", "c2.ply", "-j", 1, "-o", tmp_path)
        assert result.returncode == 1
        assert "output exists" in result.stderr
        assert "--force" in result.stderr
        assert (tmp_path / "c0.json").read_text() == "mine"
        assert not (tmp_path / "c0.urdf").exists()
        assert (tmp_path / "c2.urdf").exists()
    assert run(captures / "in", "c0.ply", "c2.ply", "-j", 1, "-o", tmp_path, "--force").returncode == 0
    assert json.loads((tmp_path / "c0.json").read_text())["schema"] == "dlogen.chain/1"


def on_a_terminal(folder: Path, *arguments: object, stdout: int | None) -> tuple[int, str]:
    """Exit code and what a terminal shows of standard error; of standard output as well if it is None."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    process = subprocess.Popen(
        [*DLOGEN, "batch", *QUICK, *map(str, arguments)],
        cwd=folder,
        stdin=theirs,
        stdout=theirs if stdout is None else stdout,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(theirs)
    shown = b""
    # EIO: nobody has the other side open any more.
    with contextlib.suppress(OSError):
        while part := os.read(ours, 65536):
            shown += part
    os.close(ours)
    return process.wait(PATIENCE), shown.decode()


def test_on_a_terminal(captures: Path, tmp_path: Path) -> None:
    with (tmp_path / "lines").open("wb") as lines:
        code, shown = on_a_terminal(captures, "in", "-o", tmp_path / "a", "-j", 1, "--json", stdout=lines.fileno())
    assert code == 0
    # A bar, and at the end one line in its place.
    assert "10/10" in shown
    assert "/s" in shown
    assert shown.endswith(f"; {tmp_path / 'a' / 'summary.csv'}\r\n")
    assert "\x1b[?25h" in shown
    last = shown.rpartition("\x1b[2K")[2]
    assert last.startswith("10 clouds in ")
    # Data goes where it was sent.
    data = [json.loads(line) for line in (tmp_path / "lines").read_text().splitlines()]
    assert len(data) == 10
    assert '"key"' not in shown
    # Where lines are shown on the same terminal there is no bar between them.
    for flag in ("-v", "--json"):
        code, shown = on_a_terminal(
            captures, "in/c0.ply", "in/c2.ply", "-o", tmp_path / flag, "-j", 1, flag, stdout=None
        )
        assert code == 0
        assert len(shown.splitlines()) == 3
        assert "\x1b" not in shown
