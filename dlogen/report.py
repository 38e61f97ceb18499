"""The chain and the report as plain dictionaries, in metres and radians: what the JSON files hold."""

from __future__ import annotations

from typing import Any

from dlogen.model import Mdtw, Result

CHAIN_SCHEMA = "dlogen.chain/1"
REPORT_SCHEMA = "dlogen.report/1"


def chain_dict(result: Result) -> dict[str, Any]:
    """The kinematic chain, `dlogen.chain/1`.

    The skeleton line is f(s) = sum_j weights_j phi_j(s) + offset with the basis named in `skeleton.basis`
    (`dlogen.basis`); `transforms` are 4 x 4 rows, the frame in the segment's centre with x along the segment.
    """
    chain, line = result.chain, result.skeleton
    digits = max(2, len(str(len(chain.lengths))))
    return {
        "schema": CHAIN_SCHEMA,
        "units": {"length": "m", "angle": "rad", "mass": "kg"},
        "frame": "cloud",
        "profile": result.profile,
        "radius": chain.radius,
        "skeleton": {
            "length": line.length,
            "points": result.skeleton_points.tolist(),
            "basis": {
                **line.basis.to_dict(),
                "weights": line.weights.tolist(),
                "offset": line.offset.tolist(),
            },
        },
        "segment_count": len(chain.lengths),
        "segment_length": result.joints.segment_length,
        "last_segment_length": result.joints.last_segment_length,
        "length": chain.length,
        "e_max": result.e_max,
        "max_deviation": result.max_deviation,
        "joints": chain.joints.tolist(),
        "joint_s": chain.s.tolist(),
        "links": [
            {"name": f"segment_{i + 1:0{digits}d}", "length": float(length), "transform": transform.tolist()}
            for i, (length, transform) in enumerate(zip(chain.lengths, chain.transforms, strict=True))
        ],
        "quality": quality_dict(result),
        "provenance": result.provenance,
    }


def report_dict(result: Result, reference: dict[str, Any] | None = None) -> dict[str, Any]:
    """The error report, `dlogen.report/1`.

    Args:
        result: of a fit.
        reference: what `reference_dict` made of a known curve, if there is one.
    """
    report = {
        "schema": REPORT_SCHEMA,
        "units": {"length": "m", "time": "s"},
        "profile": result.profile,
        "points": result.provenance["points"],
        "points_used": result.provenance["points_used"],
        "length": result.skeleton.length,
        "segment_count": len(result.chain.lengths),
        "segment_length": result.joints.segment_length,
        "last_segment_length": result.joints.last_segment_length,
        "e_max": result.e_max,
        "max_deviation": result.max_deviation,
        "mdtw": mdtw_dict(result.mdtw),
        "residual": {
            "rms": result.residual.rms,
            "median": result.residual.median,
            "radius": result.residual.radius,
        },
        "chosen": result.settings,
        "quality": quality_dict(result),
        "warnings": [finding.message for finding in result.quality.findings if finding.severity != "note"],
    }
    if reference is not None:
        report["reference"] = reference
    if result.settings["report"]["timings"]:
        report["timings"] = result.timings
    return report


def mdtw_dict(error: Mdtw) -> dict[str, Any]:
    """MDTW as it stands in the report: `error` over `s` is the paper's Fig. 9."""
    return {
        "mean": error.mean,
        "std": error.std,
        "max": error.max,
        "path_length": len(error.error),
        "sampling": "even arc length",
        "error": error.error.tolist(),
        "s": error.s.tolist(),
    }


def quality_dict(result: Result) -> dict[str, Any]:
    """Verdict and findings."""
    return {
        "verdict": result.quality.verdict,
        "findings": [finding.to_dict() for finding in result.quality.findings],
    }
