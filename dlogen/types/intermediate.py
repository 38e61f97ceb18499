"""What a stage leaves for dumps and pictures."""

from __future__ import annotations

from dataclasses import dataclass, field

from dlogen.types.arrays import Array
from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class Intermediate(ShortRepr):
    """What a stage made of the points, for dumps and pictures.

    Attributes:
        name: of the stage.
        points: (K, 3) metres.
        columns: further numbers for each point, (K,) each.
        colour: name of the column in [0, 1] that a picture should show as colour, if any.
    """

    name: str
    points: Array
    columns: dict[str, Array] = field(default_factory=dict)
    colour: str | None = None
