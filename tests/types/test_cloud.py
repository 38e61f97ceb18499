"""Clouds know their size and whether they are images."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.types import Cloud, RawCloud


def test_the_length_is_the_number_of_points() -> None:
    assert len(Cloud(np.zeros((7, 3)))) == 7
    assert len(Cloud(np.zeros((0, 3)))) == 0


@pytest.mark.parametrize(("width", "height", "organised"), [(4, 3, True), (12, 1, False)])
def test_an_image_has_rows(width: int, height: int, organised: bool) -> None:
    assert RawCloud(np.zeros((12, 3)), width=width, height=height).organised == organised
