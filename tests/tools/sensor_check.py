"""Real frames of a rope beside simulated ones: what the noise is like, how wide the strip is.

    python tests/tools/sensor_check.py DIR [--radius METRES] [--frames N]

DIR has frames NAME.npy, (M, 3) in metres, in the frame of a RealSense D435 with the colour image's pixels, and a few
points along each rope as NAME_nodes.npy, (K, 3), from end to end. Each frame gets a simulated one: a rope along the same
nodes, seen by the sensor of the table from where it was.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.capture import sensor_cloud
from dlogen.geometry.polyline import resample

FOCAL = 918.4
#: Both ends of the real rope have a connector; they are left out.
_ENDS = (0.22, 0.85)
#: Distance between the knots of the line that is taken for the rope's own shape, metres.
_KNOTS = 0.06


def smooth(s: np.ndarray, values: np.ndarray, length: float) -> np.ndarray:
    """Least squares cubic spline with a knot every `_KNOTS`: what the rope itself does."""
    from scipy.interpolate import make_lsq_spline

    order = np.argsort(s)
    s, values = s[order], values[order]
    inner = np.linspace(s[0], s[-1], max(2, round((s[-1] - s[0]) / _KNOTS)) + 1)[1:-1]
    knots = np.r_[[s[0]] * 4, inner, [s[-1]] * 4]
    fitted = np.empty(len(s))
    fitted[order] = make_lsq_spline(s, values, knots)(s)
    return fitted


def flat_coordinates(points: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arc length in metres and distance across in pixels of the colour image, seen from the camera."""
    scale = np.median(points[:, 2])
    flat = np.c_[points[:, :2] / points[:, 2:] * scale, np.zeros(len(points))]
    line = np.c_[nodes[:, :2] / nodes[:, 2:] * scale, np.zeros(len(nodes))]
    for _ in range(3):
        curve = from_points(resample(line, max(8, round(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() / 0.03))))
        s, _ = curve.nearest(flat)
        foot, tangent = curve(s), curve.tangents(s)
        offset = flat - foot
        across = tangent[:, 0] * offset[:, 1] - tangent[:, 1] * offset[:, 0]
        near = (np.abs(across) < 0.012) & (s > 0) & (s < 1)
        # The middle of the strip, not that of the nodes, is where the rope is.
        at = np.linspace(0.0, 1.0, 120)
        shift = np.interp(at, *_binned(s[near], across[near], 60))
        tangent = curve.tangents(at)
        line = curve(at) + shift[:, None] * np.c_[-tangent[:, 1], tangent[:, 0], np.zeros(len(at))]
    return s * curve.length, across * FOCAL / scale


def _binned(s: np.ndarray, values: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    bins = np.clip((s * count).astype(int), 0, count - 1)
    filled = np.flatnonzero(np.bincount(bins, minlength=count))
    middle = [0.5 * (np.percentile(values[bins == b], 3) + np.percentile(values[bins == b], 97)) for b in filled]
    return (filled + 0.5) / count, np.array(middle)


def figures(points: np.ndarray, nodes: np.ndarray) -> dict[str, float]:
    """The figures of one frame; lengths in mm, pixels of the colour image."""
    s, across = flat_coordinates(points, nodes)
    length = s.max()
    used = (s > _ENDS[0] * length) & (s < _ENDS[1] * length) & (np.abs(across) < 16)
    s, across, z = s[used], across[used], points[used, 2]
    residual = 1e3 * (z - smooth(s, z, length))
    pixel = np.median(z) / FOCAL
    rows = ((s - s.min()) / pixel).astype(int)
    columns = np.round(across).astype(int) + 20
    count, total = np.zeros((rows.max() + 1, 41)), np.zeros((rows.max() + 1, 41))
    np.add.at(count, (rows, columns), 1)
    np.add.at(total, (rows, columns), residual)
    grid = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    width = count.sum(axis=1)
    profile = [np.nanmean(residual[np.abs(np.abs(across) - d) < 0.5]) for d in (0, 2, 4, 6)]
    steps = np.diff(np.unique(np.round(points[:, 2], 6)))
    mean = np.nanmean(grid, axis=1)
    found = {
        "points": len(points),
        "points per mm of strand": len(s) / (1e3 * (s.max() - s.min())),
        "width, px": float(np.median(width[width > 0])),
        "width, 5 %": float(np.percentile(width[width > 0], 5)),
        "width, 95 %": float(np.percentile(width[width > 0], 95)),
        "covered, %": 100.0 * float((width > 0).mean()),
        "depth step, mm": 1e3 * float(np.median(steps)),
        "std along ray, mm": float(residual.std()),
        "std of strip's mean": float(np.nanstd(mean)),
        "std within strip": float(np.sqrt(np.nanmean((grid - mean[:, None]) ** 2))),
        "largest, mm": float(np.abs(residual).max()),
        **{f"mean at {d} px across": float(v - profile[0]) for d, v in zip((2, 4, 6), profile[1:], strict=True)},
        "equal to neighbour, %": 100.0 * _equal(points),
    }
    for lag in (2, 5, 10, 15, 20, 30, 40, 60):
        found[f"corr. along, {lag} px"] = _correlation(grid[lag:], grid[:-lag])
    for lag in (1, 2, 4, 6, 8):
        found[f"corr. across, {lag} px"] = _correlation(grid[:, lag:], grid[:, :-lag])
    return found


def _equal(points: np.ndarray) -> float:
    column = np.round(points[:, 0] / points[:, 2] * FOCAL).astype(int)
    row = points[:, 1] / points[:, 2] * FOCAL
    order = np.lexsort((column, np.round(row)))
    pair = (np.diff(column[order]) == 1) & (np.abs(np.diff(row[order])) < 0.5)
    return float((np.diff(points[order, 2])[pair] == 0).mean())


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    both = np.isfinite(a) & np.isfinite(b)
    return float(np.mean(a[both] * b[both]) / np.sqrt(np.mean(a[both] ** 2) * np.mean(b[both] ** 2)))


def simulated(nodes: np.ndarray, radius: float, seed: int) -> tuple[np.ndarray, CentreLine]:
    """The same rope seen by the simulated sensor: points in its frame, true axis."""
    world = nodes * [1.0, -1.0, -1.0]
    for _ in range(3):  # without the noise of the nodes, but lifted where the rope was
        height = np.pad(world[:, 2], 2, mode="edge")
        world[:, 2] = np.convolve(height, np.full(5, 0.2), mode="valid")
    distance = float(-world[:, 2].min()) + radius
    axis = resample(world, 40)
    cloud = sensor_cloud(axis, radius, "realsense-d435", distance=distance, seed=seed)
    return cloud.points, cloud.line


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--radius", type=float, default=0.00265)
    parser.add_argument("--frames", type=int, default=100)
    options = parser.parse_args()
    real, made = [], []
    for seed, path in enumerate(sorted(options.folder.glob("*_nodes.npy"))[: options.frames]):
        nodes = np.load(path)
        real.append(figures(np.load(path.with_name(path.name.replace("_nodes", ""))), nodes))
        points, line = simulated(nodes, options.radius, seed)
        made.append(figures(points, line.points(40)))
    print(f"{'mean over ' + str(len(real)) + ' frames (least to largest)':<28}{'real':>28}{'simulated':>28}")
    for name in real[0]:
        cells = []
        for rows in (real, made):
            values = np.array([row[name] for row in rows])
            cells.append(f"{values.mean():.2f} ({values.min():.2f} to {values.max():.2f})")
        print(f"{name:<28}{cells[0]:>28}{cells[1]:>28}")


if __name__ == "__main__":
    main()
