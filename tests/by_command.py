"""The command line for tests: `python -m dlogen`, in this process or in one of its own."""

from __future__ import annotations

import contextlib
import io
import os
import runpy
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

import dlogen


def run(*arguments: str | Path, status: int = 0) -> str:
    """What `python -m dlogen` prints, run in this process: a test can replace what it finds there."""
    out, messages = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["dlogen", *map(str, arguments)]),
        mock.patch.dict(os.environ),  # the command sets a variable
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(messages),
        pytest.raises(SystemExit) as ended,
    ):
        runpy.run_module("dlogen", run_name="__main__")
    assert (ended.value.code or 0) == status, messages.getvalue()
    return out.getvalue()


def run_apart(*arguments: str | Path, status: int = 0) -> str:
    """The same in a process of its own, for commands that start others."""
    environment = os.environ | {"PYTHONPATH": str(Path(dlogen.__file__).parents[1]), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "dlogen", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done.stdout
