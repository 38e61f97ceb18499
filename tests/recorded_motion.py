"""Motions of objects that are known, two time steps of them missing."""

from __future__ import annotations

from functools import cache

from moving import recorded

from dlogen.config.sections import JointSettings
from dlogen.sequence.outliers import Observed
from dlogen.sequence.shared_model import common_model
from dlogen.sequence.trajectory import Motion, motion_of


@cache
def moved(name: str = "hose", dof: int = 2, zero: str = "straight", times: bool = True) -> Motion:
    made = recorded(name, 3, 30)
    frames = list(made.observed)
    frames[7] = Observed("frame_07", None, problem="the file is empty")
    frames[29] = Observed("frame_29", None, problem="the file is empty")
    at = made.times if times else None
    return motion_of(common_model(frames, at), at, JointSettings(dof=dof, zero=zero))
