"""What is in a cloud and which parameters fit it, without fitting."""

from __future__ import annotations

from typing import Any

import numpy as np

from dlogen.config.defaults import PAPER_SIZE
from dlogen.errors import DlogenError
from dlogen.geometry.units import METRES, guess_units
from dlogen.pipeline import search_radius
from dlogen.stages.paper.normals import choose_neighbours
from dlogen.stages.prepare import check_points, far_away
from dlogen.stages.scale import estimate_scale
from dlogen.types import Cloud


def inspect(cloud: Cloud, units: str = "auto") -> dict[str, Any]:
    """Size, spacing and the parameters that `auto` would choose.

    Args:
        cloud: what `read_cloud` gives.
        units: "m", "mm", "cm", or "auto" for a guess.

    Returns:
        Plain data; lengths in metres, without the points that are very far from all others (`far_away` counts them).
        `problem` says why the cloud cannot be fitted, None if nothing speaks against it.
    """
    source = cloud.source
    far = far_away(cloud.points)
    near = cloud.points[~far]
    guessed = guess_units(near)
    scale = METRES[guessed if units == "auto" else units]
    low, high = near.min(axis=0), near.max(axis=0)
    points = (near - 0.5 * (low + high)) * scale
    out: dict[str, Any] = {
        "schema": "dlogen.info/1",
        "name": source.name if source else None,
        "format": source.format if source else None,
        "encoding": source.encoding if source else None,
        "fields": list(source.fields) if source else ["x", "y", "z"],
        "declared_points": source.declared_points if source else len(cloud),
        "organised": [source.width, source.height] if source and source.height > 1 else None,
        "points": len(cloud),
        "far_away": int(np.count_nonzero(far)),
        "dropped": {"non_finite": cloud.dropped.non_finite, "duplicates": cloud.dropped.duplicates},
        "normals": cloud.normals is not None,
        "viewpoint": None if cloud.viewpoint is None else (cloud.viewpoint * scale).tolist(),
        "units": {"guess": guessed, "used": guessed if units == "auto" else units, "given": units != "auto"},
        "minimum": (low * scale).tolist(),
        "maximum": (high * scale).tolist(),
        "extent": ((high - low) * scale).tolist(),
        "problem": None,
    }
    try:
        check_points(near)
        found = estimate_scale(points)
    except DlogenError as error:
        return {**out, "problem": error.message}
    finite = {key: value if np.isfinite(value) else None for key, value in vars(found).items()}
    out["scale"] = finite
    out["chosen"] = {
        "r": found.radius,
        "r_n": search_radius(points, found.radius),
        "e_max": found.radius / 2.0,
        "N": PAPER_SIZE,
        "normals.neighbours": choose_neighbours(points, found.radius),
    }
    return out
