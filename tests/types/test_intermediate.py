"""What a stage leaves for dumps and pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlogen.types import Intermediate


def test_points_alone_are_enough() -> None:
    one, other = Intermediate("projected", np.zeros((4, 3))), Intermediate("unreached", np.zeros((0, 3)))
    assert one.columns == {} and one.colour is None
    one.columns["s"] = np.zeros(4)
    assert other.columns == {}, "columns are shared"


def test_it_cannot_be_given_other_points() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Intermediate("projected", np.zeros((4, 3))).points = np.ones((4, 3))  # type: ignore[misc]


def test_what_it_is_fits_on_a_line() -> None:
    made = Intermediate("sorted", np.zeros((4, 3)), {"s": np.zeros(4)}, colour="s")
    assert repr(made) == "Intermediate(name='sorted', points=array (4, 3), columns={1 keys}, colour='s')"
