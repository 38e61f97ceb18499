"""One digest over everything that dlogen writes: equal before and after a change that users must not notice.

    python tests/tools/output_digest.py                 # all sample clouds, profiles, formats; a batch; a sequence
    python tests/tools/output_digest.py --save before   # ... and keep the files, to look at what differs
    python tests/tools/output_digest.py --against DIR   # run another checkout's dlogen instead of this one's

It goes by the command line only, so that it runs on any layout of the package. Timings are switched off, as they differ
from run to run. Prints a digest for each part and one for all.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_clouds"
#: Numbers of steps and machines that are not the same in two runs.
_VOLATILE_FILES = {"dlogen.sqlite", "dlogen.sqlite-wal", "dlogen.sqlite-shm"}
_VOLATILE_KEYS = {"seconds", "timings", "time_total", "started", "finished", "modified_ns", "jobs"}

MODES = (
    ("refined", ()),
    ("paper", ("--profile", "paper", "--set", "e_max=0.01")),
    (
        "alternatives",
        ("--set", "report.alternatives=true", "--set", "material.preset=vacuum-hose", "--set", "joints.dof=3"),
    ),
    ("minimax", ("--set", "segmentation.placement=minimax", "--set", "joints.zero=straight")),
    ("ros", ("--frame", "optical-to-ros", "--set", "frame.x=1.5", "--set", "joints.base=floating")),
)


def run(python_path: Path, arguments: list[str], folder: Path, allowed: tuple[int, ...] = (0,)) -> str:
    """Standard output and messages of one call of the command line."""
    environment = os.environ | {"PYTHONPATH": str(python_path), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "dlogen", *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )
    if done.returncode not in allowed:
        raise SystemExit(f"dlogen {' '.join(arguments)} ended with {done.returncode}:\n{done.stderr}")
    return f"$ dlogen {' '.join(arguments)}\n{done.returncode}\n{done.stdout}\n{done.stderr}"


def make(python_path: Path, out: Path) -> None:
    """Write everything into `out`, a folder for each part."""
    samples = out / "samples"
    shutil.copytree(SAMPLES, samples, ignore=shutil.ignore_patterns("pictures", "README.md"))
    clouds = sorted(path.name for path in samples.iterdir() if path.suffix in (".ply", ".pcd"))
    quiet = ["--set", "report.timings=false"]
    for name, options in MODES:
        place = out / f"fit-{name}"
        place.mkdir()
        log = []
        for cloud in clouds:
            units = ["--set", "units=mm"] if "_mm" in cloud else []
            common = [*units, *quiet, *options, "--dump", "dump", "--format", "all", "-o", "."]
            common += ["--reference", f"../samples/{Path(cloud).stem}.truth.json"] if name != "ros" else []
            common += ["--plot"] if name in ("refined", "paper") else []
            log.append(
                run(python_path, ["fit", f"../samples/{cloud}", *common], place, (0, 1) if name == "paper" else (0,))
            )
        (place / "log.txt").write_text("\n".join(log))

    place = out / "batch"
    place.mkdir()
    (place / "bad.ply").write_text("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    inputs = ["../samples/bent.ply", "../samples/loop.pcd", "../samples/random_one_side.ply", "bad.ply"]
    run(python_path, ["batch", *inputs, "-o", "models", "--format", "urdf,json,mjcf", "-j", "2"], place, (1,))
    _without_times(place / "models")

    place = out / "sequence"
    place.mkdir()
    for k in range(6):
        synth = ["synth", "bent", "-o", f"frames/f_{k:03d}.ply", "--points", "1500", "--noise", "0.0005"]
        run(python_path, [*synth, "--seed", str(k)], place)
    given = ["frames/f_*.ply", "--rate", "10", "--format", "urdf,mjcf,sdf", "-j", "2", "--plot"]
    log = run(python_path, ["sequence", *given, "-o", "motion"], place)
    (place / "log.txt").write_text(re.sub(r"in \d+ s", "in some time", log))
    _without_times(place / "motion")
    one = ["frames/f_*.ply", "-o", "models", "--one-model", "-j", "2"]
    run(python_path, ["batch", *one], place)
    _without_times(place / "models")

    place = out / "other"
    place.mkdir()
    texts = [
        run(python_path, [*call], place, (0, 1) if call[0] == "eval" else (0,))
        for call in (
            ("info", "../samples/bent.ply", "--json"),
            ("info", "../samples/cable_mm.ply"),
            ("info", "../samples/loop.pcd", "--json"),
            ("config", "show"),
            ("config", "schema"),
            ("formats", "--json"),
            ("compare", "../fit-refined/bent.json", "../samples/bent.truth.json", "--json"),
            ("compare", "../fit-refined/bent.urdf", "../fit-paper/bent.json#skeleton", "--json"),
            ("compare", "../fit-refined/bent.skeleton.csv", "../fit-paper/bent.urdf", "--json"),
            ("eval", "--seeds", "1", "--json"),
            *((command, "--help") for command in ("fit", "batch", "sequence", "synth", "eval", "compare", "info")),
            *((command, "--help") for command in ("extract", "config", "formats")),
        )
    ]
    # Help that names a module of the package says where it is now.
    (place / "log.txt").write_text(re.sub(r"\(dlogen\.[a-z_.]+\)", "(a module)", "\n".join(texts)))
    for k, options in enumerate((["helical"], ["random", "--seed", "4", "--noise", "0.001"], ["hose"])):
        run(python_path, ["synth", *options, "-o", f"made_{k}.ply"], place)


def _without_times(folder: Path) -> None:
    """Blank what takes another value in every run: seconds in the summaries."""
    for path in folder.rglob("summary.json"):
        path.write_text(json.dumps(_blanked(json.loads(path.read_text())), indent=1))
    for path in folder.rglob("summary.csv"):
        header, *rows = (line.split(",") for line in path.read_text().splitlines())
        kept = [k for k, name in enumerate(header) if name not in _VOLATILE_KEYS and not name.startswith("time_")]
        path.write_text("\n".join(",".join(row[k] for k in kept if k < len(row)) for row in (header, *rows)))


def _blanked(data: object) -> object:
    if isinstance(data, dict):
        return {key: None if key in _VOLATILE_KEYS else _blanked(value) for key, value in data.items()}
    return [_blanked(item) for item in data] if isinstance(data, list) else data


def digests(out: Path) -> dict[str, str]:
    """SHA-256 of every file by its path."""
    found = {}
    for path in sorted(path for path in out.rglob("*") if path.is_file()):
        name = path.relative_to(out).as_posix()
        if path.name not in _VOLATILE_FILES and not name.startswith("samples/"):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def main() -> None:
    """Print the digests."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--save", type=Path, metavar="DIR", help="keep the files here")
    parser.add_argument("--against", type=Path, default=ROOT, metavar="DIR", help="the checkout to run")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="digest-") as temporary:
        out = Path(temporary) / "out"
        out.mkdir()
        make(given.against.resolve(), out)
        found = digests(out)
        if given.save:
            shutil.copytree(out, given.save)
            (given.save / "digests.json").write_text(json.dumps(found, indent=1))
    for part in sorted({name.partition("/")[0] for name in found}):
        own = {name: value for name, value in found.items() if name.startswith(f"{part}/")}
        print(f"{part:<20} {len(own):4} files  {_together(own)}")
    print(f"{'all':<20} {len(found):4} files  {_together(found)}")


def _together(found: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:24]


if __name__ == "__main__":
    main()
