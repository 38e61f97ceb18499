"""XML as the model formats write it: numbers that read back as they are, and elements a line each."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

#: Characters that XML 1.0 cannot hold, not even escaped: control characters, and what file names that are no Unicode
#: turn into.
_FORBIDDEN = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#x27;"})

HEADER = '<?xml version="1.0" encoding="utf-8"?>'


def number(value: float) -> str:
    """Shortest text that reads back as the same number; no minus before a zero."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Several, with blanks between."""
    return " ".join(number(value) for value in values)


def inertia(axial: float, transverse: float) -> dict[str, float]:
    """The entries of the inertia of a body round about x, by the names that URDF and SDFormat give them, kg m^2."""
    return {"ixx": axial, "ixy": 0.0, "ixz": 0.0, "iyy": transverse, "iyz": 0.0, "izz": transverse}


def element(tag: str, content: str = "", /, **attributes: str | float | Iterable[float]) -> str:
    """One element, on one line. Texts and numbers become attributes; a trailing underscore in a name is dropped.

    Args:
        tag: its name.
        content: XML inside it.
        attributes: in their order.
    """
    opening = start(tag, **attributes)
    return f"{opening}{content}</{tag}>" if content else f"{opening[:-1]}/>"


def start(tag: str, /, **attributes: str | float | Iterable[float]) -> str:
    """The opening tag of an element; see `element`."""
    written = "".join(f" {name.rstrip('_')}={_quoted(value)}" for name, value in attributes.items())
    return f"<{tag}{written}>"


def _quoted(value: str | float | Iterable[float]) -> str:
    if isinstance(value, str):
        return _escaped(value)
    # Whether something is iterable takes long to find out.
    if isinstance(value, (float, int)) or not isinstance(value, Iterable):
        return f'"{number(value)}"'
    return f'"{numbers(value)}"'


# Names of links and joints come several times each.
@lru_cache(maxsize=4096)
def _escaped(text: str) -> str:
    if not text.isprintable():
        # The expression takes milliseconds to compile; what is printable has none of these characters.
        text = re.sub(_FORBIDDEN, "\ufffd", text)
    return f'"{text.translate(_ESCAPES)}"'
