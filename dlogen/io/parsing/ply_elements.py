"""Elements and properties of a PLY header."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Property:
    """One property of an element.

    Attributes:
        name: its name.
        type: numpy's code for a number, without the byte order ("f4").
        count: the same for the count of a list; empty where the property is a single number.
    """

    name: str
    type: str
    count: str = ""

    @property
    def smallest(self) -> int:
        """Bytes of a number, or of an empty list."""
        return int((self.count or self.type)[1])


@dataclass(frozen=True)
class Element:
    """One element of a header: so many rows, all with the same properties."""

    name: str
    rows: int
    properties: tuple[Property, ...]

    @property
    def what(self) -> str:
        """The rows, in messages."""
        from dlogen.io.parsing.cloud_table import shorten

        return "points" if self.name == "vertex" else f"{shorten(self.name)!r} rows"

    @property
    def names(self) -> list[str]:
        """Of the properties."""
        return [item.name for item in self.properties]

    @property
    def has_lists(self) -> bool:
        """Whether rows can be of unlike size."""
        return any(item.count for item in self.properties)
