<<<<<<< HEAD
"""The picture of a motion: what is drawn in it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded_motion import moved

from dlogen.sequence import plot
=======
"""Pictures of motions."""

from __future__ import annotations

import pytest
from moving import moved

>>>>>>> main
from dlogen.sequence.plot import motion_picture


def test_picture() -> None:
    pytest.importorskip("matplotlib")
    for motion in (moved(), moved("rod"), moved(times=False)):
        data = motion_picture(motion)
        assert data.startswith(b"\x89PNG") and len(data) > 20_000
<<<<<<< HEAD


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The figures that pictures are made of."""
    pytest.importorskip("matplotlib")
    figures: list[Any] = []
    monkeypatch.setattr(plot, "png", lambda figure: figures.append(figure) or b"")
    return figures


def test_errors_stand_at_their_times_in_millimetres(drawn: list[Any]) -> None:
    motion = moved()
    motion_picture(motion)
    axes = next(axes for axes in drawn[0].axes if "chain [mm]" in axes.get_ylabel())
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_allclose(lines["deviation"].get_xdata(), motion.times)
    np.testing.assert_allclose(lines["deviation"].get_ydata(), 1e3 * motion.common.deviation)
    assert lines["e_max"].get_ydata()[0] == pytest.approx(1e3 * motion.common.e_max)
    # What was set aside is marked where it was, with its reason.
    assert list(lines["failed"].get_xdata()) == [motion.times[7], motion.times[29]]


def test_the_title_counts(drawn: list[Any]) -> None:
    motion_picture(moved())
    motion_picture(moved(times=False))
    titles = [figure.get_suptitle() for figure in drawn]
    assert titles[0].split(",")[0].startswith("30 ") and titles[1].startswith("30 clouds")
    assert "28 good" in titles[0]
    assert f"{moved().common.sizes.length.value:.3f} m" in titles[0]


def test_chains_keep_their_lengths(drawn: list[Any]) -> None:
    motion = moved("rod")
    motion_picture(motion)
    chains = [line for line in drawn[0].axes[0].lines if len(line.get_xdata()) == motion.common.joints.shape[1]]
    # Every chain from two sides; the extent along the longest axis is that of the joints.
    assert len(chains) == 2 * int(motion.posed.sum())
    seen = np.concatenate([line.get_xdata() for line in chains])
    joints = motion.common.joints[motion.posed].reshape(-1, 3)
    main = np.linalg.svd(joints - joints.mean(axis=0), full_matrices=False)[2][0]
    unit = 1e3 if np.ptp(joints @ main) < 1.0 else 1.0
    assert np.ptp(seen) == pytest.approx(unit * np.ptp(joints @ main))
=======
>>>>>>> main
