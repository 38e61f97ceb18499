"""From the single fits of a batch to one model for all of them: for recordings, and for clouds in no order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.batch.store import Row
from dlogen.config.fields import AUTO
from dlogen.config.schema import Config
from dlogen.sequence.captures import read_capture
from dlogen.sequence.export import contents, result_of
from dlogen.sequence.file_names import MODEL, file_names
from dlogen.sequence.report import sequence_dict
from dlogen.sequence.shared_model import shared_model
from dlogen.sequence.timestamps import Times
from dlogen.sequence.trajectory import Motion, motion_of


@dataclass(frozen=True, eq=False)
class Assembled:
    """One model for several clouds.

    Attributes:
        motion: its poses.
        report: `dlogen.sequence/1`.
        contents: the files by name.
    """

    motion: Motion
    report: dict[str, Any]
    contents: dict[str, bytes]


def assemble(
    keys: Sequence[str],
    rows: Mapping[str, Row],
    folder: Path,
    config: Config,
    formats: Sequence[str],
    *,
    times: Times | None = None,
    rate: float | None = None,
    keep_doubtful: bool = False,
    smooth: bool = False,
    plot: bool = False,
) -> Assembled:
    """One model for all clouds of a batch, and its pose in each.

    Args:
        keys: of the clouds; in the order of time, if they have one.
        rows: records of the batch by key.
        folder: of the batch; the chains of the single fits, KEY.json, and their reports are there.
        config: what the model is made with.
        formats: of the model.
        times: of the clouds, if they are captures of a recording. Without, clouds that are excluded have no pose.
        rate: what the user said of the times.
        keep_doubtful: go by clouds whose verdict is doubtful.
        smooth: even out the noise from capture to capture.
        plot: make a picture.

    Raises:
        FitError: no cloud can be believed, or there would be too many segments.
        ConfigError: the settings do not fit the object.
        DlogenError: a format cannot hold the model, or pictures need matplotlib.
    """
    seconds = None if times is None else np.array(times.seconds)
    model = shared_model(
        [read_capture(rows, key, folder, keep_doubtful=keep_doubtful) for key in keys],
        seconds,
        segmentation=config.segmentation,
        e_max=None if config.e_max == AUTO else config.e_max,
        smooth=smooth,
    )
    motion = motion_of(model, seconds, config.joints)
    result = result_of(motion, folder, keys[model.reference], config, MODEL)
    report = sequence_dict(motion, result, time_source=None if times is None else times.source, rate=rate)
    names = file_names(times is not None, plot)
    return Assembled(motion, report, contents(motion, result, report, formats, names))
