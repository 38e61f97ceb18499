"""Whether the tests notice mistakes: puts each mistake of `mutant_table.py` into a copy of the tree and runs tests.

    python tests/tools/mutants.py                         # the table; about a quarter of an hour
    python tests/tools/mutants.py --jobs 2                # two copies, two at a time
    python tests/tools/mutants.py --only glue --only ply-header-line
    python tests/tools/mutants.py --whole                 # ask all tests before a mistake is said to have lived

For each mistake it runs, and stops at the first failure:

1. the tests that mirror the module: `tests/<room>/test_<module>*.py`;
2. the other tests of its room, those of rows that belong together (`tests/test_alignment*.py`), of the pipeline, of the
   API, and of the kinematics that all model formats agree on;
3. with `--whole`, all others.

A test that fails has to fail again with the mistake and to pass without it, or it does not count: another one has to
notice. Tests that run longer than `--timeout` count as having noticed, as a loop without an end is noticed.

Prints one line for each mistake: by which test it was caught, or LIVED. Exit 1 if fewer than nine in ten of the table
were caught, or any of the first group (`glue`), and 2 if the table does not fit the code. What lived is a gap in the
tests: sharpen them, by what is known to be true of the object, rather than take an easier mistake into the table.
"""

from __future__ import annotations

import argparse
import itertools
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from mutant_table import GLUE, MUTANTS, Mutant

ROOT = Path(__file__).resolve().parents[2]

#: Tests that are asked about mistakes of every room, after those of the room itself.
EVERYWHERE = (
    "tests/test_alignment*.py",
    "tests/test_pipeline.py",
    "tests/test_api.py",
    "tests/io/models/test_kinematics_agree.py",
)

#: Share of the table that has to be caught.
ENOUGH = 0.9

#: What the copies do without.
_LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".pytest_cache", ".mypy_cache", ".ruff_cache")

_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.+?)?)(?: - .*)?$", re.MULTILINE)


@dataclass(frozen=True)
class Ended:
    """How a run of pytest ended: its exit code, None after the timeout; and the tests that failed."""

    code: int | None
    failed: tuple[str, ...]
    output: str


class Copy:
    """A copy of the tree that mistakes are put into."""

    def __init__(self, folder: Path, timeout: float) -> None:
        self.folder, self.timeout = folder, timeout
        self.process: subprocess.Popen[str] | None = None
        self.done_with = False
        shutil.copytree(ROOT, folder, ignore=_LEFT_OUT, symlinks=True)
        self.environment = os.environ | {"PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
        where = [sys.executable, "-c", "import dlogen; print(dlogen.__file__)"]
        found = subprocess.run(where, env=self.environment, cwd=folder, capture_output=True, text=True, check=True)
        if Path(found.stdout.strip()).parents[1] != folder:
            raise SystemExit(f"the copy is not what is tested, but {found.stdout.strip()}")

    def put(self, module: str, text: str) -> None:
        """Write a module, and forget how it was compiled: two texts of one size and second look alike."""
        path = self.folder / "dlogen" / module
        path.write_text(text, encoding="utf-8")
        for compiled in path.parent.glob(f"__pycache__/{path.stem}.*.pyc"):
            compiled.unlink()

    def run(self, tests: list[str], leave_out: set[str] = frozenset()) -> Ended:  # type: ignore[assignment]
        """Run these tests until one fails."""
        if self.done_with:
            raise KeyboardInterrupt
        # A file that cannot even be read is left out as a whole.
        tests = [test for test in tests if test not in leave_out]
        if not tests:
            return Ended(0, (), "")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=line", "-rfE", "-p", "no:cacheprovider", *tests]
        command += [f"--deselect={test}" for test in sorted(leave_out)]
        # A group of its own, so that what tests have started ends as well.
        self.process = process = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output = process.communicate(timeout=self.timeout)[0]
        except subprocess.TimeoutExpired:
            self.stop()
            return Ended(None, (), process.communicate()[0])
        return Ended(process.returncode, tuple(_FAILED.findall(output)), output)

    def stop(self) -> None:
        """End what is running."""
        if self.process is not None and self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)


