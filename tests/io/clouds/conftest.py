"""Reading what tests make byte by byte."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dlogen.io.cloud_files import read_raw
from dlogen.types import RawCloud


@pytest.fixture
def read_bytes(tmp_path: Path, request: pytest.FixtureRequest) -> Callable[[bytes], RawCloud]:
    """Bytes -> the cloud in them; `SUFFIX` of the test's module is the end of the file's name."""

    def read_them(data: bytes) -> RawCloud:
        path = tmp_path / f"cloud{request.module.SUFFIX}"
        path.write_bytes(data)
        return read_raw(path)

    return read_them
