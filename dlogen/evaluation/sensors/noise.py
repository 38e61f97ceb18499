"""What a sensor makes of an exact depth image: averaging, mixed pixels, correlated noise, steps and holes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dlogen.evaluation.sensors.models import Sensor
from dlogen.types import Array, BoolArray

#: Pixels on the object whose share of the window is less than this do not add more noise.
_LEAST_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class ExactView:
    """What the rays of a sensor meet, exactly.

    Attributes:
        tube: (height, width) depth of the object, metres; inf where a ray misses it.
        table: (height, width) depth of the table; inf where a ray misses it.
        cosine: (height, width) between ray and surface normal of the object; 0 where a ray misses it.
    """

    tube: Array
    table: Array
    cosine: Array

    @property
    def is_object(self) -> BoolArray:
        """(height, width) which pixels show the object."""
        shown: BoolArray = self.tube < self.table
        return shown


def smooth_noise(shape: tuple[int, ...], correlation: tuple[float, float], rng: np.random.Generator) -> Array:
    """A field of standard deviation 1 whose correlation falls to 1/e over so many pixels along rows and columns.

    The correlation between pixels a distance d apart is exp(-(d / correlation)^2).
    """
    field: Array = rng.standard_normal(shape)
    for axis, length in ((1, correlation[0]), (0, correlation[1])):
        if length > 0.0:
            reach = int(np.ceil(2.0 * length)) + 1
            kernel = np.exp(-2.0 * (np.arange(-reach, reach + 1) / length) ** 2)
            kernel /= np.sqrt((kernel**2).sum())
            field = ndimage.convolve1d(field, kernel, axis=axis, mode="wrap")
    return field


def measured(view: ExactView, sensor: Sensor, fields: list[Array]) -> Array:
    """The mean of the depths that the sensor gives in several frames.

    Args:
        view: what is there.
        sensor: which looks at it.
        fields: noise of each frame, of standard deviation 1, (height, width) each.

    Returns:
        (height, width) depth, metres, NaN where there is none.
    """
    mixed, share = _mixed(view, sensor)
    std = sensor.noise(mixed) * np.where(share > 0.0, np.maximum(share, _LEAST_SHARE) ** -sensor.support, 1.0)
    total = np.zeros_like(mixed)
    for field in fields:
        total += _rounded(mixed, std * field, sensor)
    depth: Array = total / len(fields)
    depth[view.is_object & (view.cosine < sensor.grazing)] = np.nan
    depth[~((depth >= sensor.nearest) & (depth <= sensor.farthest))] = np.nan
    if sensor.baseline:
        depth[_shadow(view, sensor)] = np.nan
    return depth


def _mixed(view: ExactView, sensor: Sensor) -> tuple[Array, Array]:
    """Depth without noise as averaging over the window gives it, and the object's share of each window."""
    shown = view.is_object
    if sensor.window == 1 and sensor.mixing == 0.0:
        return np.where(shown, view.tube, view.table), shown.astype(float)
    share = ndimage.uniform_filter(shown.astype(float), sensor.window, mode="constant")
    near = share > 1e-9
    tube = np.where(shown, view.tube, 0.0)
    mean = ndimage.uniform_filter(tube, sensor.window, mode="constant")
    weight = np.clip((share - sensor.threshold) / max(sensor.mixing, 1e-9) + 0.5, 0.0, 1.0)
    mixed = view.table.copy()
    table = view.table[near]
    # Where there is nothing behind the object there is nothing to mix with: the object's own depth.
    front = mean[near] / share[near]
    table = np.where(np.isfinite(table), table, front)
    mixed[near] = weight[near] * front + (1.0 - weight[near]) * table
    return mixed, np.where(weight > 0.0, share, 0.0)


def _rounded(depth: Array, error: Array, sensor: Sensor) -> Array:
    """Depth with its error, in the steps of the disparity and of the file."""
    if sensor.baseline:
        scale = sensor.focal[0] * sensor.baseline
        disparity = scale / depth - error * scale / depth**2
        if sensor.disparity_step:
            disparity = np.round(disparity / sensor.disparity_step) * sensor.disparity_step
        with np.errstate(divide="ignore"):
            depth = scale / disparity
    else:
        depth = depth + error
    if sensor.depth_unit:
        depth = np.round(depth / sensor.depth_unit) * sensor.depth_unit
    return depth


def _shadow(view: ExactView, sensor: Sensor) -> BoolArray:
    """Table beside the object that the second camera, or the projector, cannot see: to the left of it."""
    scale = sensor.focal[0] * sensor.baseline
    shown = view.is_object
    ahead = np.where(shown, scale / np.where(shown, view.tube, 1.0) - scale / view.table, 0.0)
    hidden = np.zeros(shown.shape, dtype=bool)
    for step in range(1, int(ahead.max(initial=0.0)) + 1):
        hidden[:, :-step] |= ahead[:, step:] >= step
    hidden &= ~shown
    return hidden


def holes(view: ExactView, share: float, size: float, rng: np.random.Generator) -> BoolArray:
    """Patches of the object that are lost, steep parts first, in a place that dark spots and thin parts may be.

    Args:
        view: what is there.
        share: of the object's pixels that are lost.
        size: of a patch, pixels.
        rng: decides where.
    """
    shown = view.is_object
    lost = np.zeros(shown.shape, dtype=bool)
    if share > 0.0 and shown.any():
        field = smooth_noise(shown.shape, (size, size), rng) - view.cosine
        lost[shown] = field[shown] >= np.quantile(field[shown], 1.0 - share)
    return lost
