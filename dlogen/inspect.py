"""What is in a cloud and which parameters fit it, without fitting."""

from __future__ import annotations

from typing import Any

import numpy as np

from dlogen.config.defaults import PAPER_SIZE
from dlogen.config.fields import AUTO
from dlogen.config.schema import Config
from dlogen.errors import DlogenError
from dlogen.geometry.units import guess_units
from dlogen.stages.mesh import surface_points
from dlogen.stages.paper.normals import choose_neighbours
from dlogen.stages.paper.sorting import choose_search_radius
from dlogen.stages.prepare import MIN_POINTS, check_points, prepare, without_far_points
from dlogen.stages.quality.coordinates import coordinate_steps
from dlogen.stages.refined.node_line import clear_order
from dlogen.stages.scale import estimate_scale
from dlogen.stages.segmentation.specification import allowed_deviation
from dlogen.types import Cloud


def inspect(cloud: Cloud, units: str = AUTO) -> dict[str, Any]:
    """Size, spacing and the parameters that `auto` would choose, of the cloud as a fit prepares it.

    Args:
        cloud: what `read_cloud` gives.
        units: "m", "mm", "cm", or "auto" for a guess.

    Returns:
        Plain data; lengths in metres, without the points that are very far from all others (`far_away` counts them).
        `problem` says why the cloud cannot be fitted, None if nothing speaks against it.
    """
    source = cloud.source
    used, said = surface_points(cloud)
    near, far = without_far_points(used)
    guessed = guess_units(near.points)
    prepared = prepare(near, guessed if units == AUTO else units)
    out: dict[str, Any] = {
        "schema": "dlogen.info/1",
        "name": source.name if source else None,
        "format": source.format if source else None,
        "encoding": source.encoding if source else None,
        "fields": list(source.fields) if source else ["x", "y", "z"],
        "declared_points": source.declared_points if source else len(cloud),
        "organised": [source.width, source.height] if source and source.height > 1 else None,
        "points": len(cloud),
        "mesh": None
        if cloud.mesh is None
        else {"triangles": len(cloud.mesh.triangles), "sampled": len(used) if said else 0},
        "far_away": far,
        "dropped": {"non_finite": cloud.dropped.non_finite, "duplicates": cloud.dropped.duplicates},
        "normals": cloud.normals is not None,
        "viewpoint": None if cloud.viewpoint is None else (cloud.viewpoint * prepared.scale).tolist(),
        "units": {"guess": guessed, "used": prepared.units, "given": units != AUTO},
        "minimum": prepared.low.tolist(),
        "maximum": prepared.high.tolist(),
        "extent": prepared.extent.tolist(),
        "problem": None,
    }
    points = prepared.cloud.points
    nodes = len(points) >= MIN_POINTS and clear_order(points) is not None
    out["nodes"] = nodes
    steps = coordinate_steps(near.points)
    out["steps"] = (steps.along * prepared.scale).tolist()
    out["few_digits"] = steps.said(prepared.scale) if steps.few_digits else None
    try:
        steps.check(near.points, prepared.scale)
        check_points(near.points, surface=not nodes)
        if nodes:
            return out
        found = estimate_scale(points)
    except DlogenError as error:
        return {**out, "problem": error.message}
    out["scale"] = {key: value if np.isfinite(value) else None for key, value in vars(found).items()}
    out["chosen"] = {
        "r": found.radius,
        "r_n": choose_search_radius(points, found.radius),
        "e_max": allowed_deviation(Config(), found.radius),
        "N": PAPER_SIZE,
        "normals.neighbours": choose_neighbours(points, found.radius),
    }
    return out
