"""What all pools have in common."""

from __future__ import annotations

import inspect

import pytest

from dlogen.batch.executors.dask import DaskPool
from dlogen.batch.executors.local import LocalPool
from dlogen.batch.executors.pool import Pool

MEMBERS = [name for name in vars(Pool) if not name.startswith("_")]


@pytest.mark.parametrize("kind", [LocalPool, DaskPool])
def test_pools_have_what_a_batch_asks_for(kind: type) -> None:
    assert "run" in MEMBERS
    for name in MEMBERS:
        wanted, found = getattr(Pool, name), getattr(kind, name)
        if inspect.isfunction(wanted):
            assert list(inspect.signature(found).parameters) == list(inspect.signature(wanted).parameters)
