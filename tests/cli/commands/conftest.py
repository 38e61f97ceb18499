"""Folders of clouds for `dlogen batch`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from batch_runs import (
    AXES,
    files,
    run,
    tube,
)

from dlogen.io.cloud_files import write_cloud


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


@pytest.fixture
def workshop(captures: Path, tmp_path: Path) -> Path:
    """A folder with `in` in it."""
    (tmp_path / "in").symlink_to(captures / "in")
    return tmp_path
