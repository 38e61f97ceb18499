"""What a cloud goes through before any stage: refusals, units, the place that it is moved to.

`dlogen.fit` and `dlogen info` prepare a cloud in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dlogen.config.fields import AUTO
from dlogen.errors import ConfigError, FitError
from dlogen.geometry.sampling import thinned
from dlogen.geometry.units import METRES, guess_units
from dlogen.stages.quality.findings import STRAY_POINTS
from dlogen.types import Array, BoolArray, Cloud, Finding

#: Fewer points than this cannot show a tube; the paper works with 5,000.
MIN_POINTS = 12

#: Of larger clouds this many points are used: with the noise of any sensor more do not change the line.
MOST_POINTS = 2_000_000

#: Extents of clouds, in whatever units, that can be those of an object.
_POSSIBLE = (1e-9, 1e9)

#: Points so many extents of the rest away from it mark missing data, and how many points tell the extent.
_FAR_AWAY, _TELLING = 1000.0, 10_000


@dataclass(frozen=True, eq=False)
class Prepared:
    """A cloud as the stages take it: near the origin, in metres.

    Attributes:
        cloud: points, normals and viewpoint, in metres relative to `centre`.
        centre: (3,) the middle of the cloud's extent, in the cloud's own frame, metres.
        low, high: (3,) smallest and largest coordinates, in the cloud's own frame, metres.
        extent: (3,) from the one to the other, metres.
        units: what the numbers were: a key of `METRES`.
        scale: metres in one of them.
    """

    cloud: Cloud
    centre: Array
    low: Array
    high: Array
    extent: Array
    units: str
    scale: float


def without_far_points(cloud: Cloud) -> tuple[Cloud, int]:
    """The cloud without the points that mark missing data (`far_away`), and how many those were."""
    far = far_away(cloud.points)
    if not far.any():
        return cloud, 0
    near = np.flatnonzero(~far)
    normals = None if cloud.normals is None else cloud.normals[near]
    return replace(cloud, points=cloud.points[near], normals=normals), int(far.sum())


def prepare(cloud: Cloud, units: str = AUTO) -> Prepared:
    """Bring a cloud to metres and near to the origin: survey coordinates of 5e6 m would cost the stages nine digits.

    Of more than two million points a part is used, the same in whatever order they come.

    Args:
        cloud: without points far away.
        units: of its numbers; "auto" guesses them from the extent.
    """
    units = guess_units(cloud.points) if units == AUTO else units
    scale = METRES[units]
    low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
    centre = 0.5 * (low + high)
    used = thinned(cloud.points, MOST_POINTS) if len(cloud) > MOST_POINTS else slice(None)
    near = replace(
        cloud,
        points=(cloud.points[used] - centre) * scale,
        normals=None if cloud.normals is None else cloud.normals[used],
        viewpoint=None if cloud.viewpoint is None else (cloud.viewpoint - centre) * scale,
    )
    return Prepared(near, centre * scale, low * scale, high * scale, (high - low) * scale, units, scale)


def check_left_out(count: int) -> list[Finding]:
    """What to say of so many points that mark missing data."""
    if count == 0:
        return []
    message = f"left out {count} point{'s' if count > 1 else ''} very far from all others: missing data, it seems"
    return [STRAY_POINTS.found(message, "note")]


def check_given_radius(points: Array, radius: float | None) -> None:
    """Refuse a radius that cannot be that of this cloud; mostly it was given in the cloud's units.

    Args:
        points: (M, 3) metres.
        radius: the given one, metres, if there is one.

    Raises:
        ConfigError: the diameter is more than the whole cloud.
    """
    extent = float(np.ptp(points, axis=0).max())
    if radius is not None and 2.0 * radius > extent:
        raise ConfigError(
            f"the diameter 2 r = {2.0 * radius:g} m is more than the whole cloud, which is {extent:.4g} m large",
            "r is in metres whatever the cloud's units are; units says what those are",
        )


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
