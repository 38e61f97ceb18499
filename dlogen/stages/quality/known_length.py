"""Whether the line is as long as the object is known to be."""

from __future__ import annotations

from dlogen.stages.quality.findings import LENGTH_MISMATCH
from dlogen.types import Finding

#: Difference from a known length that is reported, relative.
_DIFFERENT = 0.03


def check_length(length: float, known: float | None) -> list[Finding]:
    """Whether a known length contradicts the line.

    Args:
        length: of the line, metres.
        known: of the object, metres; None if it is not known.
    """
    if known is None or abs(length - known) <= _DIFFERENT * known:
        return []
    how = "shorter" if length < known else "longer"
    message = (
        f"the line is {length:.4g} m long, {100.0 * abs(length / known - 1.0):.3g} % {how} than the known length of "
        f"{known:.4g} m"
    )
    return [LENGTH_MISMATCH.found(message)]
