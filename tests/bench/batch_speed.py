"""What a batch costs, as ratios to a plain loop over `dlogen.fit` in the same run.

    python tests/bench/batch_speed.py                      # 1,000 clouds of 5,000 points
    python tests/bench/batch_speed.py --clouds 20000 --points 150 --quick --jobs 1

Prints: clouds a second of the loop, of one job and of two; what the batch adds to each cloud; peak memory of all its
processes together in the first and in the second half of the clouds; whether the files are the same.
"""

from __future__ import annotations

import argparse
import contextlib
import filecmp
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

# As in the workers: a loop with a thread for every core would not be a fair comparison.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import dlogen
from dlogen.evaluation.shapes import random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io.cloud_files import write_cloud

#: Settings with which a small cloud takes little time, so that what the batch adds shows.
QUICK = ("profile=paper", "segmentation.segments=4", "mdtw.samples=10", "r=0.02", "r_n=0.1", "N=8", "beta=0.01")


def make_clouds(folder: Path, count: int, points: int) -> list[Path]:
    lines = [random_centre_line(seed, clearance=0.08) for seed in range(min(count, 50))]
    paths = []
    for i in range(count):
        path = folder / f"{i % 10}" / f"c{i:05d}.ply"
        path.parent.mkdir(exist_ok=True)
        write_cloud(path, sample_tube(lines[i % len(lines)], 0.02, points, i).points)
        paths.append(path)
    return paths


def loop(paths: list[Path], overrides: list[str]) -> float:
    config = dlogen.load_config(None, overrides)
    dlogen.fit(dlogen.read_cloud(paths[0]), config)
    start = time.perf_counter()
    for path in paths:
        with contextlib.suppress(dlogen.DlogenError):
            dlogen.fit(dlogen.read_cloud(path), config)
    return time.perf_counter() - start


def batch(clouds: Path, out: Path, jobs: int, overrides: list[str]) -> tuple[float, list[tuple[float, int]]]:
    """Seconds, and (seconds, bytes) of the memory of all processes meanwhile."""
    options = [option for text in overrides for option in ("--set", text)]
    command = [
        sys.executable,
        "-m",
        "dlogen",
        "batch",
        str(clouds),
        "-o",
        str(out),
        "-q",
        "--jobs",
        str(jobs),
        *options,
    ]
    start = time.perf_counter()
    process = subprocess.Popen(command)
    memory: list[tuple[float, int]] = []

    def watch() -> None:
        while process.poll() is None:
            memory.append((time.perf_counter() - start, sum(map(resident, family(process.pid)))))
            time.sleep(0.2)

    watcher = threading.Thread(target=watch)
    watcher.start()
    process.wait()
    seconds = time.perf_counter() - start
    watcher.join()
    return seconds, memory


def family(pid: int) -> list[int]:
    """A process and its children."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        return [pid, *(int(child) for task in tasks for child in (task / "children").read_text().split())]
    except OSError:
        return []


def resident(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0


def same(a: Path, b: Path) -> bool:
    def files(folder: Path) -> set[Path]:
        return {
            path.relative_to(folder)
            for path in folder.rglob("*")
            if path.is_file() and not path.name.startswith(("dlogen.sqlite", ".dlogen"))
        }

    return files(a) == files(b) and all(filecmp.cmp(a / name, b / name, shallow=False) for name in files(a))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clouds", type=int, default=1000)
    parser.add_argument("--points", type=int, default=5000)
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--quick", action="store_true", help="settings with which a cloud takes little time")
    arguments = parser.parse_args()
    overrides = list(QUICK) if arguments.quick else []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "clouds").mkdir()
        paths = make_clouds(folder / "clouds", arguments.clouds, arguments.points)
        plain = loop(paths, overrides)
        count = len(paths)
        print(f"plain loop     {count / plain:7.1f} clouds/s  {1e3 * plain / count:7.2f} ms each", flush=True)
        first = None
        for jobs in arguments.jobs:
            out = folder / f"out{jobs}"
            seconds, memory = batch(folder / "clouds", out, jobs, overrides)
            first = first or (jobs, seconds, out)
            halves = [
                max((size for at, size in memory if low <= at / seconds < high), default=0)
                for low, high in ((0.1, 0.5), (0.5, 1))
            ]
            print(
                f"{jobs} job{'s' if jobs > 1 else ' '}         {count / seconds:7.1f} clouds/s  "
                f"{1e3 * (seconds * jobs - plain) / count:+7.2f} ms each  {plain / seconds:.3f} x the loop, "
                f"{first[1] / seconds:.3f} x {first[0]} job; peak memory {halves[0] / 1e6:.0f} MB in the first half, "
                f"{halves[1] / 1e6:.0f} MB in the second; files {'the same' if same(first[2], out) else 'DIFFER'}",
                flush=True,
            )


if __name__ == "__main__":
    main()
