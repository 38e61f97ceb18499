"""A helix as the curve of the tube fit: its points, derivatives and curvature are known."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.stages.refined.tube_curve import TubeCurve, through

#: Radius and rise a radian of the helix, metres; how far it turns, and metres of arc a radian.
RADIUS, RISE, TURN = 0.3, 0.1, 5.0
SPEED = float(np.hypot(RADIUS, RISE))


@pytest.fixture(scope="session")
def curve() -> TubeCurve:
    """40 intervals through (0.3 cos t, 0.3 sin t, 0.1 t), t from 0 to 5: x = 8 t."""
    t = np.linspace(0.0, TURN, 6 * 40 + 1)
    return through(np.stack([RADIUS * np.cos(t), RADIUS * np.sin(t), RISE * t]), 40, TURN * SPEED / 40)
