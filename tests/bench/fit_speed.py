"""Speed and memory of the refined fit, as ratios to scipy's `cKDTree` of the same points, in one run.

    python tests/bench/fit_speed.py [--runs 9] [--large]

For clouds of 5,000 points: the stages scale, ordering and refine over building a cKDTree and asking it for the 12
nearest neighbours of every point, both as processor time of this process, in turn. With --large: the whole process
`dlogen fit` for 1,000,000 and 10,000,000 points in binary PLY files, by wall time, and its largest resident memory.
Each figure is printed with the bound that it should keep.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: Asks for neighbours and prints how long that took, without the reading.
NEIGHBOURS = """
import sys, time
from scipy.spatial import cKDTree
import dlogen
points = dlogen.read_cloud(sys.argv[1]).points
start = time.perf_counter()
cKDTree(points).query(points, 12)
print(time.perf_counter() - start)
"""


def small(runs: int) -> None:
    """The fit of 5,000 points."""
    import numpy as np
    from scipy.spatial import cKDTree

    from dlogen.evaluation.shapes import centre_line, random_centre_line
    from dlogen.evaluation.synthetic import sample_tube
    from dlogen.stages.refined.ordering import order
    from dlogen.stages.refined.refine import refine
    from dlogen.stages.scale import estimate_scale

    cable = random_centre_line(5, clearance=0.03)
    clouds = [
        ("bent", centre_line("bent"), 0.02, {}, 4.0),
        ("straight", centre_line("straight"), 0.02, {}, 4.0),
        ("helical", centre_line("helical"), 0.02, {}, 4.0),
        ("random, noise 1 mm", cable, 0.012, {"noise": 1e-3}, 4.0),
        ("one side, noise 1 mm", cable, 0.015, {"noise": 1e-3, "side": (0.0, 0.0, -1.0)}, 4.0),
        ("wire, r 1.5 mm, noise 0.5 mm", random_centre_line(5), 0.0015, {"noise": 5e-4}, 7.0),
    ]
    for name, line, radius, options, bound in clouds:
        points = sample_tube(line, radius, 5000, np.random.default_rng(1), **options).points
        rows = []
        for _ in range(runs + 1):
            start = time.process_time()
            cKDTree(points).query(points, 12)
            base = time.process_time() - start
            start = time.process_time()
            ordering = order(points, None, estimate_scale(points))
            refine(points, ordering.backbone, ordering.radius)
            rows.append((time.process_time() - start, base))
        ours, base = (statistics.median(column) for column in zip(*rows[1:], strict=True))
        ratio = statistics.median(a / b for a, b in rows[1:])
        print(f"{name:<32} {1e3 * ours:6.1f} ms / {1e3 * base:5.1f} ms = {ratio:5.2f}   (bound {bound:g})", flush=True)


def process(command: list[str]) -> tuple[float, float]:
    """Wall time of a process, seconds, and its largest resident memory, MB."""
    start = time.perf_counter()
    pid = os.posix_spawnp(
        command[0],
        command,
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)],
    )
    _, status, usage = os.wait4(pid, 0)
    seconds = time.perf_counter() - start
    if status:
        raise SystemExit(f"{' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
    return seconds, usage.ru_maxrss / (1 << 10 if sys.platform.startswith("linux") else 1 << 20)


def large() -> None:
    """Whole processes on a million and ten million points."""
    dlogen = str(Path(sys.executable).with_name("dlogen"))
    with tempfile.TemporaryDirectory() as folder:
        took = {}
        for count, most in ((1_000_000, 600), (10_000_000, 3000)):
            cloud = f"{folder}/cloud{count}.ply"
            made = [dlogen, "synth", "random", "-o", cloud, "-M", str(count), "--diameter", "0.024", "--noise", "0.001"]
            subprocess.run(made, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            took[count], memory = process([dlogen, "fit", cloud, "-o", folder])
            if count == 1_000_000:
                asked = subprocess.run([sys.executable, "-c", NEIGHBOURS, cloud], check=True, capture_output=True)
                base, name, bound = float(asked.stdout), "neighbours", 1.5
            else:
                base, name, bound = took[1_000_000], "1,000,000", 5.0
            print(
                f"{count:,} points / {name:<12} {took[count]:6.1f} s / {base:5.1f} s = {took[count] / base:5.2f}"
                f"   (bound {bound:g}); {memory:5.0f} MB (bound {most})",
                flush=True,
            )


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--large", action="store_true", help="a million points and ten million, too")
    options = parser.parse_args()
    small(options.runs)
    if options.large:
        large()


if __name__ == "__main__":
    main()
