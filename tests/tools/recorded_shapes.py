"""How fits of recorded cable shapes turn out: `python tests/tools/recorded_shapes.py DIR [--view X,Y,Z]... [--known]`.

DIR is a git directory of the public repository roahmlab/DEFORM, whose `data_set/DLO*/{train,eval}/*.pkl` hold the
places of motion capture markers along five cables. A spline through the markers of a frame is skinned on the side that
a far viewer sees; what lies behind another part of the cable is hidden. Right means that the order is right, the length
of the seen part within 2 % and the line near the axis, or that the line is right as far as it goes and a finding says
that it may be short.
"""

from __future__ import annotations

import argparse
import io
import pickle
import subprocess
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import dlogen
from dlogen.errors import DlogenError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.synthetic import sample_tube
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import arc_lengths, resample
from dlogen.types import Array

#: Frames of each of the five cables, points and their noise (metres), and radii (metres).
_FRAMES, _POINTS, _NOISE, _RADII = 9, 5000, 0.0003, (0.004, 0.008)

#: No cable lies along markers whose line bends tighter than this, metres: they were mixed up.
_BENDS = 0.016

#: How a finding says that the line may be shorter than the object.
_SHORT = {"end-not-seen", "end-cut-off", "gap", "left-over", "several-objects", "length-mismatch"}


class _PlainUnpickler(pickle.Unpickler):
    """Reads lists, numbers and numpy arrays, and nothing that runs code."""

    def find_class(self, module: str, name: str) -> Any:
        if module.split(".")[0] == "numpy" and name in ("_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer"):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is not allowed")


