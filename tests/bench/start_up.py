"""Start-up and fit times of whole processes, as ratios to what cannot be avoided, in one run.

    python tests/bench/start_up.py [--runs 11]

Prints, for each pair, the medians of both and the ratio of the medians with the bound that it should keep. Pairs run in
turn, so that a machine whose speed drifts does not tilt the ratio.
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

#: One BLAS thread on both sides: dlogen starts with one, and starting two takes a tenth of a second.
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"} | {
    "OPENBLAS_NUM_THREADS": "1"
}
SAMPLE = Path(__file__).parents[2] / "sample_clouds" / "bent.ply"


def seconds(command: list[str]) -> float:
    """Wall time of one run."""
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT)
    return time.perf_counter() - start


def main() -> None:
    """Run all pairs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=11)
    runs = parser.parse_args().runs
    dlogen = str(Path(sys.executable).with_name("dlogen"))
    with tempfile.TemporaryDirectory() as folder:
        fit = [dlogen, "fit", str(SAMPLE), "-o", folder, "--force", "--set", "r=0.02"]
        python = [sys.executable, "-c"]
        scientific = [*python, "import numpy, scipy.spatial, scipy.linalg"]
        pairs = [
            ("dlogen --help / import click", [dlogen, "--help"], [*python, "import click"], 1.4),
            ("dlogen fit --profile paper / import numpy, scipy", [*fit, "--profile", "paper"], scientific, 1.4),
            ("dlogen fit / import numpy, scipy", fit, scientific, 1.4),
        ]
        for name, ours, base, bound in pairs:
            times = [(seconds(ours), seconds(base)) for _ in range(runs + 1)][1:]
            a, b = (statistics.median(column) for column in zip(*times, strict=True))
            print(f"{name:<50} {1e3 * a:7.0f} ms / {1e3 * b:5.0f} ms = {a / b:5.2f}   (bound {bound})")


if __name__ == "__main__":
    main()
