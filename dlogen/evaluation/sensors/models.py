"""The sensors that can be simulated: optics, noise and what they do at edges, with the source of each figure.

Triangulating sensors (stereo and projected patterns) measure a disparity d = f B / Z, so that a depth has f B / Z^2 times
less noise than the disparity has, and neighbouring pixels share most of the window that is matched around them. Those
that measure a time or a phase (ToF) have a noise that grows slowly with distance, and pixels at an edge that mix what
is before and behind it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dlogen.types import Array


@dataclass(frozen=True)
class Sensor:
    """A sensor that looks along a grid of rays from one point; x right, y down, z forward (REP 103).

    Lengths are metres, pixels are those of the depth image unless said otherwise.

    Attributes:
        name: what the user calls it.
        width, height: of the image; 0 for a scanner, which goes on until it has seen the object.
        focal: focal length in pixels, of columns and rows; for a scanner one over the angle between rays.
        usual: distance from the sensor to the table if the user gives none.
        nearest, farthest: depths that are measured.
        pitch: distance of points along a scan line and between scan lines on the table, for a scanner that is moved;
            the focal lengths follow from it and the distance.
        baseline: of a triangulating sensor; 0 for others.
        disparity_std: standard deviation of the disparity on a plane, pixels, rounding included.
        disparity_step: of the rounded disparity, pixels.
        depth_std: (c0, c1, c2): standard deviation c0 + c1 Z + c2 Z^2 of the depth where there is no baseline.
        depth_unit: the depth is stored in multiples of it; 0 for none.
        correlation: distance at which the correlation of the noise has fallen to 1/e, pixels along rows and columns; 0
            for pixels that are independent.
        window: side of the square over which matching (or the beam, or the optics) averages, pixels.
        threshold: share of the window that must show the object for a pixel to take the object's depth; below one half
            the object is seen wider than it is (foreground fattening).
        mixing: range of that share over which depths lie between object and table (mixed or flying pixels).
        support: exponent of that share with which noise grows on the object: a narrow object fills little of the window.
        grazing: smallest cosine between ray and surface normal that still gives a depth.
        fixed: share of the noise's variance that is the same in all frames.
        colour_focal: focal length of the colour image, pixels, if depth is given in the pixels of the colour image.
    """

    name: str
    width: int
    height: int
    focal: tuple[float, float]
    usual: float
    nearest: float
    farthest: float
    pitch: tuple[float, float] | None = None
    baseline: float = 0.0
    disparity_std: float = 0.0
    disparity_step: float = 0.0
    depth_std: tuple[float, float, float] = (0.0, 0.0, 0.0)
    depth_unit: float = 0.0
    correlation: tuple[float, float] = (0.0, 0.0)
    window: int = 1
    threshold: float = 0.5
    mixing: float = 0.0
    support: float = 0.0
    grazing: float = 0.1
    fixed: float = 0.0
    colour_focal: float = 0.0

    @property
    def scans(self) -> bool:
        """Whether the image is as large as the object needs."""
        return self.width == 0

    def noise(self, depth: Array) -> Array:
        """Standard deviation of the depth on a plane at these depths, metres, before the depth is rounded."""
        if self.baseline:
            return self.disparity_std * depth**2 / (self.focal[0] * self.baseline)
        c0, c1, c2 = self.depth_std
        return c0 + c1 * depth + c2 * depth**2

    def rays(self) -> Array:
        """(height, width, 3) directions of the pixels with z = 1."""
        x = (np.arange(self.width) - 0.5 * (self.width - 1)) / self.focal[0]
        y = (np.arange(self.height) - 0.5 * (self.height - 1)) / self.focal[1]
        grid = np.meshgrid(x, y)
        return np.stack([*grid, np.ones_like(grid[0])], axis=-1)

    def colour_grid(self) -> Sensor:
        """The same place with the pixels of the colour image."""
        return replace(self, focal=(self.colour_focal, self.colour_focal)) if self.colour_focal else self


REALSENSE_D435 = Sensor(
    "realsense-d435",
    1280,
    720,
    (640.0, 640.0),
    usual=0.5,
    nearest=0.28,
    farthest=10.0,
    baseline=0.05,
    disparity_std=0.08,
    disparity_step=1.0 / 32.0,
    depth_unit=0.001,
    correlation=(8.0, 8.0),
    window=7,
    threshold=0.35,
    mixing=0.15,
    support=0.5,
    grazing=0.15,
    fixed=0.5,
    colour_focal=918.0,
)

SENSORS = {sensor.name: sensor for sensor in (REALSENSE_D435,)}
