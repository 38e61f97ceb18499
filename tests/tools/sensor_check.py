"""Real frames of a rope beside simulated ones: the noise, what of it neighbours share, the width of the strip.

    python tests/tools/sensor_check.py DIR [--radius METRES] [--sensor NAME]

DIR holds frames NAME.npy, (M, 3) in metres, in the frame of a camera whose depth is aligned to a colour image, and some
points along each rope as NAME_nodes.npy, (K, 3), from end to end, as a tracker gives them. Each frame gets a simulated
one: a rope along the same nodes, on a table, seen by the sensor from the same distance. Pixels are those of the colour
image. `realsense-d435` was set by seven frames of a rope of 1 m and about 5 mm, 0.46 m before the camera.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from dlogen.evaluation.centre_line import from_points
from dlogen.evaluation.sensors.capture import sensor_cloud
from dlogen.evaluation.sensors.models import SENSORS
from dlogen.geometry.polyline import resample
from dlogen.types import Array

#: Connectors and grippers are at the ends: figures are of the stretch between.
_STRETCH = (0.22, 0.85)
#: Distance between the knots of the line that is taken for the rope's own shape, metres.
_KNOTS = 0.06
#: Points farther from the middle of the strip are not the rope's, pixels.
_WIDEST = 16


def figures(points: Array, nodes: Array, radius: float, focal: float) -> dict[str, float]:
    """The figures of one frame.

    Args:
        points: (M, 3) metres, in the frame of the camera.
        nodes: (K, 3) along the rope.
        radius: of the rope, metres.
        focal: focal length of the image whose pixels the points are, pixels.
    """
    s, across = strip_coordinates(points, nodes, focal)
    length = s.max()
    used = (s > _STRETCH[0] * length) & (s < _STRETCH[1] * length) & (np.abs(across) < _WIDEST)
    s, across, depth = s[used], across[used], points[used, 2]
    residual = 1e3 * (depth - smooth(s, depth))
    pixel = float(np.median(depth)) / focal
    # One row for each pixel along the strand, one column for each across.
    row, column = ((s - s.min()) / pixel).astype(int), np.round(across).astype(int) + _WIDEST
    count, total = np.zeros((2, row.max() + 1, 2 * _WIDEST + 1))
    np.add.at(count, (row, column), 1.0)
    np.add.at(total, (row, column), residual)
    grid = np.where(count > 0, total / np.maximum(count, 1.0), np.nan)
    width = count.sum(axis=1)
    filled = width > 0
    mean = np.full(len(grid), np.nan)
    mean[filled] = np.nanmean(grid[filled], axis=1)
    profile = [float(np.median(residual[np.abs(np.abs(across) - d) < 0.5])) for d in (0, 5)]
    angle = np.degrees(np.abs(np.arctan2(across * pixel, np.maximum(radius - 1e-3 * residual, 1e-9))))
    return {
        "points": len(points),
        "points per mm of strand": len(s) / (1e3 * float(np.ptp(s))),
        "width, px: median": float(np.median(width[filled])),
        "width, px: 5 %": float(np.percentile(width[filled], 5)),
        "width, px: 95 %": float(np.percentile(width[filled], 95)),
        "rows with points, %": 100.0 * float(filled.mean()),
        "angle about axis: 95 %": float(np.percentile(angle, 95)),
        "depth step, mm": 1e3 * float(np.median(np.diff(np.unique(np.round(points[:, 2], 6))))),
        "residual, mm: std": float(residual.std()),
        "residual, mm: robust std": 1.4826 * float(np.median(np.abs(residual - np.median(residual)))),
        "of rows' means, mm": float(np.nanstd(mean)),
        "within rows, mm": float(np.sqrt(np.nanmean((grid - mean[:, None]) ** 2))),
        "edge below middle, mm": profile[1] - profile[0],
        "equal to neighbour, %": 100.0 * _equal(points, focal),
        **{f"correlation along, {lag} px": _correlation(grid[lag:], grid[:-lag]) for lag in (2, 5, 10, 15, 20, 30, 60)},
        **{f"correlation across, {lag} px": _correlation(grid[:, lag:], grid[:, :-lag]) for lag in (1, 2, 4, 6, 8)},
    }


def strip_coordinates(points: Array, nodes: Array, focal: float) -> tuple[Array, Array]:
    """Arc length in metres and distance across in pixels of each point, as seen in the image."""
    scale = float(np.median(points[:, 2]))

    def flat(places: Array) -> Array:
        return np.c_[places[:, :2] / places[:, 2:] * scale, np.zeros(len(places))]

    image, line = flat(points), flat(nodes)
    at = np.linspace(0.0, 1.0, 120)
    for _ in range(3):
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        curve = from_points(resample(line, max(8, round(length / 0.03))))
        s, _ = curve.nearest(image)
        tangent, offset = curve.tangents(s), image - curve(s)
        across = tangent[:, 0] * offset[:, 1] - tangent[:, 1] * offset[:, 0]
        # The middle of the strip, not that of the tracker, is where the rope is.
        near = (np.abs(across) < 0.012) & (s > 0) & (s < 1)
        shift = np.interp(at, *_middles(s[near], across[near], 60))
        normal = curve.tangents(at)[:, [1, 0, 2]] * [-1.0, 1.0, 0.0]
        line = curve(at) + shift[:, None] * normal
    return s * curve.length, across * focal / scale


def smooth(s: Array, values: Array) -> Array:
    """What the rope itself does: the least squares cubic spline with a knot every `_KNOTS`."""
    from scipy.interpolate import make_lsq_spline

    order = np.argsort(s)
    first, last = float(s.min()), float(s.max())
    inner = np.linspace(first, last, max(2, round((last - first) / _KNOTS)) + 1)[1:-1]
    spline = make_lsq_spline(s[order], values[order], np.r_[[first] * 4, inner, [last] * 4])
    fitted: Array = spline(s)
    return fitted


def _middles(s: Array, across: Array, count: int) -> tuple[Array, Array]:
    """Middle of the strip in `count` stretches, where they have points."""
    stretch = np.clip((s * count).astype(int), 0, count - 1)
    filled = np.flatnonzero(np.bincount(stretch, minlength=count))
    edges = [np.percentile(across[stretch == k], [3, 97]) for k in filled]
    return (filled + 0.5) / count, np.mean(edges, axis=1)


def _equal(points: Array, focal: float) -> float:
    """Share of the points whose neighbour in the row of the image has the same depth."""
    column, row = np.round(points[:, 0] / points[:, 2] * focal), points[:, 1] / points[:, 2] * focal
    order = np.lexsort((column, np.round(row)))
    pair = (np.diff(column[order]) == 1) & (np.abs(np.diff(row[order])) < 0.5)
    return float((np.diff(points[order, 2])[pair] == 0).mean())


def _correlation(a: Array, b: Array) -> float:
    """Of the pairs that are there."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    return float(np.mean(a * b) / np.sqrt(np.mean(a**2) * np.mean(b**2)))


