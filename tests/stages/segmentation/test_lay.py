"""Chains laid on a line: to their ends, or for as long as they are possible."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.shapes import random_centre_line
from dlogen.stages.segmentation.curve_table import CurveTable, Walk, trace
from dlogen.stages.segmentation.lay import lay_chains, lay_while_possible


@pytest.fixture(scope="module")
def table(fitted) -> CurveTable:
    return CurveTable(fitted(random_centre_line(2)))


def test_steps_of_any_number_lay_the_same_chains(table: CurveTable) -> None:
    lengths = table.line.length / np.linspace(3.3, 40.0, 23)
    walk, everything = Walk(table, lengths), np.arange(23)
    columns = [np.zeros((23, 1))]
    for steps in (1, 2, 5, 7, 100):
        columns.append(walk.advance(everything, steps)[:, 1:])
    whole = trace(table, lengths)
    np.testing.assert_allclose(np.concatenate(columns, axis=1), whole.u, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(walk.counts, whole.counts)
    assert not walk.going.any()


def test_a_walk_that_is_at_its_end_stays_there(table: CurveTable) -> None:
    walk = Walk(table, np.array([0.9 * table.line.length]))
    walk.advance(np.array([0]), 50)
    assert (walk.advance(np.array([0]), 3) == table.cells).all()


@pytest.mark.parametrize("e_max", [0.0002, 0.0005, 0.002])
def test_chains_that_are_possible_are_laid_to_their_ends(table: CurveTable, e_max: float) -> None:
    lengths = table.line.length / np.linspace(2.0, 120.0, 300)
    whole, early = lay_chains(table, lengths, e_max), lay_while_possible(table, lengths, e_max, np.zeros(299, bool))
    laid = early.counts > 0
    possible = whole.deviation <= e_max
    assert possible.any() and laid[possible].all()
    np.testing.assert_array_equal(early.counts[laid], whole.counts[laid])
    np.testing.assert_allclose(early.deviation[laid], whole.deviation[laid], rtol=1e-3)
    # Newton steps are made until all chains of a step are done.
    np.testing.assert_allclose(early.share[laid], whole.share[laid], rtol=1e-8)
    for i in np.flatnonzero(laid):
        n = whole.counts[i] + 1
        np.testing.assert_allclose(early.u[i, :n], whole.u[i, :n], rtol=0.0, atol=1e-8)
    # Those that end early are too far off, and so is all that lies beside them.
    ended = np.flatnonzero(~laid)
    assert len(ended) > 15
    assert (early.deviation[ended] > e_max).all() and (whole.deviation[ended] > e_max).all()
    assert early.refuted[ended[ended < 299]].all() and early.refuted[ended[ended > 0] - 1].all()
    # What the pieces of whole chains refute is refuted here as well, up to where the chains end.
    np.testing.assert_array_equal(early.refuted & ~whole.refuted, False)


def test_neighbours_that_are_apart_do_not_wait_for_each_other(table: CurveTable) -> None:
    possible, hopeless = table.line.length / 400.0, table.line.length / 25.0
    lengths = np.array([hopeless, possible])
    together, apart = (lay_while_possible(table, lengths, 1e-4, np.array([flag])) for flag in (False, True))
    assert together.counts[0] > 0 and apart.counts[0] == 0
    assert together.counts[1] == apart.counts[1] > 0
