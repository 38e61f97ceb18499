"""From a cloud to a chain: the paper's section III, a step a line. Knows no files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from dlogen._version import __version__
from dlogen.config.fields import AUTO, given
from dlogen.config.schema import Config
from dlogen.errors import FitError
from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.curvature import max_curvature
from dlogen.io.result import Result
from dlogen.stages.chain import build_chain, chain_error
from dlogen.stages.clean import clean
from dlogen.stages.clock import Clock
from dlogen.stages.mesh import surface_points, with_vertex_radius
from dlogen.stages.output_frame import in_frame, output_frame
from dlogen.stages.prepare import Prepared, check_left_out, check_points, prepare, without_far_points
from dlogen.stages.quality.checks import check_deviation, check_line, explained
from dlogen.stages.quality.coordinates import Steps, check_steps, coordinate_steps, without_those_of_the_grid
from dlogen.stages.quality.findings import UNITS
from dlogen.stages.quality.known_length import check_length
from dlogen.stages.quality.residual import tube_residual
from dlogen.stages.quality.units import check_units
from dlogen.stages.segmentation.segment import segment
from dlogen.stages.segmentation.specification import SegmentationSpec, allowed_deviation
from dlogen.stages.view import camera_at_origin
from dlogen.types import Array, Chain, Cloud, Finding, FittedLine, Frame, Mdtw, Quality, Segmentation

#: Points of the skeleton line in the outputs.
SKELETON_POINTS = 1000


def fit(
    cloud: Cloud | npt.ArrayLike,
    config: Config | Mapping[str, Any] | None = None,
    *,
    name: str | None = None,
) -> Result:
    """Make a kinematic chain from a point cloud.

    Args:
        cloud: what `read_cloud` gives, or an (M, 3) array of surface points in the units that the config names
            (metres by default).
        config: a `Config`, a mapping with the keys of the YAML file, or None for the defaults.
        name: stem for output files; by default the cloud's file name without its ending.

    Returns:
        The chain with everything that led to it, in metres, in the cloud's frame or in what `frame` makes of it.

    Raises:
        FitError: no chain can be made from this cloud.
        ConfigError: the configuration does not fit the cloud.

    >>> import dlogen
    >>> cloud = dlogen.synth("helical", points=3000, noise=0.0005, seed=4)
    >>> result = dlogen.fit(cloud.points, {"e_max": 0.01})
    >>> result.max_deviation <= 0.01, result.quality.verdict
    (True, 'good')
    >>> bool(abs(result.chain.radius - 0.02) < 1e-4)
    True
    """
    config = config if isinstance(config, Config) else Config.from_dict(config or {})
    cloud = cloud if isinstance(cloud, Cloud) else clean(cloud)
    clock = Clock()
    with clock.stage("input"):
        used, said = surface_points(cloud, config.mesh)
        prepared, frame, steps, far = _prepared(used, config)
    with steps.blamed(prepared.scale):
        line = _skeleton_line(prepared.cloud, config, clock)  # III.B, III.C
    if used.mesh is not None and config.r == AUTO:
        line = with_vertex_radius(line, used.mesh.vertices * prepared.scale - prepared.centre)
    with clock.stage("segmentation"):
        spec, e_max = SegmentationSpec.of(config), allowed_deviation(config, line.radius)
        segmentation = _segmented(line, e_max, spec)  # III.D, III.E
        chain = build_chain(segmentation.joints, line.radius)  # III.A
    with clock.stage("mdtw"):
        error = chain_error(line.skeleton, chain, config.mdtw.samples)  # IV.A
    with clock.stage("checks"):
        findings = (
            *check_length(line.skeleton.length, given(config.length)),
            *without_those_of_the_grid(line.findings, steps, prepared.scale, line.radius),
            *said,
            *check_steps(steps, prepared.scale, line.radius),
            *check_left_out(far),
            *_checked(line, segmentation, e_max),
        )
        asked = check_units(
            line.skeleton.length, line.radius, config.units, prepared.units, radius_given=config.r != AUTO
        )
        # Those that name the units that would fit come in place of those that only ask for them.
        known = max((item.gravity for item in asked), default=-1)
        findings = (*asked, *(item for item in findings if not UNITS.matches(item) or item.gravity > known))
    chosen = {**line.chosen, "units": prepared.units, "e_max": e_max, "segmentation.criterion": spec.criterion}
    resolved = config.resolved(chosen)
    provenance = _provenance(cloud, len(prepared.cloud), resolved)
    result = _result(name or _stem(cloud), line, segmentation, chain, error, findings, resolved, provenance, clock)
    return in_frame(result, frame, prepared.centre)


def _prepared(cloud: Cloud, config: Config) -> tuple[Prepared, Frame, Steps, int]:
    """The cloud as the stages take it, the output's frame, the steps of coordinates, how many points are no data."""
    near, far = without_far_points(cloud)
    # Points in the sensor's own frame are seen from its origin.
    at_origin = config.frame.use_viewpoint or (near.viewpoint is None and camera_at_origin(near.points))
    seen = replace(near, viewpoint=np.zeros(3)) if at_origin else near
    prepared = prepare(seen, config.units)
    steps = coordinate_steps(near.points)
    steps.check(near.points, prepared.scale)
    check_points(near.points, surface=config.projection.enabled and not _are_flat_nodes(near.points, config))
    return prepared, output_frame(config.frame, cloud, prepared.scale), steps, far


