"""Results with other settings than those of their fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from dlogen.types import FitData

_Fit = TypeVar("_Fit", bound=FitData)


def configured(result: _Fit, **changes: Any) -> _Fit:
    """The result as if it had been configured so: sections with the keys given and defaults else, or single keys."""
    chosen: dict[str, Any] = {}
    for key, value in changes.items():
        if isinstance(value, Mapping):
            fresh = type(getattr(result.config, key))(**value)
            chosen |= {f"{key}.{name}": getattr(fresh, name) for name in fresh.settings()}
        else:
            chosen[key] = value
    return replace(result, config=result.config.resolved(chosen))
