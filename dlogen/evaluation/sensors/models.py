"""The sensors that can be simulated: optics, noise and what they do at edges, with the source of each figure.

Sensors that triangulate (stereo, projected patterns) measure a disparity d = f B / Z: noise of the disparity becomes
Z^2 / (f B) times as much in the depth, and neighbouring pixels share most of the window that is matched around them.
Those that measure a time or a phase have a noise that grows slowly with distance, and pixels at an edge that mix what
is before and behind it.

Published figures are of flat, bright, textured targets, rounded here to what differs between specimens. Where a paper
gives a plot only, the polynomial goes through what it shows. Windows, thresholds and grazing angles are given by few
sources and are of the right size, no more; those of `realsense-d435` were set so that simulated frames agree with real
ones of a rope (tests/tools/sensor_check.py). Not simulated: lens distortion, bias with distance or temperature,
multiple reflections, motion.
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
        baseline: of a sensor that triangulates; 0 for others.
        disparity_std: standard deviation of the disparity on a plane, pixels, without that of rounding.
        disparity_step: of the rounded disparity, pixels; 0 for none.
        depth_std: (c0, c1, c2): standard deviation c0 + c1 Z + c2 Z^2 of the depth where there is no baseline.
        depth_unit: the depth is stored in multiples of it; 0 for none.
        correlation: distance at which the correlation of the noise has fallen to 1/e, pixels; 0 for pixels that are
            independent. On the object the noise is averaged over its own pixels only, so that a narrow one has more.
        plain: factor of the noise on the object, which has less texture than the plane that was measured.
        window: side of the square over which matching (or the beam, or the optics) mixes depths, pixels; odd.
        threshold: share of the window that must show the object for a pixel to take the object's depth; below one half
            the object is seen wider than it is (foreground fattening).
        threshold_std: by how much that share differs from place to place: patches of the object get the table's depth.
        mixing: range of that share over which depths lie between object and table (mixed or flying pixels).
        grazing: smallest cosine between ray and surface normal that still gives a depth.
        fixed: share of the noise's variance that is the same in all frames.
        mask_edge: by how much the edge of a mask wanders from the object's, pixels; standard deviation.
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
    correlation: float = 0.0
    plain: float = 1.0
    window: int = 1
    threshold: float = 0.5
    threshold_std: float = 0.0
    mixing: float = 0.0
    grazing: float = 0.1
    fixed: float = 0.0
    mask_edge: float = 0.0
    colour_focal: float = 0.0

    @property
    def scans(self) -> bool:
        """Whether the image is as large as the object needs."""
        return self.width == 0

    def noise(self, depth: Array) -> Array:
        """Standard deviation of the depth on a plane at these depths, metres, without that of rounding."""
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
        """The same place with the pixels of the colour image; itself if depth stays in its own pixels."""
        return replace(self, focal=(self.colour_focal, self.colour_focal)) if self.colour_focal else self


# Khoshelham and Elberink (2012), "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping Applications",
# Sensors 12(2): 1 / Z in steps of 2.85e-3 1/m, an eighth of a pixel with f = 585 and B = 0.075; disparity of half a
# step, 1.425e-3 Z^2, rounding included, which has 0.29 of it. Nguyen, Izadi and Lovell (2012), "Modeling Kinect Sensor
# Noise": the same within 20 % from 0.8 to 2 m; no depth beyond 60 to 70 degrees. Windows of 9 pixels: Konolige and
# Mihelich, "Technical description of Kinect calibration".
KINECT_V1 = Sensor(
    name="kinect-v1",
    width=640,
    height=480,
    focal=(585.0, 585.0),
    usual=0.8,
    nearest=0.5,
    farthest=5.0,
    baseline=0.075,
    disparity_std=0.051,
    disparity_step=0.125,
    depth_unit=0.001,
    correlation=5.0,
    window=9,
    threshold=0.35,
    threshold_std=0.05,
    mixing=0.1,
    grazing=0.35,
    fixed=0.5,
    mask_edge=1.0,
)

# Fankhauser et al. (2015), "Kinect v2 for Mobile Robot Navigation: Evaluation and Modeling", ICAR; Sarbolandi,
# Lefloch and Kolb (2015), "Kinect Range Sensing: Structured-Light versus Time-of-Flight Kinect", CVIU 139: one to two
# mm up to 2 m, about 5 mm at 4 m; flying pixels at every edge. Own filters of the driver join few pixels.
KINECT_V2 = Sensor(
    name="kinect-v2",
    width=512,
    height=424,
    focal=(365.5, 365.5),
    usual=0.8,
    nearest=0.5,
    farthest=4.5,
    depth_std=(1.0e-3, 0.0, 0.25e-3),
    depth_unit=0.001,
    correlation=1.5,
    window=3,
    mixing=1.0,
    grazing=0.15,
    fixed=0.3,
    mask_edge=1.0,
)

# Tölgyessy et al. (2021), "Evaluation of the Azure Kinect and Its Comparison to Kinect V1 and Kinect V2", Sensors
# 21(2): narrow field of view, unbinned: 0.6 mm at 1 m, 1.1 at 2 m, 2 at 3 m; flying pixels at edges.
AZURE_KINECT = Sensor(
    name="azure-kinect",
    width=640,
    height=576,
    focal=(504.0, 504.0),
    usual=0.8,
    nearest=0.5,
    farthest=3.86,
    depth_std=(0.4e-3, 0.0, 0.17e-3),
    depth_unit=0.001,
    correlation=1.0,
    window=3,
    mixing=1.0,
    grazing=0.15,
    fixed=0.3,
    mask_edge=1.0,
)

# Keselman et al. (2017), "Intel RealSense Stereoscopic Depth Cameras", CVPR workshops; Ahn et al. (2019), "Analysis
# and Noise Modeling of the Intel RealSense D435 for Mobile Robots": disparity of 0.08 pixels RMS on a textured plane,
# baseline 50 mm; 90 degrees over 1280 pixels. Set by real frames of a rope of one colour at 0.46 m: the correlation,
# 2.2 times the noise of the plane, window, threshold and its variation, and how a mask by colour wanders.
REALSENSE_D435 = Sensor(
    name="realsense-d435",
    width=1280,
    height=720,
    focal=(640.0, 640.0),
    usual=0.5,
    nearest=0.28,
    farthest=10.0,
    baseline=0.05,
    disparity_std=0.08,
    disparity_step=1.0 / 32.0,
    depth_unit=0.001,
    correlation=10.5,
    plain=2.2,
    window=7,
    threshold=0.2,
    threshold_std=0.08,
    mixing=0.15,
    grazing=0.1,
    fixed=0.5,
    mask_edge=0.8,
    colour_focal=918.0,
)

# Servi et al. (2021), "Metrological Characterization and Comparison of D415, D455, L515 RealSense Devices in the Close
# Range", Sensors 21(22); the maker's data sheet: 2.5 mm at 1 m, 15.5 mm at 9 m. A mirror moves the beam over 640 x 480.
REALSENSE_L515 = Sensor(
    name="realsense-l515",
    width=640,
    height=480,
    focal=(460.0, 460.0),
    usual=0.6,
    nearest=0.25,
    farthest=9.0,
    depth_std=(0.9e-3, 1.6e-3, 0.0),
    depth_unit=0.00025,
    correlation=3.0,
    window=3,
    mixing=0.8,
    grazing=0.2,
    fixed=0.3,
    mask_edge=1.0,
)

# The maker's data sheet: baseline 120 mm, 1280 x 720 with f = 530 pixels, better than 1 % up to 3 m, which is 0.2
# pixels. The matching is passive and smooths strongly; depths are floating point numbers.
ZED2 = Sensor(
    name="zed2",
    width=1280,
    height=720,
    focal=(530.0, 530.0),
    usual=0.6,
    nearest=0.3,
    farthest=20.0,
    baseline=0.12,
    disparity_std=0.2,
    correlation=9.0,
    window=9,
    threshold=0.3,
    threshold_std=0.08,
    mixing=0.5,
    grazing=0.1,
    fixed=0.5,
    mask_edge=1.0,
)

# Makers' data sheets of fringe projectors for industry (about 2 megapixels, 0.3 mm between points at 0.7 m): 0.02 to
# 0.05 mm from point to point.
STRUCTURED_LIGHT = Sensor(
    name="structured-light",
    width=1944,
    height=1200,
    focal=(1780.0, 1780.0),
    usual=0.7,
    nearest=0.3,
    farthest=1.6,
    depth_std=(0.0, 0.0, 0.06e-3),
    correlation=2.0,
    window=3,
    mixing=0.3,
    grazing=0.25,
    fixed=0.2,
    mask_edge=0.3,
)

# Makers' data sheets of profile scanners: 0.01 mm; a scan of a 25 mm tube had that residual.
LINE_LASER = Sensor(
    name="line-laser",
    width=0,
    height=0,
    focal=(0.0, 0.0),
    usual=0.6,
    nearest=0.1,
    farthest=2.0,
    pitch=(0.25e-3, 0.5e-3),
    depth_std=(0.01e-3, 0.0, 0.0),
    window=1,
    grazing=0.3,
)

# Makers' data sheets of tripod scanners: 2 mm of ranging noise below 25 m, a beam of 3 mm and 0.3 mrad, which covers
# several steps of 0.25 mrad: what it hits at an edge is between object and background.
TERRESTRIAL = Sensor(
    name="terrestrial",
    width=0,
    height=0,
    focal=(4000.0, 4000.0),
    usual=4.0,
    nearest=0.6,
    farthest=100.0,
    depth_std=(2.0e-3, 0.0, 0.0),
    window=5,
    mixing=1.0,
    grazing=0.1,
)

SENSORS = {
    sensor.name: sensor
    for sensor in (
        KINECT_V1,
        KINECT_V2,
        AZURE_KINECT,
        REALSENSE_D435,
        REALSENSE_L515,
        ZED2,
        STRUCTURED_LIGHT,
        LINE_LASER,
        TERRESTRIAL,
    )
}
