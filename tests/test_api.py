"""The Python interface, as a notebook would use it."""

from __future__ import annotations

import numpy as np
import pytest

import dlogen
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube


def tube(name: str = "straight", count: int = 2000, seed: int = 3) -> np.ndarray:
    return sample_tube(centre_line(name), 0.02, count, np.random.default_rng(seed)).points


def test_everything_that_is_promised_is_there() -> None:
    for name in dlogen.__all__:
        assert getattr(dlogen, name) is not None
    assert set(dlogen.__all__) <= set(dir(dlogen))
    with pytest.raises(AttributeError):
        dlogen.nothing  # noqa: B018


def test_fit_takes_an_array_and_a_mapping() -> None:
    result = dlogen.fit(tube(), {"profile": "paper", "r": 0.02, "e_max": 0.01})
    assert result.name == "cloud"
    assert result.chain.joints.shape[1] == 3
    assert result.max_deviation <= 0.01


def test_fit_takes_lists_and_drops_what_is_not_finite() -> None:
    points = np.vstack([tube(), [[np.nan, 0, 0]], tube()[:1]]).tolist()
    result = dlogen.fit(points, {"profile": "paper", "r": 0.02})
    assert result.provenance["dropped"] == {"non_finite": 1, "duplicates": 1}
    assert result.provenance["points"] == 2000


@pytest.mark.parametrize("wrong", [np.zeros((4, 2)), np.zeros(3), "cloud.ply", np.zeros((0, 3))])
def test_fit_refuses_what_is_no_cloud(wrong: object) -> None:
    with pytest.raises(dlogen.DlogenError):
        dlogen.fit(wrong)
