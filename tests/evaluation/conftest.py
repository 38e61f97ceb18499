"""Tests that take a `line` run with one centre line of each kind."""

from __future__ import annotations

import pytest
from known_lines import LINES

from dlogen.evaluation.centre_line import CentreLine


@pytest.fixture(params=LINES)
def line(request: pytest.FixtureRequest) -> CentreLine:
    return LINES[request.param]
