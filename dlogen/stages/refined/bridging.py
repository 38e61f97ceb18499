"""What a user knows of the pieces of a cloud: how far gaps may be bridged, and how long the object is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from dlogen.config.fields import AUTO, given
from dlogen.config.schema import Config
from dlogen.stages.quality.findings import END_NOT_SEEN, GAP
from dlogen.types import Finding

_Way = TypeVar("_Way")

#: A line is as long as it is known to be within this share.
_FITS = 0.03

#: A gap is wider by its ends, which are found to about this share of it, than a user measures it.
_ROOM = 1.1

#: A finding belongs to a gap of the line if it is no farther from it than this, in s.
_BESIDE = 0.03


@dataclass(frozen=True)
class Bridging:
    """Which gaps belong to the object, as far as its user says so.

    Attributes:
        longest: gaps up to this length are bridged however large a share of the object they are, metres; infinite if
            all pieces belong together, 0 if nothing is said.
        length: of the object, metres; None if it is not known.
    """

    longest: float = 0.0
    length: float | None = None

    @staticmethod
    def of(config: Config) -> Bridging:
        """What the configuration says."""
        bridge = config.bridge
        longest = bridge if not isinstance(bridge, str) else 0.0 if bridge == AUTO else float("inf")
        return Bridging(longest, given(config.length))

    @property
    def reach(self) -> float:
        """The widest gap that is bridged because it was asked for, as it is measured between pieces, metres."""
        return _ROOM * self.longest

    def best(self, ways: Iterable[_Way], length_of: Callable[[_Way], float]) -> _Way:
        """The first way to join pieces whose line is as long as the object; the first of all if none is.

        Args:
            ways: from the likeliest to the least likely.
            length_of: the length of the line of a way, metres.
        """
        ways = iter(ways)
        first = next(ways)
        if self.length is None or self.fits(length_of(first)):
            return first
        return next((way for way in ways if self.fits(length_of(way))), first)

    def fits(self, length: float) -> bool:
        """Whether the object is known to be so long, metres."""
        return self.length is not None and abs(length - self.length) <= _FITS * self.length

    def about(self, findings: Sequence[Finding], gaps: Sequence[tuple[float, float]], length: float) -> list[Finding]:
        """Findings in which gaps that were to be bridged are notes, and so are all gaps and ends if the length fits.

        Args:
            findings: about a line.
            gaps: (s0, s1) of its stretches without points.
            length: of the line, metres.
        """
        fits = self.fits(length)
        asked = [(low, high) for low, high in gaps if fits or (high - low) * length <= self.reach]
        return [
            replace(item, severity="note")
            if (GAP.matches(item) and _is_in(item, asked)) or (END_NOT_SEEN.matches(item) and fits)
            else item
            for item in findings
        ]


def _is_in(finding: Finding, gaps: Sequence[tuple[float, float]]) -> bool:
    return any(finding.s is not None and low - _BESIDE < finding.s < high + _BESIDE for low, high in gaps)
