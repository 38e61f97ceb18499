"""What the single fits say about the object, and which of them not to believe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dlogen.sequence.captures import CaptureFit
from dlogen.sequence.reasons import LENGTH, NOISE, RADIUS
from dlogen.types import Array, BoolArray

#: A capture is excluded when it is off the median by more than this many robust standard deviations.
_SIGMAS = 6.0

#: Median absolute deviation to standard deviation, for a normal distribution.
_MAD = 1.4826

#: Lengths, and radii, that scatter by more than this share are those of different objects.
_MOST_LENGTH, _MOST_RADIUS = 0.1, 0.5


@dataclass(frozen=True)
class Exclusion:
    """Why a capture is excluded.

    Attributes:
        code: "failed", "doubtful", "length", "radius", "noise" or "motion"; see `dlogen.sequence.reasons`.
        message: one sentence, with numbers.
    """

    code: str
    message: str


@dataclass(frozen=True)
class Size:
    """A quantity over the recording.

    Attributes:
        value: usual over the captures that are believed.
        allowed: largest distance to it.
        spread: robust standard deviation.
    """

    value: float
    allowed: float
    spread: float

    @property
    def agreed(self) -> bool:
        """Whether the captures scatter no more about the value than those of one object."""
        return _SIGMAS * self.spread <= self.allowed


@dataclass(frozen=True)
class Sizes:
    """What the captures have in common: length, radius and RMS residual, metres."""

    length: Size
    radius: Size
    residual: Size


def common_sizes(captures: Sequence[CaptureFit], use: BoolArray) -> Sizes:
    """Usual sizes of the captures in use, and how far from them a capture may be.

    They are medians. Lengths and radii that scatter by more than those of one object are of several, and the median
    may be that of none: then it is the median of the half that lies closest together.

    A capture may always be off by what does no harm, and never by so much that it is another object: its length by 1 %,
    or the radius if that is more, and at most by 10 %; its radius by 10 % and at most by half. Residuals are bounded
    above only, by twice the median or a tenth of the radius.

    Args:
        captures: F captures.
        use: (F,) captures to go by, one at least.
    """
    lengths, radii, residuals = (
        np.array([getattr(captures[k], name) for k in np.flatnonzero(use).tolist()])
        for name in ("length", "radius", "residual")
    )
    length, length_spread = _usual(lengths, _MOST_LENGTH)
    radius, radius_spread = _usual(radii, _MOST_RADIUS)
    residual, residual_spread = _usual(residuals, np.inf)
    return Sizes(
        _size(length, length_spread, max(radius, 0.01 * length), _MOST_LENGTH * length),
        _size(radius, radius_spread, 0.1 * radius, _MOST_RADIUS * radius),
        _size(residual, residual_spread, max(residual, 0.1 * radius), np.inf),
    )


def _usual(values: Array, most: float) -> tuple[float, float]:
    """The median and the robust standard deviation; of the shortest half if that is more than a share `most`.

    The shortest half (Andrews et al. 1972) is the interval with half of the values that is the least wide; of a normal
    distribution it is as wide as two median absolute deviations.
    """
    middle = float(np.median(values))
    spread = _MAD * float(np.median(np.abs(values - middle)))
    half = (len(values) + 1) // 2
    if _SIGMAS * spread <= most * middle or half < 2:
        return middle, spread
    ordered = np.sort(values)
    widths = ordered[half - 1 :] - ordered[: len(values) - half + 1]
    first = int(np.argmin(widths))
    return float(np.median(ordered[first : first + half])), 0.5 * _MAD * float(widths[first])


def _size(value: float, spread: float, least: float, most: float) -> Size:
    return Size(value, min(max(_SIGMAS * spread, least), most), spread)


def exclusion_by_size(capture: CaptureFit, sizes: Sizes) -> Exclusion | None:
    """Why not to believe a capture that has a curve and a good verdict, going by the sizes alone."""
    for reason, what, size, value in (
        (LENGTH, "long", sizes.length, capture.length),
        (RADIUS, "in radius", sizes.radius, capture.radius),
    ):
        if abs(value - size.value) > size.allowed:
            return Exclusion(
                reason.code,
                f"{1e3 * value:.1f} mm {what}, usual are {1e3 * size.value:.1f} (allowed +-{1e3 * size.allowed:.1f})",
            )
    if capture.residual > sizes.residual.value + sizes.residual.allowed:
        return Exclusion(
            NOISE.code,
            f"its points scatter by {1e3 * capture.residual:.2f} mm, usually by "
            f"{1e3 * sizes.residual.value:.2f} (allowed {1e3 * (sizes.residual.value + sizes.residual.allowed):.2f})",
        )
    return None
