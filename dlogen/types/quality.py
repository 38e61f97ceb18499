"""Errors and findings: how far a chain can be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from dlogen.types.arrays import Array, IntArray
from dlogen.types.short_repr import ShortRepr

#: How serious a finding is: a note leaves the verdict alone, the others lower it.
Severity = Literal["note", "doubtful", "bad"]
#: From the mildest to the gravest.
SEVERITIES: tuple[Severity, ...] = get_args(Severity)

#: What is said of a chain as a whole.
Verdict = Literal["good", "doubtful", "bad"]


@dataclass(frozen=True, eq=False, repr=False)
class Mdtw(ShortRepr):
    """The modified dynamic time warping error between two sampled curves (paper IV.A, Eq. 21-22).

    Attributes:
        error: (K,) distance of each pair of the warping path, metres.
        path: (K, 2) indices of the pairs, from (0, 0) to (H - 1, G - 1).
        s: (K,) coordinate of the pair's point on the first curve, in [0, 1].
        mean, std, max: of the error, metres; std with K - 1.
    """

    error: Array
    path: IntArray
    s: Array
    mean: float
    std: float
    max: float


@dataclass(frozen=True)
class Finding:
    """Something about the cloud or the chain that a user should know.

    The kinds that there are, what they mean and what to do about them stand in `dlogen.stages.quality.findings`, which
    makes the findings.

    Attributes:
        code: stable identifier of the kind, for scripts ("gap", "closed-ring", ...).
        message: one sentence.
        severity: "note" leaves the verdict alone, "doubtful" and "bad" lower it.
        s: material coordinate that it is at, if any.
        position: place in space, metres, if any.

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("straight", points=4000, gaps=[(0.4, 0.5)], seed=1).points)
    >>> [(finding.code, finding.severity) for finding in result.quality.findings]
    [('gap', 'doubtful')]
    """

    code: str
    message: str
    severity: Severity = "doubtful"
    s: float | None = None
    position: tuple[float, float, float] | None = None

    @property
    def is_note(self) -> bool:
        """Whether it leaves the verdict alone."""
        return self.severity == "note"

    @property
    def is_bad(self) -> bool:
        """Whether the chain cannot be used because of it."""
        return self.severity == "bad"

    @property
    def gravity(self) -> int:
        """The place of its severity among all, from 0, the mildest."""
        return SEVERITIES.index(self.severity)

    def to_dict(self) -> dict[str, Any]:
        """As it stands in the JSON files; absent places are left out."""
        out: dict[str, Any] = {"code": self.code, "message": self.message, "severity": self.severity}
        if self.s is not None:
            out["s"] = self.s
        if self.position is not None:
            out["position"] = list(self.position)
        return out

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Finding:
        """From what `to_dict` gives."""
        position = data.get("position")
        return cls(
            data["code"],
            data["message"],
            data["severity"],
            data.get("s"),
            None if position is None else (position[0], position[1], position[2]),
        )


@dataclass(frozen=True)
class Quality:
    """How far the chain can be trusted: the gravest severity among the findings."""

    findings: tuple[Finding, ...] = ()

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that lower the verdict: all but the notes."""
        return tuple(finding for finding in self.findings if not finding.is_note)

    @property
    def verdict(self) -> Verdict:
        """ "good", "doubtful" or "bad"."""
        if self.is_good:
            return "good"
        return "bad" if self.is_bad else "doubtful"

    @property
    def is_good(self) -> bool:
        """Whether no finding lowers the verdict."""
        return not self.warnings

    @property
    def is_bad(self) -> bool:
        """Whether the chain cannot be used."""
        return any(finding.is_bad for finding in self.findings)


@dataclass(frozen=True)
class Residual:
    """Distance of the cloud's points to the surface of the tube around the skeleton line, metres."""

    rms: float
    median: float
    radius: float


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(ShortRepr):
    """How well a line is known, as far as the noise of its points tells: standard deviations.

    Attributes:
        s: (K,) places on the line, from 0 to 1, even in arc length.
        position: (K,) of the axis, in the direction across it in which it is known the least, metres.
        curvature: (K,) of the curvature, 1/m.
        radius: of the radius, metres; 0 for a given one, infinite where the points do not tell.
    """

    s: Array
    position: Array
    curvature: Array
    radius: float
