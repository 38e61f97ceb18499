"""How often the units of a cloud can be told from its numbers: 500 clouds, each in m, mm, cm and inch.

    python tests/tools/units_figures.py

Cables and hoses of radius 1 to 40 mm, 20 to 400 radii long (log-uniform, 0.1 to 12 m), in the shapes of `dlogen synth`.
Compared are the guess from the extent (`units: auto`), one from the extent and the true radius (the most usual
thickness and length), and what the finding `units` says of a fit that takes the numbers for metres.
"""

from __future__ import annotations

import numpy as np

from dlogen.evaluation.synthetic import synth
from dlogen.geometry.units import guess_units
from dlogen.stages.quality.units import check_units

CLOUDS, SCALES = 500, {"m": 1.0, "mm": 0.001, "cm": 0.01, "inch": 0.0254}
SHAPES = ("bent", "helical", "straight")
#: The usual radius and length, metres, and the spread of their logarithms.
USUAL, SPREAD = (0.006, 1.2), (1.1, 1.0)


def by_size(length: float, radius: float) -> str:
    """The units in which a length and a radius are the most usual."""

    def unusual(scale: float) -> float:
        return sum(
            (np.log(value * scale / usual) / spread) ** 2
            for value, usual, spread in zip((radius, length), USUAL, SPREAD, strict=True)
        )

    return min(SCALES, key=lambda name: unusual(SCALES[name]))


def figures() -> dict[str, dict[str, int]]:
    """Right guesses of each kind by the true units, and what the finding says."""
    rng = np.random.default_rng(0)
    clouds = {shape: synth(shape, points=2000, seed=1) for shape in SHAPES}
    found = {name: {"extent": 0, "size": 0, "silent": 0, "doubtful": 0, "bad": 0} for name in SCALES}
    for _ in range(CLOUDS):
        cloud = clouds[SHAPES[rng.integers(len(SHAPES))]]
        radius = float(np.exp(rng.uniform(np.log(0.001), np.log(0.04))))
        slender = float(np.exp(rng.uniform(np.log(20.0), np.log(400.0))))
        length = float(np.clip(slender * radius, 0.1, 12.0))
        for name, scale in SCALES.items():
            points = cloud.points * (length / cloud.truth.length / scale)
            row = found[name]
            row["extent"] += guess_units(points) == name
            row["size"] += by_size(length / scale, radius / scale) == name
            said = check_units(length / scale, radius / scale, "m", "m", radius_given=False)
            row[said[0].severity if said else "silent"] += 1
    return found


if __name__ == "__main__":
    print("| units | right by extent | right by size | taken for m: nothing said | doubtful | bad |")
    print("|---|---|---|---|---|---|")
    for units, row in figures().items():
        print(f"| {units} | " + " | ".join(str(value) for value in row.values()) + " |")