def recorded_frames(directory: str, cable: int, count: int) -> list[Array]:
    """Places of the markers of a cable in some frames spread over its recordings: arrays (K, 3), metres.

    Frames in which markers were mixed up, so that no cable can lie along them, are passed over.
    """

    def git(*arguments: str) -> bytes:
        return subprocess.run(["git", "-C", directory, *arguments], capture_output=True, check=True).stdout

    names = git("ls-tree", "-r", "--name-only", "HEAD", f"data_set/DLO{cable}").decode().split()
    names = sorted(name for name in names if name.endswith(".pkl"))
    frames = []
    for k in range(count):
        # Where markers were mixed up they are so in most of a recording: the next one is taken.
        for name in names[(k * len(names)) // count :]:
            recording = np.asarray(_PlainUnpickler(io.BytesIO(git("show", f"HEAD:{name}"))).load(), dtype=float)
            markers = recording[(37 + 97 * k) % len(recording)].T
            if tightest_bend(markers) > _BENDS:
                frames.append(markers)
                break
    return frames


def tightest_bend(markers: Array) -> float:
    """Smallest radius of curvature of the line through markers (K, 3), metres."""
    points = through_markers(markers).points(1000)
    along = arc_lengths(points)
    tangents = np.gradient(points, along, axis=0)
    return 1.0 / float(np.linalg.norm(np.gradient(tangents, along, axis=0), axis=1).max())


def through_markers(markers: Array) -> CentreLine:
    """A smooth line through markers (K, 3)."""
    return from_points(markers)


def visible(points: Array, axis: Array, radius: float, view: Array) -> Array:
    """Which points a far viewer sees who looks along `view`: no part of the tube is before them."""
    across = np.linalg.svd(view[None])[2][1:]
    near = cKDTree(axis @ across.T).query_ball_point(points @ across.T, 0.97 * radius)
    depth, own = axis @ view, points @ view
    return np.array([not any(depth[i] < at - 1.5 * radius for i in rows) for rows, at in zip(near, own, strict=True)])


@dataclass(frozen=True)
class Case:
    """A skinned shape: its points, axis, radius, and which stretch of the axis (s0, s1) has points."""

    name: str
    points: Array
    axis: Array
    radius: float
    view: Array
    seen: tuple[float, float]
    hidden: float


def cut(points: Array, line: CentreLine, view: Array, kind: int, rng: np.random.Generator) -> Array:
    """Which points remain when the image ends before an end of the line (0), or a strip hides a stretch (1, 2)."""
    across = np.linalg.svd(view[None])[2][1:]
    last = bool(rng.random() < 0.5)
    at, width = ((rng.uniform(0.05, 0.3), np.inf), (rng.uniform(0.1, 0.2), 0.06), (0.5, rng.uniform(0.1, 0.3)))[kind]
    at = 1.0 - at if last else at
    tangent = across @ line.tangents(np.array([at]))[0] * (1.0 if last else -1.0)
    turn = rng.uniform(-0.8, 0.8)
    normal = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ tangent
    beyond = ((points - line(np.array([at]))) @ across.T) @ (normal / np.linalg.norm(normal))
    return (beyond < -0.5 * width) | (beyond > 0.5 * width) if np.isfinite(width) else beyond < 0.0


def cases(directory: str, view: Array, pixels: bool, cuts: bool) -> list[Case]:
    """The skinned shapes; with `pixels`, points are as dense in the view as pixels are, not on the surface."""
    view = view / np.linalg.norm(view)
    result = []
    for cable in range(1, 6):
        for k, markers in enumerate(recorded_frames(directory, cable, _FRAMES)):
            rng = np.random.default_rng([cable, k])
            radius = float(rng.uniform(*_RADII))
            line = through_markers(markers)
            cloud = sample_tube(line, radius, _POINTS * (2 if pixels else 1), rng, noise=_NOISE, side=view)
            axis = line.points(3000)
            kept = visible(cloud.points, axis, radius, view)
            if pixels:
                kept &= -cloud.normals @ view > rng.random(len(kept))
            if cuts:
                kept &= cut(cloud.points, line, view, k % 3, rng)
            s = cloud.s[kept]
            counts = np.bincount((s * 200).astype(int).clip(0, 199), minlength=200)
            seen = np.flatnonzero(counts >= 3)
            ends = (float(np.partition(s, 1)[1]), float(np.partition(s, -2)[-2]))
            hidden = float(np.mean(counts[seen[0] : seen[-1] + 1] < 3))
            result.append(Case(f"DLO{cable}/{k}", cloud.points[kept], axis, radius, view, ends, hidden))
    return result


def judge(case: Case, known: bool, settings: dict[str, Any]) -> tuple[str, str, str]:
    """How a fit turns out (right, short or wrong), its verdict, and words about it."""
    distance = 100.0 if known else None
    viewpoint = None if distance is None else case.points.mean(axis=0) - distance * case.view
    try:
        result = dlogen.fit(dlogen.Cloud(case.points, viewpoint=viewpoint), settings)
    except DlogenError as error:
        return "wrong", "refused", str(error).splitlines()[0]
    length = float(np.linalg.norm(np.diff(case.axis, axis=0), axis=1).sum())
    line = resample(result.skeleton_points, 500)
    allowed = 0.3 * case.radius + 0.0005
    apart, at = cKDTree(case.axis).query(line)
    first, last = case.seen
    due = case.axis[int(first * 2999) : int(np.ceil(last * 2999)) + 1]
    share = result.skeleton.length / (length * (last - first)) - 1.0
    reached = np.sort(at[[0, -1]])
    covered = case.axis[reached[0] : reached[1] + 1]

    def in_order(other: Array) -> bool:
        ways = (resample(other, 500), resample(other[::-1], 500))
        return min(float(np.max(mdtw(line, way).error)) for way in ways) < max(5.0 * case.radius, 0.015)

    codes = Counter(item.code + ("" if not item.is_note else "(note)") for item in result.quality.findings)
    near = apart.mean() <= allowed
    right = near and abs(share) < 0.02 and in_order(due)
    said = {item.code for item in result.quality.findings} & _SHORT
    short = near and len(covered) > 10 and in_order(covered) and bool(said) and share < 0.02
    text = (
        f"r {1e3 * case.radius:.1f} mm, L {100.0 * share:+.1f} % of {100.0 * (last - first):.0f} % seen, hidden inside "
        f"{100.0 * case.hidden:.0f} %, reaches {reached[0] / 29.99:.1f} to {reached[1] / 29.99:.1f} %, mean "
        f"{1e3 * apart.mean():.2f} of {1e3 * allowed:.2f} mm, max {1e3 * apart.max():.1f}, "
        f"r {1e3 * result.chain.radius:.2f}, {dict(codes)}"
    )
    return "right" if right else "short" if short else "wrong", result.quality.verdict, text


def main() -> None:
    """Fit them all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory")
    parser.add_argument("--view", action="append", help="direction in which the viewer looks, X,Y,Z")
    parser.add_argument("--known", action="store_true", help="tell the fit where the viewer is")
    parser.add_argument("--pixels", action="store_true", help="points as dense in the view as pixels are")
    parser.add_argument("--cuts", action="store_true", help="cut off an end, or hide a stretch")
    parser.add_argument("--given", action="store_true", help="give the radius")
    parser.add_argument("--all", action="store_true", help="print those that are right, too")
    options = parser.parse_args()
    for text in options.view or ["0.3,0.8,-0.5"]:
        view = np.array([float(number) for number in text.split(",")])
        counts: Counter[tuple[str, str]] = Counter()
        for case in cases(options.directory, view, options.pixels, options.cuts):
            how, verdict, words = judge(case, options.known, {"r": case.radius} if options.given else {})
            counts[how, verdict] += 1
            if options.all or how != "right":
                print(f"  {case.name} {how} {verdict} {words}", flush=True)
        fine = sum(number for (how, _), number in counts.items() if how != "wrong")
        wrong = {verdict: number for (how, verdict), number in counts.items() if how == "wrong"}
        print(f"view {text}: {fine} right or honestly short ({dict(counts)}), wrong {wrong}", flush=True)


if __name__ == "__main__":
    main()
