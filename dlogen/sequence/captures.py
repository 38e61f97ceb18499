"""The captures of an object as their own fits have them, read from the folder of a batch."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.batch.paths import as_unicode
from dlogen.batch.store import Row
from dlogen.stages.quality.findings import CROSSING, DEVIATION_ABOVE_E_MAX, RADIUS_UNKNOWN
from dlogen.types import Array, Finding, Quality

#: Findings about a capture's own chain, which is not used; and what the other captures settle: the radius that they
#: share, and how strands go on where they cross, by their motion.
_SETTLED = (DEVIATION_ABOVE_E_MAX, RADIUS_UNKNOWN, CROSSING)


@dataclass(frozen=True, eq=False)
class CaptureFit:
    """A capture as its own fit has it.

    Attributes:
        name: of the capture.
        points: (K, 3) its skeleton line, even in arc length, metres; None where the fit failed.
        length, radius: metres.
        residual: RMS distance of the points to the tube, metres.
        problem: why the capture cannot be believed: the error of its fit, or its verdict; None where it is good.
    """

    name: str
    points: Array | None
    length: float = np.nan
    radius: float = np.nan
    residual: float = np.nan
    problem: str | None = None


def read_capture(rows: Mapping[str, Row], key: str, folder: Path, *, keep_doubtful: bool = False) -> CaptureFit:
    """A capture as its fit has written it.

    Args:
        rows: records of the fits by key.
        key: of the capture; the chain is KEY.json, its report KEY.report.json.
        folder: of the fits.
        keep_doubtful: go by the capture although its verdict is doubtful.
    """
    name = as_unicode(key)
    row = rows.get(name)
    if row is None or row.status != "done":
        return CaptureFit(name, None, problem=row.error if row and row.error else "it has not been fitted")
    chain, report = read_fit(folder, key)
    findings = map(Finding.from_dict, chain["quality"]["findings"])
    quality = Quality(
        tuple(item for item in findings if item.is_bad or not any(kind.matches(item) for kind in _SETTLED))
    )
    problem = None
    if not quality.is_good and not (keep_doubtful and not quality.is_bad):
        said = "; ".join(f"{item.message} [{item.code}]" for item in quality.warnings)
        problem = f"{quality.verdict}: {said}"
    return CaptureFit(
        name,
        np.array(chain["skeleton"]["points"]),
        chain["skeleton"]["length"],
        chain["radius"],
        report["residual"]["rms"],
        problem,
    )


def read_fit(folder: Path, key: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """The chain and the report that a fit has written.

    Args:
        folder: of the fits.
        key: of the cloud; the chain is KEY.json, its report KEY.report.json.
    """
    chain, report = (
        json.loads((folder / f"{key}{end}").read_text(encoding="utf-8")) for end in (".json", ".report.json")
    )
    return chain, report
