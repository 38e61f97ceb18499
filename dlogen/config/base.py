"""What all sections of the configuration have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from typing import Any, cast

from dlogen.config.fields import Setting
from dlogen.config.problems import refuse, wrong_value


class Section:
    """Checks its settings when it is made. What a section is about stands in its docstring.

    It compares and shows the settings of all sections. `dataclass` would write the source of that for each of them,
    which Python compiles at every start: 2.5 of 24 ms.
    """

    @classmethod
    @cache
    def settings(cls) -> Mapping[str, Setting]:
        """The settings among the fields, by name, in the order of declaration."""
        own = fields(cast("Any", cls))
        return {item.name: item.metadata["setting"] for item in own if "setting" in item.metadata}

    def own_values(self) -> dict[str, Any]:
        """The values of the settings, by name."""
        return {name: getattr(self, name) for name in self.settings()}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    def __eq__(self, other: object) -> bool:
        return vars(self) == vars(other) if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(vars(self).values()))

    def __post_init__(self) -> None:
        problems = []
        for name, setting in self.settings().items():
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, setting.read(value))
            except ValueError as error:
                problems.append(wrong_value("", name, value, setting, str(error)))
        refuse(problems)
