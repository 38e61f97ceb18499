"""The table of sensors against the figures that their sources print."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.evaluation.sensors.models import KINECT_V1, REALSENSE_D435, SENSORS, Sensor

#: Depth in metres, standard deviation of the depth in millimetres there: as the sources of the table have them.
PUBLISHED = {
    "kinect-v2": ((1.0, 1.25), (4.0, 5.0)),
    "azure-kinect": ((1.0, 0.57), (3.0, 1.93)),
    "realsense-d435": ((0.5, 0.625), (2.0, 10.0)),
    "realsense-l515": ((1.0, 2.5), (9.0, 15.5)),
    "zed2": ((1.0, 3.14), (3.0, 28.3)),
    "structured-light": ((0.7, 0.029), (1.4, 0.118)),
    "line-laser": ((0.3, 0.01), (1.0, 0.01)),
    "terrestrial": ((2.0, 2.0), (20.0, 2.0)),
}


def test_every_sensor_is_here_under_its_name() -> None:
    assert set(SENSORS) == {*PUBLISHED, "kinect-v1"}
    assert all(sensor.name == name for name, sensor in SENSORS.items())


@pytest.mark.parametrize("name", PUBLISHED)
def test_noise_is_what_the_source_says(name: str) -> None:
    depth, expected = np.array(PUBLISHED[name]).T
    np.testing.assert_allclose(1e3 * SENSORS[name].noise(depth), expected, rtol=0.02)


@pytest.mark.parametrize("depth", [0.8, 3.0])
def test_the_kinects_noise_and_its_rounding_are_half_a_step_together(depth: float) -> None:
    step = 2.85e-3 * depth**2
    own = float(KINECT_V1.noise(np.array([depth]))[0])
    assert np.hypot(own, step / np.sqrt(12.0)) == pytest.approx(0.5 * step, rel=0.01)
    assert KINECT_V1.disparity_step / (585.0 * 0.075) == pytest.approx(2.85e-3, rel=0.01)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=list(SENSORS))
def test_figures_make_sense_together(sensor: Sensor) -> None:
    assert sensor.nearest < sensor.usual < sensor.farthest
    assert sensor.window % 2 == 1
    assert (sensor.baseline > 0.0) == (sensor.disparity_std > 0.0) == (sensor.depth_std == (0.0, 0.0, 0.0))
    assert sensor.scans == (sensor.height == 0)


def test_rays_go_to_the_right_with_the_columns_and_down_with_the_rows() -> None:
    rays = REALSENSE_D435.rays()
    assert rays.shape == (720, 1280, 3)
    np.testing.assert_allclose(rays[0, -1], [639.5 / 640, -359.5 / 640, 1.0])
    np.testing.assert_allclose(rays[1, 0] - rays[0, 0], [0.0, 1 / 640, 0.0], atol=1e-12)


def test_the_colour_image_has_smaller_pixels() -> None:
    grid = REALSENSE_D435.colour_grid()
    assert grid.focal == (918.0, 918.0) and (grid.width, grid.height) == (1280, 720)
    assert KINECT_V1.colour_grid() is KINECT_V1
