from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.stages.paper.projection import project


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 1000), st.floats(0.001, 0.05))
def test_true_normals_lead_to_the_axis(seed: int, radius: float) -> None:
    cloud = sample_tube(random_centre_line(seed), radius, 200, seed)
    assert project(cloud.points, cloud.normals, radius) == pytest.approx(cloud.truth(cloud.s), abs=1e-12)


@pytest.mark.parametrize("name", ["bent", "straight", "helical"])
def test_on_the_papers_curves(name: str) -> None:
    cloud = sample_tube(centre_line(name), 0.02, 1000, 0)
    assert project(cloud.points, cloud.normals, 0.02) == pytest.approx(cloud.truth(cloud.s), abs=1e-12)


def test_a_flipped_normal_is_a_diameter_off(tube) -> None:
    axis = tube.truth(tube.s)
    off = np.linalg.norm(project(tube.points, -tube.normals, tube.radius) - axis, axis=1)
    assert off == pytest.approx(np.full(len(axis), 2 * tube.radius), abs=1e-12)


def test_a_wrong_radius_is_off_by_the_difference(tube) -> None:
    off = np.linalg.norm(project(tube.points, tube.normals, 0.6 * tube.radius) - tube.truth(tube.s), axis=1)
    assert off == pytest.approx(np.full(len(off), 0.4 * tube.radius), abs=1e-12)


def test_nothing_moves_without_a_radius_and_the_input_stays(tube) -> None:
    before = tube.points.copy()
    assert np.array_equal(project(tube.points, tube.normals, 0.0), before)
    project(tube.points, tube.normals, 0.1)
    assert np.array_equal(tube.points, before)
