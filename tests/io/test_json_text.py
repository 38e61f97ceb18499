"""JSON as dlogen writes it: what comes back is what was given, and the same text for the same data."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlogen.io.json_text import dump_json

leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
values = st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=25)


@given(values)
def test_what_comes_back_is_what_was_given(value: Any) -> None:
    text = dump_json(value)
    assert json.loads(text) == value
    assert text.endswith("\n") and not text.endswith("\n\n")


def test_the_layout() -> None:
    data = {
        "b": 1,
        "a": {"length": 0.1, "none": None, "empty": {}},
        "rows": [[1.0, 2], [3, 4.5]],
        "flat": [1, 2, 3],
        "names": [["a]], [[", "b"], ["c"]],
        "items": [{"x": 1, "y": [2]}, {"x": 3}],
        "größe": "µm",
    }
    assert (
        dump_json(data)
        == """{
  "b": 1,
  "a": {
    "length": 0.1,
    "none": null,
    "empty": {}
  },
  "rows": [
    [1.0, 2],
    [3, 4.5]
  ],
  "flat": [1, 2, 3],
  "names": [
    ["a]], [[", "b"],
    ["c"]
  ],
  "items": [
    {"x": 1, "y": [2]},
    {"x": 3}
  ],
  "größe": "µm"
}
"""
    )


def test_keys_keep_their_order_and_floats_their_digits() -> None:
    text = dump_json({"z": 0.1 + 0.2, "a": 1e-17})
    assert text.index("z") < text.index('"a"')
    assert "0.30000000000000004" in text and "1e-17" in text


@pytest.mark.parametrize("value", [float("nan"), float("inf"), {"a": [[float("-inf")]]}])
def test_what_is_not_finite_is_refused(value: Any) -> None:
    with pytest.raises(ValueError):
        dump_json(value)
