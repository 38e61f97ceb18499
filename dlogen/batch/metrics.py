"""The figures that a batch records of every cloud."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dlogen.errors import UsageError

if TYPE_CHECKING:
    from dlogen.types import Result


@dataclass(frozen=True)
class Figure:
    """A number that a fit gives.

    Attributes:
        name: column in the records.
        of: takes it from a result; metres, counts.
        whole: whether it is a count.
    """

    name: str
    of: Callable[[Result], Any]
    whole: bool = False


FIGURES = (
    Figure("points", lambda result: result.provenance["points"], whole=True),
    Figure("length", lambda result: result.skeleton.length),
    Figure("radius", lambda result: result.chain.radius),
    Figure("segment_count", lambda result: len(result.chain.lengths), whole=True),
    Figure("segment_length", lambda result: result.joints.segment_length),
    Figure("last_segment_length", lambda result: result.joints.last_segment_length),
    Figure("e_max", lambda result: result.e_max),
    Figure("max_deviation", lambda result: result.max_deviation),
    Figure("mdtw_mean", lambda result: result.mdtw.mean),
    Figure("mdtw_std", lambda result: result.mdtw.std),
    Figure("mdtw_max", lambda result: result.mdtw.max),
    Figure("residual_rms", lambda result: result.residual.rms),
)


def figures_of(result: Result) -> dict[str, float]:
    """All of them that are numbers, by name."""
    values = {item.name: (int if item.whole else float)(item.of(result)) for item in FIGURES}
    return {name: value for name, value in values.items() if math.isfinite(value)}


@dataclass(frozen=True)
class Threshold:
    """A figure that may not be larger than a limit.

    Attributes:
        name: of the figure.
        limit: in its unit.
    """

    name: str
    limit: float

    @classmethod
    def parse(cls, text: str) -> Threshold:
        """From `max_deviation=0.01`.

        Raises:
            UsageError: there is no such figure, or no number.
        """
        name, _, limit = (part.strip() for part in text.partition("="))
        names = [item.name for item in FIGURES]
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
            raise UsageError(f"there is no figure {name!r}", hint)
        try:
            value = float(limit)
        except ValueError:
            value = math.nan
        if math.isnan(value):
            hint = f"write FIGURE=LIMIT, such as {name}=0.01 (metres, or a count)"
            raise UsageError(f"{limit!r} is not a number", hint)
        return cls(name, value)

    def exceeded(self, figures: dict[str, Any]) -> bool:
        """Whether a cloud's figure is above the limit; a cloud without figures does not count."""
        value = figures.get(self.name)
        return value is not None and bool(value > self.limit)