def _are_flat_nodes(points: Array, config: Config) -> bool:
    """Whether a flat cloud is one that the profile takes: nodes of a curve in a plane."""
    if config.profile == "paper":
        return False
    from dlogen.stages.refined.node_line import flat_nodes

    return flat_nodes(points)


def _skeleton_line(cloud: Cloud, config: Config, clock: Clock) -> FittedLine:
    """The skeleton line by the stages of the profile; those of the other one are not imported."""
    if config.profile == "paper":
        from dlogen.stages.paper.line import paper_line

        return paper_line(cloud, config, clock)
    from dlogen.stages.refined.line import refined_line

    return refined_line(cloud, config, clock)


def _segmented(line: FittedLine, e_max: float, spec: SegmentationSpec) -> Segmentation:
    """The line cut into segments; where that fails, the reason is what was wrong with the cloud, if anything was."""
    try:
        return segment(line.skeleton, e_max, spec)
    except FitError as reason:
        raise explained(reason, line.findings) from reason


def _checked(line: FittedLine, segmentation: Segmentation, e_max: float) -> list[Finding]:
    """Findings about line and chain, whatever profile made them."""
    bend = max_curvature(line.skeleton)
    return [
        *check_line(line.skeleton, line.radius, line.distance, line.on_tube, bend, surface=line.regime == "surface"),
        *check_deviation(line.skeleton, segmentation, e_max),
    ]


def _result(
    name: str,
    line: FittedLine,
    segmentation: Segmentation,
    chain: Chain,
    error: Mdtw,
    findings: tuple[Finding, ...],
    config: Config,
    provenance: dict[str, Any],
    clock: Clock,
) -> Result:
    """What the stages made, in one place; `config` is the resolved one."""
    return Result(
        name=name,
        profile=config.profile,
        skeleton=line.skeleton,
        skeleton_points=line.skeleton(even_parameters(line.skeleton, SKELETON_POINTS)),
        segmentation=segmentation,
        joints=segmentation.joints,
        chain=chain,
        e_max=float(config.e_max),
        max_deviation=segmentation.deviation,
        mdtw=error,
        residual=tube_residual(line.distance[line.on_tube], line.radius),
        quality=Quality(findings),
        config=config,
        provenance=provenance,
        timings=clock.seconds,
        intermediates=line.intermediates,
        regime=line.regime,
        uncertainty=line.uncertainty,
    )


def _stem(cloud: Cloud) -> str:
    return "cloud" if cloud.source is None else cloud.source.name.rsplit(".", 1)[0]


def _provenance(cloud: Cloud, used: int, config: Config) -> dict[str, Any]:
    """Where the chain came from; the same for the same input, wherever and whenever it is made."""
    source = cloud.source
    digest = source.sha256 if source else hashlib.sha256(np.ascontiguousarray(cloud.points).tobytes()).hexdigest()
    return {
        "dlogen": __version__,
        # File names need not be Unicode, JSON is.
        "input": source.name.encode("utf-8", "replace").decode() if source else None,
        "sha256": digest,
        "points": len(cloud.points),
        "points_used": used,
        "dropped": {"non_finite": cloud.dropped.non_finite, "duplicates": cloud.dropped.duplicates},
        "seed": config.seed,
        "config": config.to_dict(),
    }
