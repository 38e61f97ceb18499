"""The numbers that a batch records of every cloud: metrics here, "figures" in messages and in the summary."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dlogen.errors import UsageError

if TYPE_CHECKING:
    from dlogen.types import FitData


@dataclass(frozen=True)
class Metric:
    """A number that a fit gives.

    Attributes:
        name: column in the records.
        of: takes it from a result; metres, counts.
        whole: whether it is a count.
    """

    name: str
    of: Callable[[FitData], Any]
    whole: bool = False


METRICS = (
    Metric("points", lambda result: result.provenance["points"], whole=True),
    Metric("length", lambda result: result.skeleton.length),
    Metric("radius", lambda result: result.chain.radius),
    Metric("segment_count", lambda result: len(result.chain.lengths), whole=True),
    Metric("segment_length", lambda result: result.joints.segment_length),
    Metric("last_segment_length", lambda result: result.joints.last_segment_length),
    Metric("e_max", lambda result: result.e_max),
    Metric("max_deviation", lambda result: result.max_deviation),
    Metric("mdtw_mean", lambda result: result.mdtw.mean),
    Metric("mdtw_std", lambda result: result.mdtw.std),
    Metric("mdtw_max", lambda result: result.mdtw.max),
    Metric("residual_rms", lambda result: result.residual.rms),
)


def metrics_of(result: FitData) -> dict[str, float]:
    """All of them that are numbers, by name."""
    values = {item.name: (int if item.whole else float)(item.of(result)) for item in METRICS}
    return {name: value for name, value in values.items() if math.isfinite(value)}


@dataclass(frozen=True)
class Threshold:
    """A metric that may not be larger than a limit.

    Attributes:
        name: of the metric.
        limit: in its unit.
    """

    name: str
    limit: float

    @classmethod
    def parse(cls, text: str) -> Threshold:
        """From `max_deviation=0.01`.

        Raises:
            UsageError: there is no such metric, or no number.
        """
        name, _, limit = (part.strip() for part in text.partition("="))
        names = [item.name for item in METRICS]
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

    def exceeded(self, metrics: dict[str, Any]) -> bool:
        """Whether a cloud's metric is above the limit; a cloud without metrics does not count."""
        value = metrics.get(self.name)
        return value is not None and bool(value > self.limit)
