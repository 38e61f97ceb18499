"""Files of a recording: what single fits have written is read, models, trajectory and report are made."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dlogen._version import __version__
from dlogen.batch.paths import as_unicode
from dlogen.batch.store import Row
from dlogen.config.schema import Config
from dlogen.geometry.basis import basis_from_dict
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import resample
from dlogen.io.json_text import dump_json
from dlogen.io.report import model_dict
from dlogen.multibody.build import multibody
from dlogen.sequence.outliers import Observed, Size
from dlogen.sequence.trajectory import Motion
from dlogen.stages.quality.findings import DEVIATION_ABOVE_E_MAX
from dlogen.types import Finding, Frame, Joints, Quality, Residual, Result, Segmentation, Skeleton

SCHEMA = "dlogen.sequence/1"

#: Findings about a frame's own chain, which is not used.
_OF_THE_CHAIN = (DEVIATION_ABOVE_E_MAX,)

#: Columns of the trajectory before the joints.
_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def observed_of(rows: Mapping[str, Row], key: str, folder: Path, *, keep_doubtful: bool = False) -> Observed:
    """A frame as its fit has written it.

    Args:
        rows: records of the fits by key.
        key: of the frame; the chain is KEY.json, its report KEY.report.json.
        folder: of the fits.
        keep_doubtful: go by the frame although its verdict is doubtful.
    """
    name = as_unicode(key)
    row = rows.get(name)
    if row is None or row.status != "done":
        return Observed(name, None, problem=row.error if row and row.error else "it has not been fitted")
    chain, report = _read(folder / f"{key}.json"), _read(folder / f"{key}.report.json")
    findings = map(Finding.from_dict, chain["quality"]["findings"])
    quality = Quality(tuple(item for item in findings if not any(kind.matches(item) for kind in _OF_THE_CHAIN)))
    problem = None
    if not quality.is_good and not (keep_doubtful and not quality.is_bad):
        said = "; ".join(f"{item.message} [{item.code}]" for item in quality.warnings)
        problem = f"{quality.verdict}: {said}"
    return Observed(
        name,
        np.array(chain["skeleton"]["points"]),
        chain["skeleton"]["length"],
        chain["radius"],
        report["residual"]["rms"],
        problem,
    )


def result_of(motion: Motion, path: Path, config: Config, name: str) -> Result:
    """The common model as the result of a fit, so that every format can write it.

    The skeleton line and the residual are those of the reference frame.

    Args:
        motion: poses of the model.
        path: chain that the fit of the reference frame has written.
        config: what the model is made with.
        name: of the model.
    """
    data, report = _read(path), _read(path.with_name(f"{path.name.removesuffix('.json')}.report.json"))
    common, chain = motion.common, motion.chain
    back = -1 if common.reverse[common.reference] else 1
    basis = data["skeleton"]["basis"]
    line = Skeleton(
        basis_from_dict(basis),
        # Both kinds of basis are symmetric: phi_j(1 - s) = phi_(N - 1 - j)(s).
        np.array(basis["weights"])[::back],
        np.array(basis["offset"]),
        data["skeleton"]["length"],
    )
    points = np.array(data["skeleton"]["points"])[::back]
    joints = Joints(chain.s, chain.joints, float(common.links[0]), float(common.links[-1]))
    deviation = float(common.deviation[common.reference])
    error = mdtw(resample(points, config.mdtw.samples), resample(chain.joints, config.mdtw.samples))
    worst = float(error.s[int(np.argmax(error.error))])
    resolved = config.resolved({"r": chain.radius, "e_max": common.e_max, "segmentation.criterion": common.criterion})
    return Result(
        name=name,
        profile=data["profile"],
        skeleton=line,
        skeleton_points=points,
        segmentation=Segmentation(common.criterion, "material", joints, deviation, worst),
        joints=joints,
        chain=chain,
        e_max=common.e_max,
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


def _read(path: Path) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return data


def trajectory_csv(motion: Motion, hinge_names: Sequence[str]) -> bytes:
    """A row for each frame: name, time, pose of the base, values of the joints, error and state. Empty where unknown.

    Position and quaternion are those of the first segment's frame in the root frame; metres, radians, seconds. The
    error is the largest distance between the frame's own skeleton line and the chain.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["frame", "time", *_POSE, *hinge_names, "error", "state", "reason"])
    quaternions = motion.quaternions
    for k, (item, aside) in enumerate(zip(motion.common.observed, motion.common.asides, strict=True)):
        numbers = [*motion.base_positions[k], *quaternions[k], *motion.values[k].ravel(), motion.common.deviation[k]]
        row = ["" if np.isnan(value) else repr(float(value)) for value in numbers]
        time = "" if motion.times is None else repr(float(motion.times[k]))
        writer.writerow([item.name, time, *row, motion.states[k], "" if aside is None else aside.code])
    return text.getvalue().encode("utf-8", "backslashreplace")


