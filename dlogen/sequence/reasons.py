"""Why captures of a recording are excluded, and what may be wrong with all of it: the codes in its report, explained.

Imports nothing heavy: `dlogen explain` reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from dlogen.stages.quality.findings import Explanation, declared

_declared: dict[str, Explanation] = {}

#: All of them by their codes.
REASONS: Mapping[str, Explanation] = MappingProxyType(_declared)


def _reason(code: str, meaning: str, what_to_do: str) -> Explanation:
    """Declare a reason."""
    return declared(_declared, Explanation(code, "sequence", meaning, what_to_do))


# Of single captures.

FAILED = _reason(
    "failed",
    "The frame is set aside, since it could not be fitted.",
    "Run dlogen fit on its cloud: the message says what is wrong.",
)
DOUBTFUL = _reason(
    "doubtful",
    "The frame is set aside, since the verdict on its own fit is doubtful or bad.",
    "Look at the findings that the message names; --keep-doubtful goes by doubtful frames as well.",
)
LENGTH = _reason(
    "length",
    "The frame is set aside, since its object is longer or shorter than that of the other frames.",
    "See whether a part of the object is hidden there, or something else is in view.",
)
RADIUS = _reason(
    "radius",
    "The frame is set aside, since its object is thicker or thinner than that of the other frames.",
    "Give r, or see whether something else is in view there.",
)
NOISE = _reason(
    "noise",
    "The frame is set aside, since its points scatter more than those of the other frames.",
    "See whether the object moved while the frame was taken; a few such frames do no harm.",
)
MOTION = _reason(
    "motion",
    "The frame is set aside, since its object is not where the frames before and after it say.",
    "See whether the line took a wrong way there; if the recording has a cut, give its parts one by one.",
)

# Of the recording.

SIZES = _reason(
    "sizes",
    "Lengths or radii differ so much that the frames may not be those of one object.",
    "Leave one object in the frames, and see to it that all of it is in view; give r if the radii differ.",
)
DIRECTION = _reason(
    "direction",
    "Which end is first may change from this frame on: the motion is about as smooth the other way round.",
    "Look at the motion there; more frames a second, or an object that is not as good as straight, make it certain.",
)
