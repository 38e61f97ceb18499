"""From a cloud to a chain: the paper's section III, a step a line. Knows no files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
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
        data = _input(cloud, config)
    line = _skeleton_line(data, config, clock)  # III.B, III.C
    with clock.stage("segmentation"):
        spec, e_max = SegmentationSpec.of(config), allowed_deviation(config, line.radius)
        segmentation = _segmented(line, e_max, spec)  # III.D, III.E
        chain = build_chain(segmentation.joints, line.radius)  # III.A
    with clock.stage("mdtw"):
        error = chain_error(line.skeleton, chain, config.mdtw.samples)  # IV.A
    with clock.stage("checks"):
        findings = _checked(data, line, segmentation, e_max, config)
    chosen = {**line.chosen, "units": data.prepared.units, "e_max": e_max, "segmentation.criterion": spec.criterion}
    resolved = config.resolved(chosen)
    provenance = _provenance(cloud, len(data.prepared.cloud), resolved)
    result = _result(name or _stem(cloud), line, segmentation, chain, error, findings, resolved, provenance, clock)
    return in_frame(result, data.frame, data.prepared.centre)


@dataclass(frozen=True, eq=False)
class _Input:
    """A cloud as the stages take it, and what is known of it.

    Attributes:
        prepared: near the origin, in metres.
        frame: of the output.
        steps: in which the coordinates are stored.
        vertices: (V, 3) of the mesh whose faces the points are spread over, as prepared; None for other clouds.
        view_known: whether the viewpoint is one: PCD has zeros where nobody has set it.
        findings: about the input.
    """

    prepared: Prepared
    frame: Frame
    steps: Steps
    vertices: Array | None
    view_known: bool
    findings: tuple[Finding, ...]


def _input(cloud: Cloud, config: Config) -> _Input:
    """Refuse what no chain can be made of, and prepare the rest."""
    used, said = surface_points(cloud, config.mesh)
    near, far = without_far_points(used)
    # Points in the sensor's own frame are seen from its origin.
    unknown = near.viewpoint is None or not near.viewpoint.any()
    at_origin = config.frame.use_viewpoint or (unknown and camera_at_origin(near.points))
    seen = replace(near, viewpoint=np.zeros(3)) if at_origin else near
    prepared = prepare(seen, config.units)
    steps = coordinate_steps(near.points)
    steps.check(near.points, prepared.scale)
    check_points(near.points, surface=config.projection.enabled and not _are_flat_nodes(near.points, config))
    vertices = None if used.mesh is None else used.mesh.vertices * prepared.scale - prepared.centre
    frame = output_frame(config.frame, used, prepared.scale)
    return _Input(prepared, frame, steps, vertices, at_origin or not unknown, (*said, *check_left_out(far)))


def _are_flat_nodes(points: Array, config: Config) -> bool:
    """Whether a flat cloud is one that the profile takes: nodes of a curve in a plane."""
    if config.profile == "paper":
        return False
    from dlogen.stages.refined.node_line import flat_nodes

    return flat_nodes(points)


def _skeleton_line(data: _Input, config: Config, clock: Clock) -> FittedLine:
    """The skeleton line by the stages of the profile; those of the other one are not imported."""
    cloud = data.prepared.cloud
    with data.steps.blamed(data.prepared.scale):
        if config.profile == "paper":
            from dlogen.stages.paper.line import paper_line

            line = paper_line(cloud, config, clock)
        else:
            from dlogen.stages.refined.line import refined_line

            line = refined_line(cloud if data.view_known else replace(cloud, viewpoint=None), config, clock)
    return line if data.vertices is None or config.r != AUTO else with_vertex_radius(line, data.vertices)


def _segmented(line: FittedLine, e_max: float, spec: SegmentationSpec) -> Segmentation:
    """The line cut into segments; where that fails, the reason is what was wrong with the cloud, if anything was."""
    try:
        return segment(line.skeleton, e_max, spec)
    except FitError as reason:
        raise explained(reason, line.findings) from reason


def _checked(
    data: _Input, line: FittedLine, segmentation: Segmentation, e_max: float, config: Config
) -> tuple[Finding, ...]:
    """Findings about the input, the line and the chain, whatever profile made them."""
    skeleton, radius, scale = line.skeleton, line.radius, data.prepared.scale
    bend = max_curvature(skeleton)
    findings = (
        *check_length(skeleton.length, given(config.length)),
        *without_those_of_the_grid(line.findings, data.steps, scale, radius),
        *check_steps(data.steps, scale, radius),
        *data.findings,
        *check_line(skeleton, radius, line.distance, line.on_tube, bend, surface=line.regime == "surface"),
        *check_deviation(skeleton, segmentation, e_max),
    )
    asked = check_units(skeleton.length, radius, config.units, data.prepared.units, radius_given=config.r != AUTO)
    # Those that name the units that would fit come in place of those that only ask for them.
    known = max((item.gravity for item in asked), default=-1)
    return (*asked, *(item for item in findings if not UNITS.matches(item) or item.gravity > known))


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
