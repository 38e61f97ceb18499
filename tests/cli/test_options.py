from __future__ import annotations

import os
from pathlib import Path

import pytest

from dlogen.cli.options import cores


@pytest.mark.parametrize(
    ("text", "expected"),
    [("100000 100000\n", 1), ("10000 100000\n", 1), ("max 100000\n", None), ("6400000 100000\n", None), ("?", None)],
)
def test_cores_are_those_of_the_container(tmp_path: Path, text: str, expected: int | None) -> None:
    limits = tmp_path / "cpu.max"
    limits.write_text(text)
    everything = cores(tmp_path / "missing")
    assert 1 <= everything <= (os.cpu_count() or 1)
    assert cores(limits) == (expected if expected is not None else min(everything, 64))
