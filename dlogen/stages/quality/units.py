"""Whether the numbers of a cloud can be in the units that they were taken for.

A tube in centimetres is as slender as the same one in metres: what tells the units is that cables and hoses are thin
and short. The bands of centimetres, inches and millimetres overlap, so that no guess is right for all clouds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from dlogen.geometry.units import METRES
from dlogen.stages.quality.findings import UNITS
from dlogen.types import Finding

#: Radii and lengths that cables and hoses have, metres: what is beyond them can hardly be right.
_RADIUS, _LENGTH = (0.00025, 0.06), (0.02, 20.0)
#: Nobody scans cables as thick or as long as this.
_THICKEST, _LONGEST = 0.2, 50.0
#: Of units that fit, the one that makes the object as thick as most are is named, metres.
_USUAL = 0.005
#: Of guessed units, others that make the radius so much more unusual are no doubt: the logarithm of a factor.
_MORE = 1.5
#: Inches cannot be set, but are worth a hint.
_NAMES: Mapping[str, float] = {**METRES, "inch": 0.0254}


def check_units(length: float, radius: float, units: str, used: str, *, radius_given: bool) -> list[Finding]:
    """Whether other units fit the numbers of a cloud better, or as well where they were guessed.

    Args:
        length: of the object, metres.
        radius: of the object, metres.
        units: as set; "auto" has them guessed.
        used: what the numbers were taken for.
        radius_given: whether the user gave the radius in metres, which the cloud then agrees with.
    """
    others = _fitting(length / METRES[used], radius / METRES[used], used)
    possible = radius <= _RADIUS[1] and length <= _LENGTH[1]
    size = f"{length:.3g} m long with a radius of {1e3 * radius:.3g} mm"
    if units == "auto":
        message = f"the numbers of the cloud were taken for {used}: the object is {size}"
        # Metres are what most clouds are in, and what they are taken for unless they cannot be.
        others = [name for name in others if _unusual(radius * _NAMES[name] / METRES[used]) < _unusual(radius) + _MORE]
        if radius_given or not others or (used == "m" and possible):
            return [UNITS.found(message, "note")]
        return [UNITS.found(f"{message}; {_asked(others, length / METRES[used])}", "doubtful")]
    if radius_given or possible:
        return []
    lost = radius > _THICKEST or length > _LONGEST
    message = f"the object would be {size}: its numbers can hardly be {used}"
    wanted = _asked(others, length / METRES[used]) if others else "set units to what they are, or give r"
    return [UNITS.found(f"{message}; {wanted}", "bad" if lost else "doubtful")]


def _fitting(length: float, radius: float, used: str) -> list[str]:
    """Other units that make an object of a usual size of these numbers, the most usual first."""
    fits = [
        name
        for name, scale in _NAMES.items()
        if name != used and _RADIUS[0] <= radius * scale <= _RADIUS[1] and _LENGTH[0] <= length * scale <= _LENGTH[1]
    ]
    return sorted(fits, key=lambda name: _unusual(radius * _NAMES[name]))


def _unusual(radius: float) -> float:
    """How far a radius in metres is from the usual one: the logarithm of their ratio, without its sign."""
    return abs(math.log(radius / _USUAL))


def _asked(others: list[str], length: float) -> str:
    """What to set, from the units that fit."""
    sizes = " or ".join(f"{length * _NAMES[name]:.3g} m in {name}" for name in others)
    settable = [name for name in others if name in METRES]
    return f"it would be {sizes}: " + (f"set units (--set units={settable[0]})" if settable else "convert it to metres")
