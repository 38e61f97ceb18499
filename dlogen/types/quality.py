"""Errors and findings: how far a chain can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dlogen.types.arrays import Array, IntArray
from dlogen.types.short_repr import ShortRepr


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

    Attributes:
        code: stable identifier, for scripts ("gap", "closed-ring", ...).
        message: one sentence.
        severity: "note" leaves the verdict alone, "doubtful" and "bad" lower it.
        s: material coordinate that it is at, if any.
        position: place in space, metres, if any.
    """

    code: str
    message: str
    severity: str = "doubtful"
    s: float | None = None
    position: tuple[float, float, float] | None = None

    def to_dict(self) -> dict[str, Any]:
        """As it stands in the JSON files; absent places are left out."""
        out: dict[str, Any] = {"code": self.code, "message": self.message, "severity": self.severity}
        if self.s is not None:
            out["s"] = self.s
        if self.position is not None:
            out["position"] = list(self.position)
        return out


@dataclass(frozen=True)
class Quality:
    """How far the chain can be trusted: the worst severity among the findings."""

    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """ "good", "doubtful" or "bad"."""
        severities = {finding.severity for finding in self.findings}
        return "bad" if "bad" in severities else "doubtful" if "doubtful" in severities else "good"


@dataclass(frozen=True)
class Residual:
    """Distance of the cloud's points to the surface of the tube around the skeleton line, metres."""

    rms: float
    median: float
    radius: float
