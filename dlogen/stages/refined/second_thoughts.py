"""What the ordering feared and the fit disproves: a tube that nearly all points lie on is a line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlogen.stages.quality.findings import NOT_A_LINE
from dlogen.stages.refined.refine import Refined
from dlogen.types import Finding

#: Share of the points that lie on the tube, and their scatter about it in radii, with which there is no doubt of it.
_SHARE, _THIN = 0.9, 0.1

#: An object shorter than this, in radii, is hardly a line, however well a tube fits.
_SHORT = 6.0


def is_a_tube(fitted: Refined) -> bool:
    """Whether nearly all points of a cloud lie on the tube that was fitted, and close to it."""
    if not fitted.radius_identifiable or not len(fitted.inliers):
        return False
    return float(np.mean(fitted.inliers)) > _SHARE and fitted.noise < _THIN * fitted.radius


def reconsidered(findings: Sequence[Finding], fitted: Refined) -> list[Finding]:
    """Findings of the ordering without those that the fit disproves.

    Whether a cloud is longer than wide is judged by neighbourhoods of some of its points; in a flat roll these meet
    the next turn. Where a tube fits nearly all points, it is a line; a short one is doubtful at most.

    Args:
        findings: of the ordering.
        fitted: the tube fitted to its line.
    """
    feared = [item for item in findings if NOT_A_LINE.matches(item)]
    if not feared or not is_a_tube(fitted):
        return list(findings)
    kept = [item for item in findings if not NOT_A_LINE.matches(item)]
    diameters = 0.5 * fitted.skeleton.length / fitted.radius
    if diameters < 0.5 * _SHORT:
        message = f"the object is only {diameters:.1f} diameters long: it is hardly a line"
        kept.append(NOT_A_LINE.found(message, "doubtful"))
    return kept
