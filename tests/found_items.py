"""What the inputs of a batch stand for, in short."""

from __future__ import annotations

from typing import Any

import pytest

from dlogen.batch.discover import find_items
from dlogen.errors import DlogenError, UsageError


def keys(*inputs: str, **more: Any) -> list[str]:
    return [item.key for item in find_items(inputs, **more)]


def clouds(*inputs: str, **more: Any) -> list[str]:
    return [item.cloud for item in find_items(inputs, **more)]


def refusal(*inputs: str, kind: type[DlogenError] = UsageError, **more: Any) -> DlogenError:
    with pytest.raises(DlogenError) as caught:
        find_items(inputs, **more)
    assert type(caught.value) is kind
    assert caught.value.exit_code == 2
    assert caught.value.hint
    return caught.value
