"""Pictures of motions."""

from __future__ import annotations

import pytest
from moving import moved

from dlogen.sequence.plot import motion_picture


def test_picture() -> None:
    pytest.importorskip("matplotlib")
    for motion in (moved(), moved("rod"), moved(times=False)):
        data = motion_picture(motion)
        assert data.startswith(b"\x89PNG") and len(data) > 20_000
