"""The types of clouds."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.types import Cloud, Dropped, RawCloud


@pytest.mark.parametrize(("width", "height", "organised"), [(0, 1, False), (6, 1, False), (3, 2, True), (1, 6, True)])
def test_several_rows_are_an_image(width: int, height: int, organised: bool) -> None:
    assert RawCloud(np.zeros((6, 3)), width=width, height=height).organised is organised


def test_a_cloud_is_as_long_as_it_has_points() -> None:
    assert len(Cloud(np.zeros((7, 3)))) == 7
    assert len(Cloud(np.zeros((0, 3)))) == 0


def test_nothing_is_said_that_is_not_known() -> None:
    cloud = Cloud(np.zeros((1, 3)))
    assert (cloud.normals, cloud.viewpoint, cloud.source, cloud.orientation) == (None,) * 4
    assert cloud.dropped == Dropped(0, 0)
    raw = RawCloud(np.zeros((1, 3)))
    assert raw.fields == ("x", "y", "z")
    assert (raw.format, raw.encoding, raw.comments, raw.sha256) == ("", "", (), "")


def test_clouds_are_not_compared_point_by_point() -> None:
    """Equality of arrays is no truth value: two clouds are the same if they are one."""
    cloud, same = Cloud(np.zeros((2, 3))), Cloud(np.zeros((2, 3)))
    assert cloud != same
    assert len({cloud, same, cloud}) == 2
