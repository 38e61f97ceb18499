"""The skeleton line as a function of s."""

from __future__ import annotations

import numpy as np
import pytest


def test_one_place_or_many(helix) -> None:
    line = helix(0.3, 0.1, 4.0)
    assert line(0.5) == pytest.approx([0.3 * np.cos(2.0), 0.3 * np.sin(2.0), 0.2])
    assert line([0.5]).shape == (1, 3)
    assert line([0.0, 0.5])[1] == pytest.approx(line(0.5))
    # With respect to s, not to arc length.
    assert line(0.5, 1) == pytest.approx([-1.2 * np.sin(2.0), 1.2 * np.cos(2.0), 0.4])


def test_the_offset_moves_the_line_and_not_its_derivatives(helix) -> None:
    line = helix(0.3, 0.1, 4.0)
    far = type(line)(line.basis, line.weights, np.array([5e6, 0.0, 1.0]), line.length)
    assert far([0.2, 0.9]) == pytest.approx(line([0.2, 0.9]) + far.offset)
    assert np.array_equal(far([0.2, 0.9], 1), line([0.2, 0.9], 1))


@pytest.mark.parametrize("s", [-0.01, 1.5, [0.5, 1.01], np.nan])
def test_beyond_its_ends_it_is_not_defined(helix, s) -> None:
    with pytest.raises(ValueError, match="from 0 to 1"):
        helix(0.3, 0.1, 4.0)(s)
