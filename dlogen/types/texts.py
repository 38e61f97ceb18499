"""Numbers as messages have them."""

from __future__ import annotations


def counted(count: int, noun: str) -> str:
    """A number of things: "1 point", "2 points", "0 points"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def millimetres(metres: float) -> str:
    """A length with three significant digits: "12.3 mm"."""
    return f"{1e3 * metres:.3g} mm"
