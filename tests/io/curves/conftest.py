"""A chain to write and read again."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dlogen.types import Result, Skeleton


@pytest.fixture(scope="module")
def result(
    make_result: Callable[..., Result], fitted: Callable[..., Skeleton], helix: Callable[..., Skeleton]
) -> Result:
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01, name="cable")
