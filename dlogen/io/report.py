"""The chain and the report as plain dictionaries, in metres and radians: what the JSON files hold."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from dlogen.multibody.build import multibody
from dlogen.multibody.model import Joint, MultibodyModel
from dlogen.types import FitData, Mdtw, Segmentation, Uncertainty

CHAIN_SCHEMA = "dlogen.chain/1"
REPORT_SCHEMA = "dlogen.report/1"

#: Standard deviations, of each of two directions, within which a point in a plane is with 95 % probability.
WITHIN_95 = 2.448


def chain_dict(result: FitData) -> dict[str, Any]:
    """The kinematic chain, `dlogen.chain/1`.

    The skeleton line is f(s) = sum_j weights_j phi_j(s) + offset with the basis named in `skeleton.basis`
    (`dlogen.geometry.basis`). `frame_transform` takes the cloud's points, in metres, into the frame; `transforms` are
    4 x 4, by rows, the frame in the segment's centre with x along the segment.
    """
    chain, line = result.chain, result.skeleton
    model = multibody(result)
    return {
        "schema": CHAIN_SCHEMA,
        "units": {"length": "m", "angle": "rad", "mass": "kg"},
        "frame": result.frame.name,
        "frame_transform": result.frame.transform.tolist(),
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
            {
                "name": body.name,
                "length": body.length,
                "transform": transform.tolist(),
                "mass": body.mass,
                "inertia": [body.axial_inertia, body.transverse_inertia, body.transverse_inertia],
            }
            for body, transform in zip(model.bodies, chain.transforms, strict=True)
        ],
        "model": model_dict(model),
        "quality": quality_dict(result),
        "provenance": result.provenance,
    }


def model_dict(model: MultibodyModel) -> dict[str, Any]:
    """The multibody model that all formats write (`dlogen.multibody.model`).

    A joint turns its child by `origin`, which ends in the parent's frame at the joint, and then by its hinges about
    `axes`, each about an axis that the ones before have turned.
    """
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = model.base_rotation, model.base_position
    return {
        "root": model.root,
        "tip": model.tip,
        "dof": model.dof,
        "base": "floating" if model.floating else "fixed",
        "zero": model.zero,
        "rest": model.rest,
        "base_transform": base.tolist(),
        "joints": [_joint_dict(joint) for joint in model.joints],
        "material": {
            **dataclasses.asdict(model.material),
            "mass": model.material.mass,
            "bending_stiffness": model.material.bending_stiffness,
            "torsional_stiffness": model.material.torsional_stiffness,
            "bending_damping": model.material.bending_damping,
            "torsional_damping": model.material.torsional_damping,
        },
    }


def _joint_dict(joint: Joint) -> dict[str, Any]:
    origin = np.eye(4)
    origin[:3, :3], origin[0, 3] = joint.rotation, joint.offset
    return {
        "name": joint.name,
        "parent": joint.parent,
        "child": joint.child,
        "origin": origin.tolist(),
        "axes": list(joint.axes),
        "hinges": list(joint.hinge_names),
        "scanned": joint.scanned.tolist(),
        "straight": joint.straight.tolist(),
        "rest": joint.rest.tolist(),
        "lower": joint.lower.tolist(),
        "upper": joint.upper.tolist(),
        "bend_limit": joint.bend_limit,
        "stiffness": None if joint.stiffness is None else joint.stiffness.tolist(),
        "damping": joint.damping.tolist(),
    }


def uncertainty_dict(known: Uncertainty | None) -> dict[str, Any] | None:
    """Standard deviations along the line, and the distance within which the axis is with 95 % probability."""
    if known is None:
        return None
    return {
        "s": known.s.tolist(),
        "position_std": known.position.tolist(),
        "position_95": (WITHIN_95 * known.position).tolist(),
        "curvature_std": known.curvature.tolist(),
        "radius_std": known.radius if np.isfinite(known.radius) else None,
    }


def report_dict(result: FitData, reference: dict[str, Any] | None = None) -> dict[str, Any]:
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
        "segmentation": segmentation_dict(result),
        "mdtw": mdtw_dict(result.mdtw),
        "residual": {
            "rms": result.residual.rms,
            "median": result.residual.median,
            "radius": result.residual.radius,
        },
        "regime": result.regime,
        "uncertainty": uncertainty_dict(result.uncertainty),
        "chosen": result.settings,
        "quality": quality_dict(result),
        "warnings": [finding.message for finding in result.quality.warnings],
    }
    if reference is not None:
        report["reference"] = reference
    if result.config.report.timings:
        report["timings"] = result.timings
    return report


def segmentation_dict(result: FitData) -> dict[str, Any]:
    """The chain's segmentation, why it does not have fewer segments, and what other criteria give, side by side.

    `dof` counts the inner joints' degrees of freedom. `fewer.resolution` says that all segment lengths were searched,
    but for intervals narrower than this share of them; it is null where the search was a local one (minimax).
    """
    dof = result.config.joints.dof
    chosen = result.segmentation
    out = _criterion_dict(chosen, dof)
    if chosen.fewer is not None:
        out["fewer"] = {
            "segment_count": chosen.fewer.count,
            "smallest_deviation": chosen.fewer.deviation,
            "segment_length": chosen.fewer.segment_length,
            "resolution": chosen.fewer.resolution,
        }
    out["alternatives"] = [_criterion_dict(other, dof) for other in chosen.alternatives]
    return out


def _criterion_dict(made: Segmentation, dof: int) -> dict[str, Any]:
    return {
        "criterion": made.criterion,
        "placement": made.placement,
        "segment_count": made.count,
        "dof": dof * (made.count - 1),
        "deviation": made.deviation,
        "deviation_s": made.deviation_s,
        "segment_length": made.joints.segment_length,
        "last_segment_length": made.joints.last_segment_length,
    }


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


def quality_dict(result: FitData) -> dict[str, Any]:
    """Verdict and findings."""
    return {
        "verdict": result.quality.verdict,
        "findings": [finding.to_dict() for finding in result.quality.findings],
    }
