"""Bad clouds in a batch: each is recorded with its cause, and the good ones are done."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from batch_runs import (
    AXES,
    files,
    records,
    run,
    summary,
    table,
    tube,
)

from dlogen.io.cloud_files import write_cloud

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")


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
