"""What a sensor makes of an exact depth image: averaging, mixed pixels, correlated noise, steps, holes, a mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dlogen.evaluation.sensors.models import Sensor
from dlogen.types import Array, BoolArray

#: The noise is averaged over at least this share of the pixels that it would be averaged over on a plane.
_LEAST_SHARE = 0.05


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

    def without_object(self) -> ExactView:
        """The same place when the object is gone."""
        return ExactView(np.full_like(self.tube, np.inf), self.table, np.zeros_like(self.cosine))


def smooth_noise(white: Array, correlation: float, where: BoolArray | None = None) -> tuple[Array, Array]:
    """Noise of standard deviation 1 whose correlation at a distance of d pixels is exp(-(d / correlation)^2).

    Args:
        white: (height, width) independent numbers of standard deviation 1.
        correlation: pixels; 0 for none.
        where: pixels that are averaged over; None for all.

    Returns:
        The noise, and the share of the averaged pixels that `where` has, (height, width) each.
    """
    if correlation <= 0.0:
        return white, np.ones_like(white)
    offsets = np.arange(-int(np.ceil(2.0 * correlation)), int(np.ceil(2.0 * correlation)) + 1)
    kernel = np.exp(-2.0 * (offsets / correlation) ** 2)
    kernel /= np.sqrt((kernel**2).sum())

    def averaged(image: Array, weights: Array) -> Array:
        for axis in (0, 1):
            image = ndimage.convolve1d(image, weights, axis=axis, mode="constant" if where is not None else "wrap")
        return image

    if where is None:
        return averaged(white, kernel), np.ones_like(white)
    share = np.maximum(averaged(where.astype(float), kernel**2), _LEAST_SHARE)
    return averaged(np.where(where, white, 0.0), kernel) / np.sqrt(share), share


def measured(view: ExactView, sensor: Sensor, rng: np.random.Generator, frames: int = 1) -> Array:
    """The mean of the depths that the sensor gives in several frames.

    Args:
        view: what is there.
        sensor: which looks at it.
        rng: generator of the noise.
        frames: their number.

    Returns:
        (height, width) depth, metres, NaN where there is none.
    """
    shape = view.tube.shape
    object_depth, weight = _mixing(view, sensor, rng)
    fixed = rng.standard_normal(shape) if sensor.fixed and frames > 1 else None
    on_object = weight > 0.0
    total = np.zeros(shape)
    for _ in range(frames):
        white = rng.standard_normal(shape)
        if fixed is not None:
            white = np.sqrt(1.0 - sensor.fixed) * white + np.sqrt(sensor.fixed) * fixed
        depth = np.where(np.isfinite(view.table), view.table, np.nan)
        noise, _ = smooth_noise(white, sensor.correlation)
        depth += sensor.noise(depth) * noise
        if on_object.any():
            noise, share = smooth_noise(white, sensor.correlation, view.is_object)
            front = object_depth[on_object]
            front = front + sensor.plain * sensor.noise(front) * (noise / np.sqrt(share))[on_object]
            behind, w = depth[on_object], weight[on_object]
            # Where there is nothing behind the object there is nothing to mix with.
            depth[on_object] = np.where(np.isfinite(behind), w * front + (1.0 - w) * behind, front)
        total += _rounded(depth, sensor)
    depth = total / frames
    depth[view.is_object & (view.cosine < sensor.grazing)] = np.nan
    depth[~((depth >= sensor.nearest) & (depth <= sensor.farthest))] = np.nan
    if sensor.baseline:
        depth[_shadow(view, sensor)] = np.nan
    return depth


def _mixing(view: ExactView, sensor: Sensor, rng: np.random.Generator) -> tuple[Array, Array]:
    """Mean depth of the object in the window around each pixel, and the weight that the pixel gives to it, 0 to 1."""
    shown = view.is_object
    if sensor.window == 1:
        return view.tube, shown.astype(float)
    share = ndimage.uniform_filter(shown.astype(float), sensor.window, mode="constant")
    total = ndimage.uniform_filter(np.where(shown, view.tube, 0.0), sensor.window, mode="constant")
    near = share > 1e-9
    mean = np.divide(total, share, out=np.zeros_like(total), where=near)
    threshold = np.full_like(share, sensor.threshold)
    if sensor.threshold_std:
        threshold += sensor.threshold_std * smooth_noise(rng.standard_normal(share.shape), sensor.window)[0]
    weight = np.clip((share - threshold) / max(sensor.mixing, 1e-9) + 0.5, 0.0, 1.0)
    return mean, np.where(near, weight, 0.0)


def _rounded(depth: Array, sensor: Sensor) -> Array:
    """Depth in the steps of the disparity and of the file."""
    if sensor.disparity_step:
        scale = sensor.focal[0] * sensor.baseline / sensor.disparity_step
        with np.errstate(divide="ignore"):
            depth = scale / np.round(scale / depth)
    if sensor.depth_unit:
        depth = np.round(depth / sensor.depth_unit) * sensor.depth_unit
    return depth


def _shadow(view: ExactView, sensor: Sensor) -> BoolArray:
    """Table to the left of the object, which hides it from the second camera or the projector."""
    scale = sensor.focal[0] * sensor.baseline
    shown = view.is_object
    ahead = np.where(shown, scale / np.where(shown, view.tube, 1.0) - scale / view.table, 0.0)
    hidden = np.zeros(shown.shape, dtype=bool)
    for step in range(1, int(ahead.max(initial=0.0)) + 1):
        hidden[:, :-step] |= ahead[:, step:] >= step
    return hidden & ~shown


def hole_pattern(view: ExactView, share: float, size: float, rng: np.random.Generator, window: int = 1) -> BoolArray:
    """Patches of the object that are lost, as on dark spots; steep parts first.

    Args:
        view: what is there.
        share: of the object's pixels that are lost, 0 to 1.
        size: of a patch, pixels.
        rng: decides where.
        window: beside a patch, what lies within half of this many pixels is lost, too: its depth came from the object.

    Returns:
        (height, width).
    """
    shown = view.is_object
    lost = np.zeros(shown.shape, dtype=bool)
    if share > 0.0 and shown.any():
        field, _ = smooth_noise(rng.standard_normal(shown.shape), size)
        weakness = (field - view.cosine)[shown]
        lost[shown] = weakness >= np.quantile(weakness, 1.0 - share)
        lost |= (ndimage.maximum_filter(lost, window) > 0) & ~shown
    return lost


def grown_mask(shown: BoolArray, grow: float, edge: float, rng: np.random.Generator) -> BoolArray:
    """The pixels of a mask whose edge is `grow` pixels outside of the object's, give or take.

    Args:
        shown: (height, width) pixels of the object.
        grow: pixels; negative for a narrower mask.
        edge: standard deviation of where the mask's edge is, pixels; it wanders over some ten pixels.
        rng: decides where.
    """
    if (grow == 0.0 and edge == 0.0) or not shown.any():
        return shown
    margin = int(np.ceil(abs(grow) + 5.0 * edge)) + 2
    rows, columns = (np.flatnonzero(shown.any(axis=axis)) for axis in (1, 0))
    box = tuple(slice(max(i[0] - margin, 0), i[-1] + margin + 1) for i in (rows, columns))
    part = np.pad(shown[box], 1)
    # Distance to the edge, negative inside; the edge is half a pixel from the middle of the pixels at it.
    outside = ndimage.distance_transform_edt(~part) - ndimage.distance_transform_edt(part)
    outside = (outside - 0.5 * np.sign(outside))[1:-1, 1:-1]
    limit = np.full(outside.shape, float(grow))
    if edge:
        limit += edge * smooth_noise(rng.standard_normal(outside.shape), 15.0)[0]
    mask = np.zeros_like(shown)
    mask[box] = outside < limit
    return mask
