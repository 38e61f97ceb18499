"""How much memory a reader asks for."""

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def _traced() -> Iterator[Callable[[], int]]:
    tracemalloc.start()
    peak = 0
    try:
        yield lambda: peak
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()


@pytest.fixture(scope="session")
def traced():
    """`with traced() as peak: ...`; then peak() is the most that Python and numpy held within the block, in bytes."""
    return _traced
