"""`dlogen batch` from the outside, with its processes, signals and files."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import pty
import shutil
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest
from batch_runs import (
    DLOGEN,
    PATIENCE,
    QUICK,
    files,
    run,
    status,
    table,
    tube,
)

from dlogen.io.cloud_files import write_cloud

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")

# Good and bad clouds


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


# The parent ends before its time


# Places that cannot be written


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
