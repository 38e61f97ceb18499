"""How fits of simulated captures turn out.

    python tests/tools/sensor_sweep.py [--sensor NAME]... [--count N] [--seed N] [--given]

Each capture has a random shape on a table, radius, distance, tilt, mask and holes. Right means that the order is right
and the length within 2 %. Prints a line for each capture that is not right or whose verdict misleads, and totals.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

import dlogen
from dlogen.errors import DlogenError
from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.sensors.capture import SensorCloud, sensor_cloud
from dlogen.evaluation.sensors.models import SENSORS
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import resample
from dlogen.types import Array

#: Beyond this distance the noise on a thin strand is more than the strand, metres.
_FARTHEST = {"realsense-d435": 0.8}


@dataclass(frozen=True)
class Outcome:
    """One capture and what came of it."""

    name: str
    crossing: bool
    right: bool
    verdict: str
    mean: float  # distance to the axis, metres
    allowed: float
    radius_right: bool
    seconds: float
    points: int
    text: str
    covered: float = 0.0


def random_shape(rng: np.random.Generator, radius: float, crossing: bool) -> tuple[CentreLine, int]:
    """A line on a table with bends of at least six radii, and how often it crosses itself (the later pass on top)."""
    while True:
        length = float(rng.uniform(0.5, 1.5)) * float(np.clip(radius / 0.005, 0.6, 1.6))
        s = np.linspace(0.0, length, 2000)
        angle = rng.uniform(0.0, 2.0 * np.pi) + (
            rng.choice([-1.0, 1.0]) * rng.uniform(4.5, 7.0) * s / length if crossing else 0.0
        )
        for k in range(1, 5):
            angle = angle + rng.normal(0.0, 0.9 / k) * np.sin(np.pi * k * s / length + rng.uniform(0.0, 2.0 * np.pi))
        step = s[1]
        if np.abs(np.diff(angle)).max() / step > 1.0 / max(6.0 * radius, 0.02):
            continue
        x, y = (np.cumsum(f(angle)) * step for f in (np.cos, np.sin))
        z = np.zeros_like(x)
        flat = np.stack([x, y], axis=1)
        pairs = cKDTree(flat).query_pairs(3.2 * radius, output_type="ndarray")
        apart = np.abs(s[pairs[:, 1]] - s[pairs[:, 0]]) > 12.0 * radius
        pairs = np.sort(pairs[apart], axis=1)
        if (len(pairs) > 0) != crossing:
            continue
        times = 0
        if crossing:
            order = np.argsort(pairs[:, 1])
            groups = np.split(pairs[order], np.flatnonzero(np.diff(pairs[order, 1]) > 20) + 1)
            # Clear crossings only: strands that lie along each other are something else.
            if any(np.ptp(s[group[:, 1]]) > 14.0 * radius for group in groups) or len(groups) > 2:
                continue
            times = len(groups)
            for group in groups:
                at = s[group[:, 1]].mean()
                if min(at, length - at) < 20.0 * radius:
                    times = -1
                    break
                z = z + 2.3 * radius * np.exp(-0.5 * ((s - at) / (8.0 * radius)) ** 2)
            if times < 0:
                continue
        z = z + rng.uniform(0.0, 0.02) * np.sin(np.pi * s / length) ** 2
        if max(np.ptp(x), np.ptp(y)) > 0.75:
            continue
        return from_points(np.stack([x, y, z], axis=1)), times


def capture_of(name: str, seed: int) -> tuple[SensorCloud, bool, str]:
    """A random capture by a sensor."""
    rng = np.random.default_rng([seed, sum(map(ord, name))])
    sensor = SENSORS[name]
    while True:
        crossing = bool(rng.random() < 0.3)
        radius = float(np.exp(rng.uniform(np.log(0.0015), np.log(0.02))))
        line, _ = random_shape(rng, radius, crossing)
        distance = float(rng.uniform(0.45, _FARTHEST.get(name, 1.2))) if sensor.pitch is None else sensor.usual
        settings = {
            "distance": max(distance, sensor.nearest + 0.1),
            "tilt": float(rng.uniform(0.0, 35.0)),
            "mask_grow": int(rng.choice([-1, 0, 0, 1, 2])),
            "holes": float(rng.choice([0.0, 0.0, 0.05, 0.1])),
            "world": bool(rng.random() < 0.3),
        }
        try:
            cloud = sensor_cloud(line, radius, sensor, seed=rng, **settings)
        except DlogenError:
            continue
        # A wire that the sensor hardly sees, or sees a part of only, is not asked for.
        if len(cloud.points) < 100 or covered(cloud) < 0.9:
            continue
        words = f"r {1e3 * radius:.1f} mm, " + ", ".join(
            f"{k} {v:.2g}" if isinstance(v, float) else f"{k} {v}" for k, v in settings.items()
        )
        return cloud, crossing, words


def covered(cloud: SensorCloud) -> float:
    """Share of the line that has points beside it; zero where an end has none within a hundredth of the length."""
    line = cloud.line.points(400)
    own = cloud.points[cloud.is_object]
    if len(own) == 0:
        return 0.0
    seen = np.bincount(cKDTree(line).query(own)[1], minlength=400) > 0
    # The outermost places are nearest to all that is beyond them.
    ends = seen[1:4].any() and seen[-4:-1].any()
    holes = np.convolve(seen, np.ones(5), "same") > 0
    return float(holes.mean()) if ends else 0.0


def judge(name: str, seed: int, given: bool = False) -> Outcome:
    """Fit one capture, and compare."""
    cloud, crossing, words = capture_of(name, seed)
    truth = cloud.line.points(2000)
    viewed = dlogen.Cloud(cloud.points, viewpoint=cloud.viewpoint[:3])
    begin = time.perf_counter()
    allowed = 0.3 * cloud.radius + 0.0005
    try:
        result = dlogen.fit(viewed, {"r": cloud.radius} if given else {})
    except DlogenError as error:
        return Outcome(
            name,
            crossing,
            False,
            "refused",
            np.nan,
            allowed,
            True,
            time.perf_counter() - begin,
            len(cloud.points),
            f"{words}: {error}",
            covered(cloud),
        )
    seconds = time.perf_counter() - begin
    line = result.skeleton_points
    right, length = order_right(line, truth, cloud.radius), float(np.linalg.norm(np.diff(truth, axis=0), axis=1).sum())
    share = result.skeleton.length / length - 1.0
    distance = cKDTree(truth).query(line)[0]
    unknown = any(item.code == "radius-unknown" for item in result.quality.findings)
    radius_right = unknown or abs(result.chain.radius / cloud.radius - 1.0) < 0.15
    codes = [item.code for item in result.quality.findings if not item.is_note]
    text = (
        f"{words}: {len(cloud.points)} points, L {100 * share:+.1f} %, order {'right' if right else 'WRONG'}, mean "
        f"{1e3 * distance.mean():.2f} of {1e3 * allowed:.2f} mm, r {1e3 * result.chain.radius:.2f}"
        f"{'?' if unknown else ''} mm, {codes}"
    )
    return Outcome(
        name,
        crossing,
        right and abs(share) < 0.02,
        result.quality.verdict,
        float(distance.mean()),
        allowed,
        radius_right,
        seconds,
        len(cloud.points),
        text,
        covered(cloud),
    )


def order_right(line: Array, truth: Array, radius: float) -> bool:
    """Whether going along the one is going along the other: matched in order, they are nowhere apart."""
    one, other = resample(line, 500), resample(truth, 500)
    apart = min(float(np.max(mdtw(one, way).error)) for way in (other, other[::-1]))
    return apart < max(5.0 * radius, 0.015)


def summary(name: str, outcomes: list[Outcome]) -> str:
    """One line for a sensor."""
    right = [outcome for outcome in outcomes if outcome.right]
    crossings = [outcome.right for outcome in outcomes if outcome.crossing]
    figures = {
        "right": f"{len(right)} of {len(outcomes)} (crossings {sum(crossings)} of {len(crossings)})",
        "bad among the right": sum(outcome.verdict == "bad" for outcome in right),
        "wrong and good": sum(outcome.verdict == "good" and not outcome.right for outcome in outcomes),
        "far from the axis": sum(outcome.mean > outcome.allowed for outcome in right),
        "radius off": sum(not outcome.radius_right for outcome in right),
        "good": sum(outcome.verdict == "good" for outcome in right),
        "seconds": f"{np.median([outcome.seconds for outcome in outcomes]):.2f}",
    }
    return f"{name}: " + ", ".join(f"{key} {value}" for key, value in figures.items())


def main() -> None:
    """Run the sweep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sensor", action="append")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--given", action="store_true", help="give the radius")
    options = parser.parse_args()
    for name in options.sensor or SENSORS:
        outcomes = []
        for seed in range(options.seed, options.seed + options.count):
            outcome = judge(name, seed, options.given)
            outcomes.append(outcome)
            misleading = outcome.verdict in ("bad", "refused") or not outcome.radius_right
            if misleading or not outcome.right or outcome.mean > outcome.allowed:
                how = "right" if outcome.right else "WRONG"
                print(f"  {seed:4d} {how} {outcome.verdict} {outcome.text}", flush=True)
        print(summary(name, outcomes), flush=True)


if __name__ == "__main__":
    main()
