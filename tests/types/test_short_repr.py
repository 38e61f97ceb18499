"""A `repr` that fits on a screen."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class Some(ShortRepr):
    points: Any
    value: Any = 1.0
    hidden: int = field(default=0, repr=False)


def test_arrays_by_shape_and_numbers_shortly() -> None:
    assert repr(Some(np.zeros((5000, 3)), 1 / 3)) == "Some(points=array (5000, 3), value=0.333333)"
    assert repr(Some(None, {"a": 1, "b": 2})) == "Some(points=None, value={2 keys})"
    assert repr(Some((1.0, "x"), [1, 2, 3, 4])) == "Some(points=(1, 'x'), value=(4 items))"
    assert repr(Some(Some(0))) == "Some(points=Some, value=1)"


def test_three_lines_at_most() -> None:
    many = type("Many", (ShortRepr,), {"__annotations__": {f"field_{k}": str for k in range(40)}})
    text = repr(dataclass(repr=False)(many)(*["y" * 30] * 40))
    lines = text.splitlines()
    assert len(lines) == 3
    assert max(map(len, lines)) <= 120
    assert text.endswith(", ...)")
    assert "field_0=" in lines[0]
    assert "..." in repr(Some("z" * 500)) and len(repr(Some("z" * 500))) < 120
