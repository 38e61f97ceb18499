"""What the cloud's numbers are. Everything behind the reading is in metres."""

from __future__ import annotations

import numpy as np

from dlogen.types import Array

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}

#: Cables that people scan are shorter than this; numbers beyond it are no metres.
_LONGEST = 20.0


def guess_units(points: Array) -> str:
    """A guess at the units from the extent: metres up to 20, centimetres up to 100, millimetres beyond.

    The bands overlap in truth (a cable of 15 mm exists), so this is used on request only (`units: auto`).

    Args:
        points: (M, 3) the cloud's numbers.

    Returns:
        "m", "cm" or "mm".
    """
    extent = float(np.max(np.ptp(points, axis=0)))
    return "m" if extent <= _LONGEST else "cm" if extent <= 100.0 else "mm"