def changed(mutant: Mutant) -> tuple[str, str]:
    """The text of the module, and the text with the mistake in it."""
    path = ROOT / "dlogen" / mutant.module
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    if text.count(mutant.old) != 1:
        print(
            f"{mutant.name}: in dlogen/{mutant.module} this text stands {text.count(mutant.old)} times, not once:\n"
            f"    {mutant.old}\n"
            "the table must follow the code: put in what the code has become, with the same kind of mistake",
            file=sys.stderr,
        )
        raise SystemExit(2)
    return text, text.replace(mutant.old, mutant.new)


def rounds(mutant: Mutant, whole: bool) -> Iterator[list[str]]:
    """Tests to ask, the likeliest first: files and folders below the root, none of them twice."""
    module = Path(mutant.module)
    room = Path("tests") / module.parent
    own = sorted(path.relative_to(ROOT) for path in (ROOT / room).glob(f"test_{module.stem}*.py"))
    # Of modules at the top of the package the room is not all of the tests.
    others = sorted(path.relative_to(ROOT) for path in (ROOT / room).rglob("test_*.py")) if room.name != "tests" else []
    everywhere = [path.relative_to(ROOT) for pattern in EVERYWHERE for path in sorted(ROOT.glob(pattern))]
    all_tests = sorted(path.relative_to(ROOT) for path in (ROOT / "tests").rglob("test_*.py")) if whole else []
    asked: set[Path] = set()
    for group in (own, [*others, *everywhere], all_tests):
        fresh = [path for path in dict.fromkeys(group) if path not in asked]
        asked.update(fresh)
        if fresh:
            yield list(map(str, fresh))


def caught_by(mutant: Mutant, copy: Copy, whole: bool) -> str | None:
    """The test that notices the mistake; None if none does."""
    text, wrong = changed(mutant)
    useless: set[str] = set()
    try:
        for tests in rounds(mutant, whole):
            while True:
                copy.put(mutant.module, wrong)
                ended = copy.run(tests, useless)
                if ended.code is None:
                    return f"more than {copy.timeout:g} s"
                if ended.code in (0, 5):  # all passed, or there were none
                    break
                if not ended.failed or ended.failed[0] in useless:
                    print(ended.output[-3000:], file=sys.stderr)
                    raise SystemExit(f"{mutant.name}: pytest ended with {ended.code}")
                test = ended.failed[0]
                again = copy.run([test]).code
                copy.put(mutant.module, text)
                if again != 0 and copy.run([test]).code == 0:
                    return test
                print(f"{mutant.name}: {test} does not count, it fails by itself", file=sys.stderr)
                useless.add(test)
    finally:
        copy.put(mutant.module, text)
    return None


def main() -> int:
    """Go through the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", metavar="NAME", help="mistakes with this in their name; repeatable")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="how many at a time (default: 1)")
    parser.add_argument("--timeout", type=float, default=1800.0, metavar="SECONDS", help="for each run (default: 1800)")
    parser.add_argument("--whole", action="store_true", help="ask all tests before a mistake is said to have lived")
    arguments = parser.parse_args()

    wanted = [
        mutant
        for mutant in (*GLUE, *MUTANTS)
        if arguments.only is None or any(name in mutant.name for name in arguments.only)
    ]
    for mutant in wanted:
        changed(mutant)
    if not wanted:
        print("there is no mistake of that name in the table", file=sys.stderr)
        return 2

    caught: dict[str, bool] = {}
    counter = itertools.count(1)
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        made = [Copy(Path(folder).resolve() / str(number), arguments.timeout) for number in range(arguments.jobs)]
        copies: queue.Queue[Copy] = queue.Queue()
        for copy in made:
            copies.put(copy)

        def work(mutant: Mutant) -> None:
            copy = copies.get()
            try:
                test = caught_by(mutant, copy, arguments.whole)
            finally:
                copies.put(copy)
            caught[mutant.name] = test is not None
            said = f"caught by {test}" if test else f"LIVED: {mutant.breaks}"
            print(f"[{next(counter)}/{len(wanted)}] {mutant.name}: {said}", flush=True)

        pool = ThreadPoolExecutor(arguments.jobs)
        try:
            # Errors of a thread come out here.
            list(pool.map(work, wanted))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for copy in made:
                copy.done_with = True
                copy.stop()
            pool.shutdown()

    enough = True
    for what, group, least in (("glue: ", GLUE, 1.0), ("", MUTANTS, ENOUGH)):
        found = [caught[mutant.name] for mutant in group if mutant.name in caught]
        if found:
            print(f"{what}{sum(found)} of {len(found)} caught")
            enough &= sum(found) >= least * len(found)
    return 0 if enough else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
