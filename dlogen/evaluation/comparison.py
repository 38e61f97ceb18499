"""How two curves differ."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from dlogen.config.defaults import MDTW_SAMPLES
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import arc_lengths, hausdorff, resample
from dlogen.io.report import mdtw_dict


def compare(
    a: npt.ArrayLike, b: npt.ArrayLike, samples: int = MDTW_SAMPLES, *, align_direction: bool = True
) -> dict[str, Any]:
    """How two polylines differ: MDTW between samples of both, even in arc length and of the same number.

    Args:
        a: (K, 3) vertices of the first one, metres.
        b: (L, 3) vertices of the second one, metres.
        samples: points on each, at least 2. The paper takes 1000.
        align_direction: take `b` in the direction that gives the smaller mean error, since a scanned object has no
            preferred end; otherwise in the order of its vertices.

    Returns:
        What JSON files hold of it, in metres: `samples`, `reversed` (whether `b` was taken from its end to its start),
        `hausdorff`, `length_a`, `length_b`, `length_difference` (a less b), and all of
        `dlogen.io.report.mdtw_dict`.

    Raises:
        ValueError: wrong shapes, no points, coordinates that are not finite, or fewer than 2 samples.

    >>> import dlogen
    >>> found = dlogen.compare([[0, 0, 0], [1, 0, 0]], [[1, 0.01, 0], [0, 0.01, 0]], samples=50)
    >>> round(found["mean"], 6), found["reversed"]
    (0.01, True)
    """
    first, second = resample(a, samples), resample(b, samples)
    error = mdtw(first, second)
    backwards = mdtw(first, second[::-1]) if align_direction else error
    is_reversed = backwards.mean < error.mean
    length_a, length_b = (float(arc_lengths(points)[-1]) for points in (a, b))
    return {
        "samples": samples,
        "reversed": is_reversed,
        "hausdorff": hausdorff(a, b),
        "length_a": length_a,
        "length_b": length_b,
        "length_difference": length_a - length_b,
        **mdtw_dict(backwards if is_reversed else error),
    }
