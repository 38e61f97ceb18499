"""Synthetic objects with an exactly known axis: centre lines, and points on the tube around them.

Centre lines are smooth curves with derivatives; arc lengths are integrated by Gauss-Legendre quadrature, so that the
truth is better by orders of magnitude than anything that is measured against it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen.evaluation.centre_line import CentreLine
from dlogen.evaluation.shapes import shape_by_name
from dlogen.geometry.vectors import dots, unit
from dlogen.types import Array, BoolArray
from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class SyntheticCloud(ShortRepr):
    """Points on a tube, with the truth about each of them.

    Attributes:
        points: (M, 3) metres.
        normals: (M, 3) true outward unit normals; NaN for stray points.
        s: (M,) true material coordinates; NaN for stray points.
        is_stray: (M,) which points do not belong to the tube.
        truth: the axis.
        radius: of the tube, metres.
        viewpoint: (7,) pose of the sensor that saw the points, x y z qw qx qy qz; None for points without one.

    >>> import dlogen, numpy as np
    >>> cloud = dlogen.synth("straight", points=100)
    >>> offset = cloud.points - cloud.truth(cloud.s)
    >>> bool(abs(np.linalg.norm(offset, axis=1) - cloud.radius).max() < 1e-9)
    True
    """

    points: Array
    normals: Array
    s: Array
    is_stray: BoolArray
    truth: CentreLine
    radius: float
    viewpoint: Array | None = None


def synth(
    shape: str | CentreLine = "bent",
    points: int = 5000,
    *,
    diameter: float = 0.04,
    seed: int = 0,
    length: float | None = None,
    bend_radius: float | None = None,
    camera: str | None = None,
    **sampling: Any,
) -> SyntheticCloud:
    """A cloud of a tube whose axis is known; `dlogen synth` writes the same points, rounded to 1e-7 m.

    Args:
        shape: one of the paper's Table I (bent, straight, helical, helical-printed), or random, loop, coil, hose; or a
            centre line.
        points: their number.
        diameter: of the tube, metres.
        seed: of everything random.
        length: of random, loop, coil (1.4 each) and hose (1.7), metres.
        bend_radius: smallest radius of curvature of random and hose, metres.
        camera: name of a sensor that sees the object on a table, a key of `dlogen.evaluation.sensors.models.SENSORS`
            (realsense-d435, kinect-v2, ...); None for points anywhere on the tube. It decides the number of points.
        sampling: further arguments of `sample_tube`: noise, stray_fraction, gaps, density_ratio, side, caps; or, with a
            camera, of `dlogen.evaluation.sensors.fusion.fused_cloud`: distance, tilt, mask_grow, holes, frames, views,
            registration, voxel, voxel_point, world.

    Returns:
        The points (M, 3) in metres with their true normals and coordinates, and the true axis. With a camera, in its
        frame and cut out by a mask; points in which the mask has the table are strays.

    Raises:
        ValueError: there is no such shape, or a size is not possible.

    >>> import dlogen, numpy as np
    >>> cloud = dlogen.synth("helical", points=1000, noise=0.001)
    >>> cloud.points.shape, round(cloud.truth.length, 3)
    ((1000, 3), 4.739)
    >>> rope = dlogen.synth("hose", length=1.0, bend_radius=0.08, diameter=0.006, camera="realsense-d435", mask_grow=1)
    >>> 0.4 < float(np.median(rope.points[:, 2])) < 0.5
    True
    """
    rng = np.random.default_rng(seed)
    line = shape
    if isinstance(line, str):
        line = shape_by_name(line, rng, diameter=diameter, length=length, bend_radius=bend_radius)
    if camera is None:
        return sample_tube(line, 0.5 * diameter, points, rng, **sampling)
    return _seen(line, 0.5 * diameter, camera, rng, sampling)


def _seen(
    line: CentreLine, radius: float, camera: str, rng: np.random.Generator, options: dict[str, Any]
) -> SyntheticCloud:
    """What a sensor sees, with the truth about each point: of the place on the axis that is nearest to it."""
    from dlogen.evaluation.sensors.fusion import fused_cloud

    cloud = fused_cloud(line, radius, camera, seed=rng, **options)
    s, _ = cloud.line.nearest(cloud.points)
    normals = unit(cloud.points - cloud.line(s))
    stray = ~cloud.is_object
    normals[stray], s[stray] = np.nan, np.nan
    return SyntheticCloud(cloud.points, normals, s, stray, cloud.line, radius, cloud.viewpoint)


def sample_tube(
    line: CentreLine,
    radius: float,
    count: int,
    rng: np.random.Generator | int,
    *,
    noise: float = 0.0,
    stray_fraction: float = 0.0,
    gaps: Sequence[tuple[float, float]] = (),
    density_ratio: float = 1.0,
    side: npt.ArrayLike | None = None,
    caps: bool = False,
) -> SyntheticCloud:
    """Random points on the surface of the tube around a line (the virtual clouds of the paper's IV.B).

    Points are uniform in arc length and in the angle around the axis.

    Args:
        line: the axis.
        radius: of the tube, metres.
        count: number of points, whatever the defects.
        rng: generator or seed.
        noise: standard deviation of each coordinate, metres.
        stray_fraction: share of the points that lie anywhere in the bounding box of the tube, padded by a tenth of
            its longest side.
        gaps: intervals (s0, s1) without points.
        density_ratio: density at s = 1 over density at s = 0; linear in between.
        side: (3,) direction in which a far viewer looks; only points whose surface faces them remain.
        caps: whether the flat ends have points, at the density of the rest.

    Raises:
        ValueError: a parameter out of range, or gaps that leave nothing.
    """
    if radius <= 0 or count < 0 or noise < 0 or not 0 <= stray_fraction <= 1 or density_ratio <= 0:
        raise ValueError("radius and density ratio must be positive, noise not negative, the stray fraction in [0, 1]")
    rng = np.random.default_rng(rng)
    strays = round(stray_fraction * count)
    s = _draw_coordinates(rng.random(count - strays), gaps, density_ratio)
    tangents = line.tangents(s)
    normals = _draw_normals(rng.random(count - strays), tangents, side)
    points = line(s) + radius * normals
    if caps:
        _put_on_caps(rng, line, radius, side, s, tangents, normals, points)
    points += rng.normal(scale=noise, size=points.shape) if noise else 0.0

    if strays:
        axis = line.points(2000)
        low, high = axis.min(axis=0) - radius, axis.max(axis=0) + radius
        pad = 0.1 * (high - low).max()
        points = np.concatenate([points, rng.uniform(low - pad, high + pad, size=(strays, 3))])
        normals = np.concatenate([normals, np.full((strays, 3), np.nan)])
        s = np.concatenate([s, np.full(strays, np.nan)])
        order = rng.permutation(count)
        points, normals, s = points[order], normals[order], s[order]
    return SyntheticCloud(points, normals, s, np.isnan(s), line, radius)


def _draw_coordinates(uniform: Array, gaps: Sequence[tuple[float, float]], ratio: float) -> Array:
    """Material coordinates with density 1 + (ratio - 1) s outside the gaps, by inversion: uniform (K,) -> (K,)."""
    edges = [0.0]
    for start, end in sorted(gaps):
        if not 0 <= start < end <= 1:
            raise ValueError(f"gap {start}:{end} is not an interval within [0, 1]")
        edges += [max(start, edges[-1]), max(end, edges[-1])]
    low, high = np.array(edges[::2]), np.array([*edges[1::2], 1.0])
    grow = ratio - 1.0

    def cumulative(s: Array) -> Array:
        return (s + grow * s**2 / 2) / (1 + grow / 2)

    mass = np.concatenate([[0.0], np.cumsum(cumulative(high) - cumulative(low))])
    if mass[-1] <= 0:
        raise ValueError("the gaps leave nothing of the object")
    kept = uniform * mass[-1]
    i = np.clip(np.searchsorted(mass, kept, side="right") - 1, 0, len(low) - 1)
    share = cumulative(low)[i] + kept - mass[i]
    if grow == 0:
        s = share
    else:
        s = (np.sqrt(1 + share * grow * (2 + grow)) - 1) / grow
    inside: Array = np.clip(s, low[i], high[i])
    return inside


def _draw_normals(uniform: Array, tangents: Array, side: npt.ArrayLike | None) -> Array:
    """Unit vectors across the tangents, at any angle or within the half circle that faces the viewer."""
    if side is None:
        # Any direction across will do, since the angle is uniform: start from the axis least along the tangent.
        towards = np.eye(3)[np.abs(tangents).argmin(axis=1)]
        angle = 2 * np.pi * uniform
    else:
        towards = np.broadcast_to(-_unit_vector(side), tangents.shape)
        angle = np.pi * (uniform - 0.5)
    across = towards - tangents * dots(towards, tangents)[:, None]
    norm = np.linalg.norm(across, axis=1, keepdims=True)
    if (norm < 1e-9).any():
        raise ValueError("the viewer looks exactly along the object: choose another side")
    across /= norm
    normals: Array = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(tangents, across)
    return normals


def _unit_vector(direction: npt.ArrayLike) -> Array:
    vector = np.asarray(direction, dtype=float)
    norm = np.linalg.norm(vector) if vector.shape == (3,) and np.isfinite(vector).all() else 0.0
    if norm == 0:
        raise ValueError("a direction needs three finite numbers, not all of them zero")
    return vector / norm


def _put_on_caps(
    rng: np.random.Generator,
    line: CentreLine,
    radius: float,
    side: npt.ArrayLike | None,
    s: Array,
    tangents: Array,
    normals: Array,
    points: Array,
) -> None:
    """Move a share of the points (in place) to the flat ends: as many as their part of the visible area."""
    ends = np.array([0.0, 1.0])
    outward = line.tangents(ends) * np.array([[-1.0], [1.0]])
    visible = np.ones(2, dtype=bool) if side is None else outward @ _unit_vector(side) < 0
    mantle = 2 * np.pi * radius * line.length * (1.0 if side is None else 0.5)
    cap = np.pi * radius**2 * visible
    which = rng.choice(3, size=len(s), p=np.array([mantle, *cap]) / (mantle + cap.sum())) - 1
    at = np.flatnonzero(which >= 0)
    end = which[at]
    # A direction across the end's tangent, drawn anew: the old one belongs to another tangent, or to half a circle.
    across = _draw_normals(rng.random(len(at)), outward[end], None)
    rho = radius * np.sqrt(rng.random((len(at), 1)))
    s[at] = ends[end]
    points[at] = line(ends)[end] + rho * across
    normals[at] = outward[end]


def truth(line: CentreLine, radius: float, settings: dict[str, Any], seed: int | None) -> dict[str, Any]:
    """What is known about a synthetic object, as it stands in a truth file.

    Schema `dlogen.truth/1`, all lengths in metres:
        schema: "dlogen.truth/1".
        units: "m", whatever the units of the cloud are.
        curve: name of the centre line.
        radius: of the tube.
        length: arc length of the centre line.
        points: [[x, y, z] x 1000] on the centre line, even in arc length, from end to end.
        settings: how the cloud was made.
        seed: of the random numbers, or null.

    Numbers are rounded to 1e-9 m, so that the last bit of another machine's sine does not show.
    """
    return {
        "schema": "dlogen.truth/1",
        "units": "m",
        "curve": line.name,
        "radius": radius,
        "length": round(line.length, 9),
        "settings": settings,
        "seed": seed,
        # Adding zero turns -0.0 into 0.0.
        "points": (np.round(line.points(1000), 9) + 0.0).tolist(),
    }


def truth_bytes(content: dict[str, Any]) -> bytes:
    """The truth file for `truth`: JSON with one point per line."""
    head = {key: value for key, value in content.items() if key != "points"}
    text = json.dumps(head, indent=2, ensure_ascii=False, allow_nan=False)
    rows = ",\n    ".join(json.dumps(point, allow_nan=False) for point in content["points"])
    return f'{text[:-2]},\n  "points": [\n    {rows}\n  ]\n}}\n'.encode()
