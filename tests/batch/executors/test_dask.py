"""A real Dask scheduler and real workers on loopback; what they make has to be what this machine makes alone."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed")
if sys.platform == "win32":
    pytest.skip("signals", allow_module_level=True)

from dlogen.batch.executors import dask as cluster
from dlogen.batch.executors import dask_worker
from dlogen.batch.executors.dask import BATCH_CLOUDS, DaskPool, prepare_dask, scheduler_of
from dlogen.batch.executors.dask_worker import Reply
from dlogen.batch.job import Outcome, Plan, Task, run_job
from dlogen.errors import DlogenError
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud

# Generous: the machine may be busy.
DEADLINE = 90.0

#: Python imports this when it starts: clouds with some names do things in the worker processes.
HOOK = """
import sys
if "dlogen.batch.executors.worker" in " ".join(sys.orig_argv):
    import os, signal, time
    import dlogen.io.cloud_files
    real = dlogen.io.cloud_files.read_cloud

    def read_cloud(path, **options):
        if "kills-its-process" in str(path):
            os.kill(os.getpid(), signal.SIGKILL)
        if "kills-its-dask-worker" in str(path):
            os.kill(os.getppid(), signal.SIGKILL)
        if "gate" in str(path):
            gate = os.environ["DLOGEN_TEST_GATE"]
            open(os.path.join(gate, f"{os.getppid()}-{os.getpid()}"), "w").close()
            while not os.path.exists(os.path.join(gate, "open")):
                time.sleep(0.02)
        return real(path, **options)

    dlogen.io.cloud_files.read_cloud = read_cloud
