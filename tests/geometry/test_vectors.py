"""Vectors in rows and columns against sums that are written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dlogen.geometry.vectors import as_place, column_dots, dots, normals_to, unit

Array = np.ndarray

numbers = st.floats(-1e6, 1e6, allow_nan=False)
rows = st.integers(1, 8).flatmap(lambda m: hnp.arrays(float, (m, 3), elements=numbers))
pairs = st.integers(1, 8).flatmap(lambda m: hnp.arrays(float, (2, m, 3), elements=numbers))


@given(pairs)
def test_dots_of_rows_and_of_columns(pair: Array) -> None:
    a, b = pair
    expected = [sum(x * y for x, y in zip(p, q, strict=True)) for p, q in zip(a.tolist(), b.tolist(), strict=True)]
    scale = 1e-15 * float(np.abs(a).max() * np.abs(b).max() + 1.0)
    assert dots(a, b) == pytest.approx(expected, abs=10 * scale)
    assert column_dots(a.T, b.T) == pytest.approx(expected, abs=10 * scale)
    assert np.array_equal(dots(a, b), dots(b, a))


def test_dots_broadcast() -> None:
    a, b = np.arange(12.0).reshape(2, 2, 3), np.array([1.0, 10.0, 100.0])
    assert dots(a, b).tolist() == [[210.0, 543.0], [876.0, 1209.0]]
    assert column_dots(np.moveaxis(a, -1, 0), b[:, None, None]).tolist() == [[210.0, 543.0], [876.0, 1209.0]]


@given(rows)
def test_unit_vectors_have_the_direction_and_the_length_one(vectors: Array) -> None:
    found, sizes = unit(vectors), np.sqrt((vectors**2).sum(axis=1))
    long = sizes > 1e-150
    assert np.linalg.norm(found[long], axis=1) == pytest.approx(1.0, abs=1e-15)
    assert found[long] * sizes[long, None] == pytest.approx(vectors[long], rel=1e-14, abs=1e-300)


def test_what_has_no_length_gets_no_direction() -> None:
    assert unit(np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
    # Rounding of something that ought to be zero stays small.
    assert unit(np.array([[1e-16, 0.0, 0.0], [0.0, 2.0, 0.0]]), least=1e-9).tolist() == [
        [pytest.approx(1e-7), 0.0, 0.0],
        [0.0, 1.0, 0.0],
    ]


@given(rows.filter(lambda vectors: (np.linalg.norm(vectors, axis=1) > 1e-3).all()))
def test_normals_are_across(vectors: Array) -> None:
    directions = unit(vectors)
    normals = normals_to(directions)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-14)
    assert (normals * directions).sum(axis=1) == pytest.approx(0.0, abs=1e-14)
    # They have nothing of the axis that they were made with: the one least along the direction.
    least = np.argmin(np.abs(directions), axis=1)
    assert normals[np.arange(len(normals)), least] == pytest.approx(0.0, abs=1e-14)


def test_a_place_is_plain_numbers_in_their_order() -> None:
    place = as_place(np.array([1.0, -2.5, 3.0]))
    assert place == (1.0, -2.5, 3.0)
    assert [type(value) for value in place] == [float, float, float]
