"""A file that may hold a curve, read once."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.errors import InputError
from dlogen.geometry.units import METRES
from dlogen.types import Array

_BLANKS = b" \t\r\n"


@dataclass(frozen=True, eq=False)
class CurveFile:
    """A file that was read. `path` is None for stdin and pipes, which cannot be read again."""

    name: str
    data: bytes
    path: Path | None

    @cached_property
    def text(self) -> bytes:
        """The content from its first visible character on."""
        return self.data.removeprefix(b"\xef\xbb\xbf").lstrip(_BLANKS)

    @cached_property
    def json(self) -> dict[str, Any]:
        """The content of a JSON file, empty for others."""
        if not self.text.startswith(b"{"):
            return {}
        try:
            content = json.loads(self.text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"this is not valid JSON: {error}", "the file may be cut off: write it again") from None
        assert isinstance(content, dict)
        return content

    @property
    def schema(self) -> str | None:
        """Which schema a JSON file says that it has."""
        schema = self.json.get("schema")
        return None if schema is None else str(schema)

    def points(self, *keys: str) -> Array:
        """Points of a JSON file, in metres: the value at keys[0], keys[1], ..."""
        value: Any = self.json
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if value is None:
            raise InputError(f"{'.'.join(keys)} is missing", "the file is incomplete: write it again")
        units = self.json.get("units", "m")
        units = units.get("length") if isinstance(units, dict) else units
        if units not in METRES:
            raise InputError(f"the units {units!r} are not known", f"known: {', '.join(METRES)}")
        try:
            return np.asarray(value, dtype=float) * METRES[units]
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{'.'.join(keys)} is not a list of points", "points are lists of three numbers") from None

    @contextmanager
    def seekable(self) -> Iterator[Path]:
        """A regular file with this content."""
        if self.path is not None:
            yield self.path
            return
        with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
            copy = Path(folder) / "curve"
            copy.write_bytes(self.data)
            yield copy