"""


class Site:
    """A folder where a user works, and the processes that were started from there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.gate = folder, folder / "gate"
        self.gate.mkdir(parents=True)
        (folder / "hook").mkdir()
        (folder / "hook" / "sitecustomize.py").write_text(HOOK)
        self.processes: list[subprocess.Popen[str]] = []
        self.environment = os.environ | {
            "PYTHONPATH": str(folder / "hook"),
            "DLOGEN_TEST_GATE": str(self.gate),
            "DASK_TEMPORARY_DIRECTORY": str(folder / "dask"),
            "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "60s",
        }

    def start(self, *call: str, cwd: str = ".", **environment: str) -> subprocess.Popen[str]:
        """A Python module as a process in a session of its own."""
        folder = self.folder / cwd
        folder.mkdir(exist_ok=True)
        process = subprocess.Popen(
            [sys.executable, "-m", *call],
            cwd=folder,
            env=self.environment | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE if call[0] == "dlogen" else (folder / f"{len(self.processes)}.log").open("w"),
            text=True,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def scheduler(self, name: str, **environment: str) -> tuple[str, subprocess.Popen[str]]:
        """Its address, when it is there."""
        file = self.folder / f"{name}.json"
        options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        process = self.start("dask", "scheduler", *options, **environment)
        return scheduler_of(
            str(wait_for(lambda: file if file.exists() and file.read_text().endswith("}") else None))
        ), process

    def worker(self, address: str, **environment: str) -> subprocess.Popen[str]:
        """One with a nanny and one thread, that has another working directory than the user."""
        options = ("--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
        return self.start("dask", "worker", address, *options, cwd="elsewhere", **environment)

    def batch(self, *arguments: str) -> subprocess.Popen[str]:
        """`dlogen batch` on the clouds."""
        return self.start("dlogen", "batch", "clouds", *arguments)

    def at_gate(self) -> list[tuple[int, int]]:
        """Numbers of the processes that came to the gate: parent, own."""
        return [(int(a), int(b)) for a, _, b in (p.name.partition("-") for p in self.gate.glob("*-*"))]

    def close(self) -> None:
        """End all, with their children."""
        for process in self.processes:
            end(process)


def end(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for(condition: Callable[[], Any]) -> Any:
    """Its value, as soon as it is true."""
    limit = time.monotonic() + DEADLINE
    while not (value := condition()):
        assert time.monotonic() < limit, "waited too long"
        time.sleep(0.02)
    return value


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and messages."""
    _, messages = process.communicate(timeout=DEADLINE)
    return process.returncode, messages


def alive(number: int) -> bool:
    try:
        state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the records."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith((".dlogen", "dlogen.")))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def make_clouds(folder: Path, count: int, points: int = 200) -> None:
    """Small ones in two folders, with names as people give them."""
    for index in range(count):
        cloud = sample_tube(random_centre_line(index % 7, clearance=0.08), 0.015, points, index)
        path = folder / ("left", "right side")[index % 2] / f"Schlauch № {index:02d}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_cloud(path, cloud.points)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.close()


def test_equals_the_local_run_though_a_dask_worker_is_killed(site: Site) -> None:
    make_clouds(site.folder / "clouds", 28)
    clouds = site.folder / "clouds"
    one = (clouds / "left" / "Schlauch № 00.ply").read_bytes()
    (clouds / "left" / "gate.ply").write_bytes(one)
    (clouds / "left" / "kills-its-process.ply").write_bytes(one)
    (clouds / "left" / "not a cloud.ply").write_text("not a cloud")
    (clouds / "left" / "Schlauch № 02.yaml").write_text("e_max: 0.003\n")
    (clouds / "left" / "Schlauch № 04.yaml").write_text("e_max: wrong\n")
    (clouds / "right side" / "cut off.ply").write_bytes(one[:-7])
    (clouds / "right side" / "gone.ply").symlink_to("nowhere")
    address, _ = site.scheduler("scheduler")
    for _ in range(2):
        site.worker(address)

    batch = site.batch("-o", "shared", "--scheduler", address)
    first = wait_for(site.at_gate)[0]
    os.kill(first[0], signal.SIGKILL)
    # Another Dask worker does what it was at.
    wait_for(lambda: len({parent for parent, _ in site.at_gate()}) == 2)
    (site.gate / "open").touch()
    code, messages = ended(batch)
    assert code == 1
    assert "5 of 33 clouds failed" in messages
    assert "distributed" not in messages

    shipped = site.batch("-o", "shipped", "--scheduler-file", "scheduler.json", "--ship")
    code, messages = ended(shipped)
    assert code == 1, messages
    local = site.batch("-o", "local", "--jobs", "2")
    assert ended(local)[0] == 1
    expected = contents(site.folder / "local")
    assert len(expected) == 3 * 28 + 2
    assert contents(site.folder / "shared") == expected
    assert contents(site.folder / "shipped") == expected
    causes = json.loads(expected["summary.json"])["failures"]
    assert sorted(cause["code"] for cause in causes for _ in range(cause["count"])) == [
        *("config", "input", "input", "input", "worker-died")
    ]

    # Again: only the one that may have been the machine's fault.
    times = {path: path.stat().st_mtime_ns for path in (site.folder / "shared").rglob("*.urdf")}
    code, messages = ended(site.batch("-o", "shared", "--scheduler", address))
    assert "28 of 33 clouds are done already" in messages
    assert contents(site.folder / "shared") == expected
    assert {path: path.stat().st_mtime_ns for path in times} == times


def test_interrupted_killed_and_without_its_scheduler(site: Site) -> None:
    make_clouds(site.folder / "clouds", 6)
    (site.folder / "clouds" / "left" / "Schlauch № 00.ply").rename(site.folder / "clouds" / "left" / "gate.ply")
    address, scheduler = site.scheduler("scheduler")

    batch = site.batch("-o", "out", "--scheduler", address)
    assert batch.stderr is not None
    assert f"no Dask worker is connected to {address}" in batch.stderr.readline()
    site.worker(address)
    [(_, number)] = wait_for(site.at_gate)
    batch.send_signal(signal.SIGINT)
    code, messages = ended(batch)
    assert code == 130
    assert "run the same command again" in messages
    # What is under way is not written any more, perhaps over the results of the next run.
    wait_for(lambda: not alive(number))

    again = site.batch("-o", "out", "--scheduler", address)
    _, number = wait_for(lambda: [pair for pair in site.at_gate() if pair[1] != number])[0]
    again.kill()
    again.wait()
    wait_for(lambda: not alive(number))

    known = set(site.at_gate())
    third = site.batch("-o", "out", "--scheduler", address)
    wait_for(lambda: set(site.at_gate()) - known)
    end(scheduler)
    code, messages = ended(third)
    assert code == 1
    assert f"lost the Dask scheduler at {address}" in messages
    assert messages.count("\n") < 5

    (site.gate / "open").touch()
    code, messages = ended(site.batch("-o", "out", "--jobs", "1"))
    assert code == 0, messages
    assert ended(site.batch("-o", "local", "--jobs", "1"))[0] == 0
    assert contents(site.folder / "out") == contents(site.folder / "local")


def test_a_cloud_that_kills_dask_workers(site: Site) -> None:
    make_clouds(site.folder / "clouds", 6)
    (site.folder / "clouds" / "left" / "Schlauch № 00.ply").rename(
        site.folder / "clouds" / "left" / "kills-its-dask-worker.ply"
    )
    address, _ = site.scheduler("scheduler", DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
    site.worker(address)
    code, messages = ended(site.batch("-o", "out", "--scheduler", address))
    assert code == 1
    assert "1 of 6 clouds failed" in messages
    assert "kills-its-dask-worker.ply" in messages
    assert "[worker-died]" in messages
    assert len(list((site.folder / "out").rglob("*.urdf"))) == 5


@pytest.fixture(scope="module")
def inner() -> Iterator[str]:
    """A cluster in this process: its address."""
    from distributed import LocalCluster

    prepare_dask(verbose=False)
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, protocol="tcp://", dashboard_address=None
    ) as inner:
        yield inner.scheduler_address


def test_other_version(inner: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Other(dask_worker.Call):
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
            return dask_worker.serve, ("0.0.1", b"of another version")

    monkeypatch.setattr(cluster, "Call", Other)
    with pytest.raises(DlogenError, match=r"has dlogen .*, and this is 0\.0\.1") as caught:
        run_all(DaskPool(Plan(str(tmp_path)), inner, 1), [Task("x.ply", "x")])
    assert "pip install dlogen==0.0.1" in (caught.value.hint or "")


def test_workers_without_dlogen(inner: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Missing(dask_worker.Call):
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
            return importlib.import_module, ("dlogen.that_is_not_installed",)

    monkeypatch.setattr(cluster, "Call", Missing)
    with pytest.raises(DlogenError, match="does not have dlogen: No module named"):
        run_all(DaskPool(Plan(str(tmp_path)), inner, 1), [Task("x.ply", "x")])


def test_folders_that_workers_do_not_see(inner: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DlogenError, match="does not see the folder") as caught:
        run_all(DaskPool(Plan(str(tmp_path)), inner, 1), [Task("x.ply", "x")])
    assert "--ship" in (caught.value.hint or "")

    (tmp_path / "dlogen.sqlite").touch()
    (tmp_path / "x.ply").touch()

    class Blind(dask_worker.Call):
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
            return Reply, ("tcp://there", (Outcome("x"),), 0.0, ("x",))

    monkeypatch.setattr(cluster, "Call", Blind)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DlogenError, match=r"tcp://there does not see .*/x.ply"):
        run_all(DaskPool(Plan(str(tmp_path)), inner, 1), [Task("x.ply", "x")])


def test_limits_hold(inner: str, tmp_path: Path) -> None:
    make_clouds(tmp_path, 1, points=3000)
    [path] = tmp_path.rglob("*.ply")
    task = Task(str(path), "x", content=path.read_bytes())
    [slow] = run_all(DaskPool(Plan(None), inner, 1, timeout=0.01), [task])
    assert slow.failure is not None
    assert slow.failure.code == "timeout"
    [good] = run_all(DaskPool(Plan(None), inner, 1), [task])
    assert good.files == run_job(Plan(None), task).files


def test_the_scheduler_forgets_what_is_done(inner: str) -> None:
    from distributed import Client

    tasks = [Task(f"nowhere/{index}", str(index), content=b"") for index in range(300)]
    outcomes = run_all(DaskPool(Plan(None), inner, len(tasks)), tasks)
    assert sorted(int(outcome.key) for outcome in outcomes) == list(range(300))
    with Client(inner, set_as_default=False) as client:
        wait_for(lambda: not client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)))


def test_clusters_that_adapt() -> None:
    """They have no worker before they have work."""
    from distributed import LocalCluster

    prepare_dask(verbose=False)
    options = {"processes": False, "threads_per_worker": 1, "protocol": "tcp://", "dashboard_address": None}
    with LocalCluster(n_workers=0, **options) as adaptive:
        adaptive.adapt(minimum=0, maximum=2, interval="100ms")
        tasks = [Task(f"nowhere/{index}", str(index), content=b"") for index in range(10)]
        assert len(run_all(DaskPool(Plan(None), adaptive.scheduler_address, len(tasks)), tasks)) == 10


def test_abandoned(inner: str) -> None:
    taken: list[int] = []

    def tasks() -> Iterator[Task]:
        for index in range(100_000):
            taken.append(index)
            yield Task(f"nowhere/{index}", str(index), content=b"")

    with contextlib.closing(DaskPool(Plan(None), inner, 100_000).run(tasks())) as outcomes:
        next(outcomes)
    # Tasks are taken as they are needed.
    assert len(taken) < 10 * BATCH_CLOUDS


def run_all(pool: DaskPool, tasks: list[Task]) -> list[Outcome]:
    with contextlib.closing(pool.run(iter(tasks))) as outcomes:
        return list(outcomes)