def trajectory_npz(motion: Motion, hinge_names: Sequence[str]) -> bytes:
    """The same as arrays, without pickles; and the positions of the joints, (F, n + 1, 3)."""
    observed = motion.common.observed
    arrays: dict[str, Any] = {
        "frame": np.array([item.name for item in observed], dtype=np.str_),
        "time": np.full(len(observed), np.nan) if motion.times is None else motion.times,
        "base_position": motion.base_positions,
        "base_quaternion": motion.quaternions,
        "joint_names": np.array(hinge_names, dtype=np.str_),
        "joint_values": motion.values.reshape(len(observed), -1),
        "joint_positions": motion.common.joints,
        "error": motion.common.deviation,
        "state": np.array(motion.states, dtype=np.str_),
    }
    data = io.BytesIO()
    np.savez(data, **arrays)
    return data.getvalue()


def sequence_dict(motion: Motion, result: Result, *, time_source: str | None, rate: float | None) -> dict[str, Any]:
    """The report, `dlogen.sequence/1`."""
    common, sizes = motion.common, motion.common.sizes
    good = common.good
    worst = int(np.nanargmax(common.deviation))
    times = motion.times
    names = [item.name for item in common.observed]
    steps = np.linalg.norm(np.diff(common.joints[motion.posed], axis=0), axis=2)
    return {
        "schema": SCHEMA,
        "units": {"length": "m", "angle": "rad", "mass": "kg", "time": "s"},
        "dlogen": __version__,
        "frame_count": len(names),
        "states": {state: motion.states.count(state) for state in ("good", "interpolated", "held", "none")},
        "time": {
            "source": time_source,
            "rate": rate,
            "start": None if times is None else float(times[0]),
            "end": None if times is None else float(times[-1]),
        },
        "common": {
            "length": sizes.length.value,
            "radius": sizes.radius.value,
            "segment_count": len(common.links),
            "segment_length": float(common.links[0]),
            "last_segment_length": float(common.links[-1]),
            "criterion": common.criterion,
            "e_max": common.e_max,
            "max_deviation": float(common.deviation[worst]),
            "max_deviation_frame": names[worst],
            "mean_deviation": float(np.nanmean(common.deviation)),
            "min_bend_radius": common.bend.radius if np.isfinite(common.bend.radius) else None,
            "min_bend_radius_frame": names[common.bend.frame],
            "min_bend_radius_s": common.bend.s,
            "reference_frame": names[common.reference],
            "largest_step": float(steps.max(initial=0.0)) if times is not None else None,
        },
        "thresholds": {
            "length": _size(sizes.length),
            "radius": _size(sizes.radius),
            "residual": _size(sizes.residual),
        },
        "doubts": [
            {
                "code": item.code,
                "message": item.message,
                "frame": None if item.frame is None else names[item.frame],
            }
            for item in common.doubts
        ],
        "frames": [
            {
                "name": item.name,
                "time": None if times is None else float(times[k]),
                "state": motion.states[k],
                "reason": None if aside is None else {"code": aside.code, "message": aside.message},
                "reversed": bool(common.reverse[k]),
                "length": None if np.isnan(item.length) else item.length,
                "radius": None if np.isnan(item.radius) else item.radius,
                "residual": None if np.isnan(item.residual) else item.residual,
                "error": float(common.deviation[k]) if good[k] else None,
            }
            for k, (item, aside) in enumerate(zip(common.observed, common.asides, strict=True))
        ],
        "model": model_dict(multibody(result)),
        "config": result.settings,
    }


def _size(size: Size) -> dict[str, float | None]:
    return {"median": size.value, "allowed": size.allowed, "spread": size.spread}


def contents(
    motion: Motion, result: Result, report: dict[str, Any], formats: Sequence[str], names: Sequence[str]
) -> dict[str, bytes]:
    """All files by name.

    Args:
        motion: poses of the common model.
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
