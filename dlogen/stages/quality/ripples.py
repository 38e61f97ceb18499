"""Whether the radius goes up and down regularly along an object, as that of a corrugated hose does."""

from __future__ import annotations

import numpy as np

from dlogen.stages.quality.findings import RADIUS_VARIES
from dlogen.types import Array, Finding, Skeleton
from dlogen.types.texts import millimetres

#: Bins of the radius along the line in one radius of length, and points that each needs on average.
_BINS, _PER_BIN = 8.0, 4.0

#: Ripples that are worth a note: their height over the radius, how much of the variation of the radius they are, and
#: how many of them there are at least.
_HIGH, _REGULAR, _FEWEST = 0.03, 0.5, 8


def check_ripples(line: Skeleton, radius: float, s: Array, residual: Array) -> list[Finding]:
    """A note about a radius that varies periodically; the model has the mean of it.

    Args:
        line: the skeleton line.
        radius: of the object, metres.
        s: (K,) foot coordinates of the points of the tube.
        residual: (K,) their distances to its surface, metres.
    """
    count = min(int(_BINS * line.length / radius), int(len(s) / _PER_BIN))
    if count < 4 * _FEWEST:
        return []
    place = np.minimum((s * count).astype(np.intp), count - 1)
    number = np.bincount(place, minlength=count)
    mean = np.bincount(place, residual, count) / np.maximum(number, 1)
    mean[number > 0] -= mean[number > 0].mean()
    power = np.abs(np.fft.rfft(mean)) ** 2
    power[: _FEWEST // 2] = 0.0
    peak = int(np.argmax(power))
    # A ripple whose length is not a whole part of the object's is spread over neighbours.
    near = power[max(peak - 2, 0) : peak + 3].sum()
    height = float(np.sqrt(4.0 * near)) / count
    if peak < _FEWEST or near < _REGULAR * power.sum() or height < _HIGH * radius:
        return []
    text = (
        f"the radius goes up and down by {100.0 * height / radius:.0f} % every {millimetres(line.length / peak)}: the "
        "object is corrugated, and the model has the mean radius"
    )
    return [RADIUS_VARIES.found(text, "note")]
