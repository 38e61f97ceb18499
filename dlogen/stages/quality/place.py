"""Findings at a place on the skeleton line."""

from __future__ import annotations

from dlogen.geometry.vectors import as_place
from dlogen.types import Finding, Skeleton


def finding_at(line: Skeleton, code: str, message: str, severity: str, s: float) -> Finding:
    """A finding at a coordinate of the line, with its place in space."""
    return Finding(code, message, severity, s, as_place(line(s)[0]))
