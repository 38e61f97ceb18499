"""Whether the cross-section is the circle that the model has, and enough of it was seen to say so."""

from __future__ import annotations

import numpy as np

from dlogen.stages.quality.findings import NOT_ROUND, RADIUS_UNKNOWN
from dlogen.stages.quality.section import Ellipse, Misfit, Section, ellipse_through, misfit, pooled_section
from dlogen.types import Array, Finding, Skeleton
from dlogen.types.texts import millimetres

#: Height over width, or width over height, below which a section is not round; and by how many standard deviations.
_ROUND, _SURE = 0.86, 2.0

#: What a section is off the nearest circle counts if it is so many times what chance explains. Such a section is no
#: circle, oval or not, beyond this share of the radius and of the noise.
_BY_CHANCE, _NO_CIRCLE, _NO_NOISE = 1.5, 0.05, 0.4

#: How far around from the middle one view sees a round object, and how far it sees it clearly, radians: the pixels at
#: the edges of what was seen lie between the object and what is behind it.
_SEEN, _CLEAR = 0.5 * np.pi, np.radians(75.0)

#: Half of the arc, around the circle nearest to it, beyond which a section can be higher than wide, radians: at the
#: edges of less the pixels lie a little behind the surface, which looks the same.
_UPRIGHT = float(np.radians(80.0))

#: An arc of less than so many degrees shows a circle's radius only if it is known to be one. A camera sees 180 degrees
#: of a round object, less what is too steep for it.
_LEAST_ARC = 110.0


def check_roundness(
    points: Array, s: Array, residual: Array, line: Skeleton, radius: float, *, shared: float, known: bool
) -> list[Finding]:
    """Findings about a cross-section that is not round, or of which too little was seen to know.

    Args:
        points: (M, 3) metres.
        s: (M,) foot coordinate of every point.
        residual: (M,) its distance to the tube's surface, positive outside, metres.
        line: the skeleton line.
        radius: of the tube, metres.
        shared: how many points are worth one independent one.
        known: whether the radius was given.
    """
    section = pooled_section(points, s, residual, line, radius)
    if section is None:
        return []
    text = _not_round(section, radius, shared)
    if text is not None:
        return [NOT_ROUND.found(text)]
    arc = float(np.degrees(2.0 * section.half_angle))
    if known or arc >= _LEAST_ARC:
        return []
    width = float(np.ptp(np.quantile(section.side, (0.01, 0.99))))
    text = f"only {arc:.0f} degrees of the circle were seen, a strip {millimetres(width)} wide, which tells the radius "
    return [RADIUS_UNKNOWN.found(f"{text}only if the object is round: give r")]


def is_round(ellipse: Ellipse, shared: float) -> bool:
    """Whether an ellipse may be a circle.

    Args:
        ellipse: through all points of a section.
        shared: how many points are worth one independent one.
    """
    flat = abs(float(np.log(ellipse.height / ellipse.width)))
    return flat - _SURE * ellipse.ratio_std * float(np.sqrt(shared)) < -float(np.log(_ROUND))


def _not_round(section: Section, radius: float, shared: float) -> str | None:
    """In which way a section is not round; None if it may be round."""
    whole = section.whole
    seen = section if whole else section.within(_SEEN)
    clear = section if whole else section.within(_CLEAR)
    if not _by_chance(misfit(clear), shared):
        ellipse = ellipse_through(clear)
        if (
            ellipse is not None
            and not is_round(ellipse, shared)
            and (whole or (_can_be(ellipse, section) and not _is_no_circle(misfit(seen), radius)))
        ):
            size = (
                f"the cross-sections are not round, but {millimetres(ellipse.width)} by {millimetres(ellipse.height)}"
            )
            if whole:
                return f"{size}: the object is oval or flat, or views of it are out of register"
            middle = (
                f"their middle is {millimetres(abs(ellipse.up))} {'above' if ellipse.up > 0.0 else 'below'} the line"
            )
            return f"{size}, as far as one side tells, and {middle}, as it was seen: the object is oval or flat"
    if _by_chance(misfit(seen), shared) or not _is_no_circle(misfit(seen), radius):
        return None
    if whole:
        return "the cross-sections are not round"
    return "the cross-sections are no part of a circle: what the object lies on, or is beside, may be in the cloud"


def _can_be(ellipse: Ellipse, section: Section) -> bool:
    """Whether an object as high as that would be seen as it was: what stands upright shows its sides."""
    return ellipse.height < ellipse.width or section.half_angle > _UPRIGHT


def _by_chance(off: Misfit | None, shared: float) -> bool:
    return off is None or off.shape < _BY_CHANCE * off.chance * float(np.sqrt(shared))


def _is_no_circle(off: Misfit | None, radius: float) -> bool:
    return off is not None and off.shape > _NO_CIRCLE * radius and off.shape > _NO_NOISE * off.noise
