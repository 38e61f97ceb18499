"""What a cloud goes through before any stage: refusals, units, the place that it is moved to."""

from __future__ import annotations

import numpy as np

from dlogen.errors import FitError
from dlogen.types import Array, BoolArray

#: Fewer points than this cannot show a tube; the paper works with 5,000.
MIN_POINTS = 12


#: Extents of clouds, in whatever units, that can be those of an object.
_POSSIBLE = (1e-9, 1e9)


#: Points so many extents of the rest away from it mark missing data, and how many points tell the extent.
_FAR_AWAY, _TELLING = 1000.0, 10_000


def check_points(points: Array, *, surface: bool = True) -> None:
    """Refuse clouds from which no chain can be made.

    Args:
        points: (M, 3) finite points, any units.
        surface: whether the points are those of a surface, so that a flat cloud makes no sense.

    Raises:
        FitError: too few points, all in one place, flat, or pixel coordinates.
    """
    if len(points) < MIN_POINTS:
        raise FitError(
            f"{len(points)} points are too few: at least {MIN_POINTS} are needed",
            "a few hundred points along the object are a good start",
            stage="input",
        )
    extent = np.ptp(points, axis=0)
    size = float(extent.max())
    # What is left of double precision at these coordinates.
    noise_floor = 1e-12 * max(float(np.abs(points).max()), 1e-300)
    if size <= 10.0 * noise_floor:
        raise FitError(f"all {len(points)} points are in one place", "check how the cloud was written", stage="input")
    if not _POSSIBLE[0] <= size <= _POSSIBLE[1]:
        raise FitError(
            f"the cloud is {size:.2g} large, which no object is in metres, centimetres or millimetres",
            "check how the cloud was written",
            stage="input",
        )
    flat = extent <= max(1e-9 * size, 10.0 * noise_floor)
    if flat.any() and surface:
        axis = "xyz"[int(np.argmax(flat))]
        whole = np.all(points[:: max(1, len(points) // 1000)] % 1.0 == 0.0)
        if whole:
            raise FitError(
                f"the points look like two-dimensional pixel data: whole numbers, {axis} the same for all",
                "convert the depth image to metric 3-D points first",
                stage="input",
            )
        raise FitError(
            f"the cloud is flat: {axis} is the same for all points",
            "points on the surface are needed; for points on the centre line set profile to paper, "
            "projection.enabled to false, and give r",
            stage="input",
        )


def far_away(points: Array) -> BoolArray:
    """(M,) which points are so far from all others that they mark missing data, as 1e10 or the largest float do.

    Args:
        points: (M, 3) finite points, any units.
    """
    none = np.zeros(len(points), dtype=bool)
    if len(points) < MIN_POINTS:
        return none
    low, middle, high = np.quantile(points[:: -(-len(points) // _TELLING)], [0.05, 0.5, 0.95], axis=0)
    reach = _FAR_AWAY * float((high - low).max())
    lowest, highest = points.min(axis=0), points.max(axis=0)
    if reach == 0.0 or ((lowest > middle - reach) & (highest < middle + reach)).all():
        return none
    result: BoolArray = (np.abs(points - middle) > reach).any(axis=1)
    return result
