"""The shared model as a result, and all files of a recording: models, tables, report and picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.config.schema import Config
from dlogen.geometry.basis import basis_from_dict
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import resample
from dlogen.io.json_text import dump_json
from dlogen.multibody.build import multibody
from dlogen.sequence.captures import read_fit
from dlogen.sequence.trajectory import Motion
from dlogen.sequence.trajectory_tables import trajectory_csv, trajectory_npz
from dlogen.types import FitData, Frame, Joints, Quality, Residual, Segmentation, Skeleton


def result_of(motion: Motion, folder: Path, key: str, config: Config, name: str) -> FitData:
    """The shared model as the result of a fit, so that every format can write it.

    The skeleton line and the residual are those of the reference capture.

    Args:
        motion: poses of the model.
        folder: of the single fits.
        key: of the reference capture in it.
        config: what the model is made with.
        name: of the model.
    """
    data, report = read_fit(folder, key)
    model, chain = motion.model, motion.chain
    back = -1 if model.reverse[model.reference] else 1
    basis = data["skeleton"]["basis"]
    line = Skeleton(
        basis_from_dict(basis),
        # Both kinds of basis are symmetric: phi_j(1 - s) = phi_(N - 1 - j)(s).
        np.array(basis["weights"])[::back],
        np.array(basis["offset"]),
        data["skeleton"]["length"],
    )
    points = np.array(data["skeleton"]["points"])[::back]
    joints = Joints(chain.s, chain.joints, float(model.links[0]), float(model.links[-1]))
    deviation = float(model.deviation[model.reference])
    error = mdtw(resample(points, config.mdtw.samples), resample(chain.joints, config.mdtw.samples))
    worst = float(error.s[int(np.argmax(error.error))])
    resolved = config.resolved({"r": chain.radius, "e_max": model.e_max, "segmentation.criterion": model.criterion})
    return FitData(
        name=name,
        profile=data["profile"],
        skeleton=line,
        skeleton_points=points,
        segmentation=Segmentation(model.criterion, "material", joints, deviation, worst),
        joints=joints,
        chain=chain,
        e_max=model.e_max,
        max_deviation=deviation,
        mdtw=error,
        residual=Residual(**report["residual"]),
        quality=Quality(),
        config=resolved,
        provenance=data["provenance"],
        timings={},
        intermediates=(),
        frame=Frame(data["frame"], np.array(data["frame_transform"])),
        recorded=motion.poses(),
    )


def contents(
    motion: Motion, result: FitData, report: dict[str, Any], formats: Sequence[str], names: Sequence[str]
) -> dict[str, bytes]:
    """All files by name.

    Args:
        motion: poses of the shared model.
        result: the model, of `result_of`.
        report: of `sequence_dict`.
        formats: names of model formats.
        names: of the files beside the models: table, arrays, report and, if there is to be one, picture.

    Raises:
        DlogenError: a format cannot hold the model, or pictures need matplotlib.
    """
    from dlogen.io.registry import model_format

    hinge_names = multibody(result).hinge_names
    made: dict[str, bytes] = {}
    for item in formats:
        made |= model_format(item).write(result, result.name)
    made[names[0]] = trajectory_csv(motion, hinge_names)
    made[names[1]] = trajectory_npz(motion, hinge_names)
    made[names[2]] = dump_json(report).encode()
    if len(names) > 3:
        from dlogen.sequence.plot import motion_picture

        made[names[3]] = motion_picture(motion)
    return made
