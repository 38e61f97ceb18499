"""One cloud of a batch: what it is made of, and that it travels."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError

import pytest

from dlogen.batch.item import Item


def test_nothing_but_a_cloud_and_a_key_is_needed() -> None:
    item = Item("a/x.ply", "a/x")
    assert (item.config, item.overrides, item.time) == (None, (), None)


def test_it_is_a_value_that_can_be_sent_and_not_changed() -> None:
    item = Item("x.ply", "x", "x.yaml", ("r=0.01",), 1.5)
    assert pickle.loads(pickle.dumps(item)) == item
    assert len({item, Item("x.ply", "x", "x.yaml", ("r=0.01",), 1.5)}) == 1
    assert item != Item("x.ply", "x", "x.yaml", ("r=0.02",), 1.5)
    with pytest.raises(FrozenInstanceError):
        item.key = "y"  # type: ignore[misc]
    # There may be a million of them.
    assert not hasattr(item, "__dict__")
