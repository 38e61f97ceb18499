"""What is told of a cloud without fitting it, against a tube that is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dlogen.config.schema import Config
from dlogen.inspect import inspect
from dlogen.types import Cloud


@pytest.mark.parametrize(("units", "scale"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
def test_lengths_are_metres_whatever_the_units(tube, units: str, scale: float) -> None:
    told = inspect(Cloud(scale * tube.points, viewpoint=scale * np.array([0.0, 0.0, 2.0])), units)
    assert told["units"]["used"] == units and told["units"]["given"]
    assert told["minimum"] == pytest.approx(tube.points.min(axis=0).tolist())
    assert told["maximum"] == pytest.approx(tube.points.max(axis=0).tolist())
    assert told["extent"] == pytest.approx(np.ptp(tube.points, axis=0).tolist())
    assert told["viewpoint"] == pytest.approx([0.0, 0.0, 2.0])
    assert told["chosen"]["r"] == pytest.approx(tube.radius, rel=0.02)
    # The paper's ratio, and a search radius that spans the object.
    assert told["chosen"]["e_max"] == pytest.approx(told["chosen"]["r"] / 2)
    assert told["chosen"]["r_n"] >= 2 * told["chosen"]["r"]
    assert told["problem"] is None
    json.dumps(told, allow_nan=False)


def test_units_are_guessed_unless_given(tube) -> None:
    told = inspect(Cloud(1000.0 * tube.points))
    assert told["units"] == {"guess": "mm", "used": "mm", "given": False}
    assert inspect(Cloud(1000.0 * tube.points), "m")["units"] == {"guess": "mm", "used": "m", "given": True}


def test_points_far_away_are_counted_and_left_out(tube) -> None:
    told = inspect(Cloud(np.concatenate([tube.points, [[1e10] * 3, [-1e10, 0.0, 0.0]]])), "m")
    assert (told["points"], told["far_away"]) == (5002, 2)
    assert told["maximum"] == pytest.approx(tube.points.max(axis=0).tolist())


def test_what_speaks_against_a_fit_is_said() -> None:
    told = inspect(Cloud(np.random.default_rng(0).random((5, 3))))
    assert "too few" in told["problem"]
    assert "chosen" not in told and told["points"] == 5
    assert told["normals"] is False and told["viewpoint"] is None


def test_it_chooses_what_a_fit_would(tube) -> None:
    from dlogen.stages.clock import Clock
    from dlogen.stages.paper.line import paper_line
    from dlogen.stages.prepare import prepare

    told = inspect(Cloud(tube.points), "m")["chosen"]
    config = Config().resolved({"profile": "paper"})
    chosen = paper_line(prepare(Cloud(tube.points), "m").cloud, config, Clock()).chosen
    for key in ("r", "r_n", "N", "normals.neighbours"):
        assert told[key] == chosen[key], key
