"""One centre line of each kind."""

from __future__ import annotations

from dlogen.evaluation.centre_line import CentreLine, from_points
from dlogen.evaluation.shapes import (
    centre_line,
    coil_centre_line,
    hose_centre_line,
    loop_centre_line,
    random_centre_line,
)

LINES: dict[str, CentreLine] = {
    **{name: centre_line(name) for name in ("bent", "straight", "helical")},
    "random": random_centre_line(3, clearance=0.06),
    "loop": loop_centre_line(),
    "coil": coil_centre_line(),
    "hose": hose_centre_line(),
    "points": from_points(centre_line("bent").points(40)),
}
