"""Findings know where on the line they are, and where in space."""

from __future__ import annotations

import numpy as np
import pytest
from dlogen.stages.quality.place import finding_at


def test_a_finding_has_its_place_on_the_line_and_in_space(circle) -> None:
    finding = finding_at(circle(0.5, np.pi), "gap", "no points here", "doubtful", 0.25)
    assert (finding.code, finding.message, finding.severity, finding.s) == ("gap", "no points here", "doubtful", 0.25)
    assert finding.position == pytest.approx((0.5 * np.cos(np.pi / 4), 0.5 * np.sin(np.pi / 4), 0.0))
    # Plain numbers, as JSON wants them.
    assert {type(value) for value in finding.position} == {float}
