"""Configuration files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """Writes a file with this content and returns its path."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "cfg.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
