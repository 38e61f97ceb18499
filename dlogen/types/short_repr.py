"""A `repr` that fits on a screen: arrays by their shape, what is inside by its kind."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

#: Characters in a line, and lines.
_WIDTH, _LINES = 110, 3


class ShortRepr:
    """For dataclasses with arrays: `Cloud(points=array (5000, 3), normals=None, ...)`, three lines at most."""

    def __repr__(self) -> str:
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        parts = [f"{item.name}={_short(getattr(self, item.name))}" for item in fields if item.repr]
        return _wrapped(f"{type(self).__name__}(", parts)


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array {value.shape}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return f"{{{len(value)} keys}}"
    if isinstance(value, (tuple, list)) and len(value) > 3:
        return f"({len(value)} items)"
    if isinstance(value, (tuple, list)):
        return f"({', '.join(map(_short, value))})"
    if dataclasses.is_dataclass(value):
        return type(value).__name__
    return repr(value)


def _wrapped(start: str, parts: list[str]) -> str:
    """The parts with commas between them; where they take too many lines, "..." for the rest."""
    lines = [start]
    for number, part in enumerate(parts):
        part = part if len(part) <= _WIDTH // 2 else f"{part[: _WIDTH // 2 - 3]}..."
        text = part + (")" if number == len(parts) - 1 else ", ")
        if len(lines[-1]) + len(text) > _WIDTH:
            if len(lines) == _LINES:
                return "\n".join(lines).rstrip(", ") + ", ...)"
            lines.append("    ")
        lines[-1] += text
    return "\n".join(line.rstrip() for line in lines) if parts else f"{start})"
