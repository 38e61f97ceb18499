from __future__ import annotations

import pytest

from dlogen.types.texts import counted, millimetres


@pytest.mark.parametrize(("count", "text"), [(0, "0 points"), (1, "1 point"), (2, "2 points"), (21, "21 points")])
def test_counted(count: int, text: str) -> None:
    assert counted(count, "point") == text


@pytest.mark.parametrize(("metres", "text"), [(0.012345, "12.3 mm"), (1.5, "1.5e+03 mm"), (0.0, "0 mm")])
def test_millimetres(metres: float, text: str) -> None:
    assert millimetres(metres) == text
