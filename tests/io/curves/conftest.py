"""A chain to write and read again."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dlogen.types import FitData, Skeleton


@pytest.fixture(scope="module")
def result(
    make_result: Callable[..., FitData], fitted: Callable[..., Skeleton], helix: Callable[..., Skeleton]
) -> FitData:
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01, name="cable")
