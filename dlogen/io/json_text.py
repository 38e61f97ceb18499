"""JSON as dlogen writes it: the same text for the same data."""

from __future__ import annotations

import json
from typing import Any

#: To one line. Made once: `json.dumps` makes one for every call with such options.
_flat = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode


def dump_json(data: Any) -> str:
    """JSON as dlogen writes it: two spaces, an item of a list on a line, keys in the order given, no NaN."""
    return _json(data, "\n") + "\n"


def _json(data: Any, newline: str) -> str:
    """`newline` ends with the indentation that the value stands at.

    The standard encoder, told to indent, writes every number on a line of its own and takes three times as long.
    """
    inner = newline + "  "
    if isinstance(data, dict) and data:
        items = (f"{_flat(str(key))}: {_json(value, inner)}" for key, value in data.items())
        return "{" + inner + ("," + inner).join(items) + newline + "}"
    if not isinstance(data, (list, tuple)) or not any(isinstance(item, (dict, list, tuple)) for item in data):
        return _flat(data)
    if all(isinstance(item, (list, tuple)) for item in data):
        text = _flat(data)[1:-1]
        if not any(sign in text for sign in ("[[", "]]", "{", '"')):
            # Rows of numbers, all at once.
            return "[" + inner + text.replace("], [", "]," + inner + "[") + newline + "]"
    return "[" + inner + ("," + inner).join(map(_flat, data)) + newline + "]"
