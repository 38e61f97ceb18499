"""Runs of truth values against the groups of `itertools`."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dlogen.geometry.runs import runs


@given(st.lists(st.booleans(), max_size=40))
def test_runs(row: list[bool]) -> None:
    expected = []
    for value, group in groupby(range(len(row)), key=row.__getitem__):
        places = list(group)
        if value:
            expected.append((places[0], places[-1] + 1))
    first, last = runs(np.array(row, dtype=bool))
    assert list(zip(first.tolist(), last.tolist(), strict=True)) == expected


def test_at_both_ends_and_nowhere() -> None:
    assert [part.tolist() for part in runs(np.array([True, True, False, True]))] == [[0, 3], [2, 4]]
    assert [part.tolist() for part in runs(np.zeros(3, dtype=bool))] == [[], []]
