"""What ordering and fit found, each thing once: both notice gaps, and the fit knows best where they begin and end."""

from __future__ import annotations

from dlogen.stages.quality.findings import GAP, NOISE, UNEVEN_SURFACE
from dlogen.stages.refined.ordering import Ordering
from dlogen.stages.refined.refine import Refined
from dlogen.stages.refined.second_thoughts import reconsidered
from dlogen.types import Finding, Skeleton
from dlogen.types.texts import millimetres

#: A gap below this share of the length is bridged without doubt.
_SMALL_GAP = 0.05

#: Points that share their noise, from which on that is said.
_UNEVEN = 10.0

#: Noise over radius that is worth a note, and beyond which the line is doubtful.
_NOTED, _NOISY = 0.01, 0.5


def fit_findings(ordering: Ordering, fitted: Refined) -> tuple[Finding, ...]:
    """Findings of both, without those that only repeat one another.

    Args:
        ordering: of the cloud.
        fitted: the fit that started from it.
    """
    findings = [item for item in reconsidered(ordering.findings, fitted) if not GAP.matches(item)]
    line, radius = fitted.skeleton, fitted.radius
    gaps = gap_findings(ordering, line, radius, fitted.gaps)
    share = fitted.noise / radius
    if share > _NOTED:
        message = f"the points scatter by {1e3 * fitted.noise:.2g} mm, {100 * share:.0f} % of the radius"
        gaps.append(NOISE.found(message, "doubtful" if share > _NOISY else "note"))
    if share > _NOTED and fitted.shared > _UNEVEN:
        message = (
            f"about {fitted.shared:.0f} neighbouring points share what they are off by: the surface has a pattern, as "
            "of something wound, braided or corrugated, or the sensor smooths"
        )
        gaps.append(UNEVEN_SURFACE.found(message))
    return (*findings, *gaps, *fitted.findings)


def gap_findings(
    ordering: Ordering, line: Skeleton, radius: float, gaps: tuple[tuple[float, float], ...]
) -> list[Finding]:
    """Findings about the gaps of a line, and about those that only its ordering noticed.

    Args:
        ordering: of the cloud.
        line: the line that was fitted.
        radius: of the object, metres.
        gaps: (s0, s1) of the line's stretches without points.
    """
    findings = []
    bridged = [finding for finding in ordering.findings if GAP.matches(finding)]
    # Short ones must have been noticed by the ordering as well.
    for start, end in gaps:
        middle, length = 0.5 * (start + end), (end - start) * line.length
        seen = [item for item in bridged if item.s is not None and start - 0.03 < item.s < end + 0.03]
        bridged = [item for item in bridged if item not in seen]
        crossed = any(join.s[0] < end and start < join.s[1] for join in ordering.joins)
        if seen or crossed or length > 4.0 * radius:
            doubt = any(not item.is_note for item in seen) or end - start > _SMALL_GAP
            message = f"no points over {millimetres(length)} ({100 * (end - start):.1f} % of the length): bridged"
            findings.append(GAP.at(line, middle, message, "doubtful" if doubt else "note"))
    return [*findings, *bridged]
