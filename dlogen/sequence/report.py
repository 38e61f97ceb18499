"""The report of a recording: `sequence.json`, and `one_model.json` of clouds in no order."""

from __future__ import annotations

from typing import Any

import numpy as np

from dlogen._version import __version__
from dlogen.io.report import model_dict
from dlogen.multibody.build import multibody
from dlogen.sequence.outliers import Size
from dlogen.sequence.trajectory import Motion
from dlogen.types import FitData

SCHEMA = "dlogen.sequence/1"


def sequence_dict(motion: Motion, result: FitData, *, time_source: str | None, rate: float | None) -> dict[str, Any]:
    """The report, `dlogen.sequence/1`."""
    model, sizes = motion.model, motion.model.sizes
    good = model.good
    worst = int(np.nanargmax(model.deviation))
    times = motion.times
    names = [item.name for item in model.captures]
    steps = np.linalg.norm(np.diff(model.joints[motion.posed], axis=0), axis=2)
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
            "segment_count": len(model.links),
            "segment_length": float(model.links[0]),
            "last_segment_length": float(model.links[-1]),
            "criterion": model.criterion,
            "e_max": model.e_max,
            "max_deviation": float(model.deviation[worst]),
            "max_deviation_frame": names[worst],
            "mean_deviation": float(np.nanmean(model.deviation)),
            "min_bend_radius": model.bend.radius if np.isfinite(model.bend.radius) else None,
            "min_bend_radius_frame": names[model.bend.capture],
            "min_bend_radius_s": model.bend.s,
            "reference_frame": names[model.reference],
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
                "frame": None if item.capture is None else names[item.capture],
            }
            for item in model.doubts
        ],
        "frames": [
            {
                "name": item.name,
                "time": None if times is None else float(times[k]),
                "state": motion.states[k],
                "reason": None if exclusion is None else {"code": exclusion.code, "message": exclusion.message},
                "reversed": bool(model.reverse[k]),
                "length": None if np.isnan(item.length) else item.length,
                "radius": None if np.isnan(item.radius) else item.radius,
                "residual": None if np.isnan(item.residual) else item.residual,
                "error": float(model.deviation[k]) if good[k] else None,
            }
            for k, (item, exclusion) in enumerate(zip(model.captures, model.exclusions, strict=True))
        ],
        "model": model_dict(multibody(result)),
        "config": result.settings,
    }


def _size(size: Size) -> dict[str, float | None]:
    return {"median": size.value, "allowed": size.allowed, "spread": size.spread}
