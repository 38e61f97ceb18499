"""What a fit makes, as data."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from configured import configured

from dlogen.types import FitData, Frame, Skeleton


@pytest.fixture
def data(make_result: Callable[..., FitData], circle: Callable[[float, float], Skeleton]) -> FitData:
    return make_result(circle(0.5, 2.0))


def test_settings_are_the_resolved_configuration(data: FitData) -> None:
    assert data.settings == data.config.to_dict()
    assert (data.settings["r"], data.settings["e_max"]) == (0.01, 0.005)
    assert data.settings["joints"]["dof"] == 2
    changed = configured(data, joints={"dof": 3}, e_max=0.002).settings
    assert (changed["joints"]["dof"], changed["e_max"]) == (3, 0.002)


def test_settings_are_a_copy(data: FitData) -> None:
    data.settings["joints"]["dof"] = 7
    assert data.settings["joints"]["dof"] == 2
    assert data.config.joints.dof == 2


def test_without_more_said_it_is_in_the_clouds_frame_and_not_recorded(data: FitData) -> None:
    assert data.recorded == ()
    assert data.frame.name == Frame().name
    assert np.array_equal(data.frame.transform, np.eye(4))


def test_a_result_stays_as_it_was_made(data: FitData) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        data.e_max = 1.0  # type: ignore[misc]
