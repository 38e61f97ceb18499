"""The chain in as few keys as possible."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from dlogen.io.registry import model_format
from dlogen.types import Frame


@pytest.fixture(scope="module")
def result(fitted, helix, make_result):
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01)


def test_joints_lengths_and_radius(result) -> None:
    ((name, content),) = model_format("json-plain").write(result, "cable").items()
    assert (name,) == model_format("json-plain").files("cable") == ("cable.plain.json",)
    data = json.loads(content)
    assert list(data) == ["schema", "name", "frame", "radius", "joints", "lengths"]
    assert (data["schema"], data["name"], data["frame"]) == ("dlogen.plain/1", "cable", "cloud")
    assert data["radius"] == 0.01
    # Every digit, in order, and what lies between two joints is as long as it says.
    assert data["joints"] == result.chain.joints.tolist()
    assert data["lengths"] == pytest.approx(np.linalg.norm(np.diff(data["joints"], axis=0), axis=1))
    assert len(data["lengths"]) == len(data["joints"]) - 1 > 5


def test_the_frame_is_named(result) -> None:
    turned = replace(result, frame=Frame("table"))
    (content,) = model_format("json-plain").write(turned, "x").values()
    assert json.loads(content)["frame"] == "table"
    assert json.loads(content)["name"] == "x"