def simulated(nodes: Array, radius: float, sensor: str, seed: int) -> tuple[Array, Array]:
    """The same rope seen by a sensor: points in its frame, and points on the true axis."""
    line = nodes * [1.0, -1.0, -1.0]
    for _ in range(3):  # without the noise of the nodes, but lifted where the rope was
        line[:, 2] = np.convolve(np.pad(line[:, 2], 2, mode="edge"), np.full(5, 0.2), mode="valid")
    distance = float(-line[:, 2].min()) + radius
    cloud = sensor_cloud(resample(line, 40), radius, sensor, distance=distance, seed=seed)
    return cloud.points, cloud.line.points(40)


def table(names: Iterable[str], real: list[dict[str, float]], made: list[dict[str, float]]) -> str:
    """The figures of real and simulated frames side by side: mean, least and largest."""
    lines = [f"{f'mean of {len(real)} (least to largest)':<30}{'real':>26}{'simulated':>26}"]
    for name in names:
        cells = ""
        for frames in (real, made):
            values = np.array([frame[name] for frame in frames])
            digits = 0 if values.max() > 1000 else 2
            cells += f"{values.mean():.{digits}f} ({values.min():.{digits}f} to {values.max():.{digits}f})".rjust(26)
        lines.append(f"{name:<30}{cells}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--radius", type=float, default=0.0025, help="of the rope, metres")
    parser.add_argument("--sensor", choices=SENSORS, default="realsense-d435")
    options = parser.parse_args()
    focal = SENSORS[options.sensor].colour_grid().focal[0]
    real, made = [], []
    for seed, path in enumerate(sorted(options.folder.glob("*_nodes.npy"))):
        nodes = np.load(path, allow_pickle=False)
        points = np.load(path.with_name(path.name.replace("_nodes", "")), allow_pickle=False)
        real.append(figures(points, nodes, options.radius, focal))
        made.append(figures(*simulated(nodes, options.radius, options.sensor, seed), options.radius, focal))
    if not real:
        parser.error(f"there is no NAME_nodes.npy in {options.folder}")
    print(table(real[0], real, made))


if __name__ == "__main__":
    main()
