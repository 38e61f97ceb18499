"""From a cloud to a chain: the paper's section III in its order. Knows no files."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from dlogen._version import __version__
from dlogen.config.fields import AUTO
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, DlogenError, FitError
from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.curvature import max_curvature
from dlogen.geometry.mdtw import mdtw
from dlogen.geometry.polyline import resample
from dlogen.geometry.sampling import thinned
from dlogen.geometry.units import METRES, guess_units
from dlogen.stages.chain import build_chain
from dlogen.stages.output_frame import in_frame, output_frame
from dlogen.stages.paper.normals import choose_neighbours, estimate_normals, orient_normals
from dlogen.stages.paper.projection import project
from dlogen.stages.paper.skeleton import choose_beta, fit_skeleton, paper_basis
from dlogen.stages.paper.sorting import default_start, sort_points
from dlogen.stages.prepare import check_points, far_away
from dlogen.stages.quality.checks import (
    check_bends,
    check_deviation,
    check_followed,
    check_line,
    check_radius,
    check_radius_along,
    on_surface,
)
from dlogen.stages.quality.cross_section import check_cross_section
from dlogen.stages.quality.residual import foot_points, tube_residual
from dlogen.stages.quality.walk import check_walk
from dlogen.stages.scale import estimate_scale
from dlogen.stages.segmentation.segment import Wish, segment
from dlogen.types import Array, BoolArray, Cloud, Finding, Intermediate, Quality, Result, Skeleton

if TYPE_CHECKING:
    from dlogen.stages.refined.ordering import Ordering
    from dlogen.stages.refined.refine import Refined

#: Points of the skeleton line in the outputs.
SKELETON_POINTS = 1000

#: Of larger clouds this many points are used: with the noise of any sensor more do not change the line.
MOST_POINTS = 2_000_000

#: What the refined profile chooses from the data by itself.
_PAPER_ONLY = (
    "r_n",
    "N",
    "beta",
    "normals.neighbours",
    "normals.radius",
    "normals.orientation",
    "projection.enabled",
    "sorting.start",
    "skeleton.tau",
)

#: A gap below this share of the length is bridged without doubt.
SMALL_GAP = 0.05


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
    """
    config = config if isinstance(config, Config) else Config.from_dict(config or {})
    cloud = cloud if isinstance(cloud, Cloud) else _cloud_of(cloud)
    settings = config.to_dict()
    clock = _Clock()

    with clock.stage("input"):
        whole, far = cloud, far_away(cloud.points)
        if far.any():
            rest = np.flatnonzero(~far)
            normals = None if cloud.normals is None else cloud.normals[rest]
            cloud = replace(cloud, points=cloud.points[rest], normals=normals)
        check_points(cloud.points, surface=config.projection.enabled)
        if config.units == AUTO:
            settings["units"] = guess_units(cloud.points)
        scale = METRES[settings["units"]]
        # All stages work near the origin: survey coordinates of 5e6 m would cost them nine digits.
        centre = 0.5 * (cloud.points.min(axis=0) + cloud.points.max(axis=0))
        frame = output_frame(config.frame, cloud, scale)
        # Points in the sensor's own frame are seen from its origin.
        eye = np.zeros(3) if config.frame.use_viewpoint else cloud.viewpoint
        used = thinned(cloud.points, MOST_POINTS) if len(cloud) > MOST_POINTS else slice(None)
        near = replace(
            cloud,
            points=(cloud.points[used] - centre) * scale,
            normals=None if cloud.normals is None else cloud.normals[used],
            viewpoint=None if eye is None else (eye - centre) * scale,
        )

    line = (_refined_line if config.profile == "refined" else _paper_line)(near, config, settings, clock)

    with clock.stage("segmentation"):
        e_max = settings["e_max"] = line.radius / 2.0 if config.e_max == AUTO else config.e_max
        bend = max_curvature(line.skeleton)
        wish = _wish(config)
        settings["segmentation"]["criterion"] = wish.criterion
        try:
            segmentation = segment(line.skeleton, e_max, wish)
        except FitError as reason:
            raise _explained(reason, line.findings) from reason
        chain = build_chain(segmentation.joints, line.radius)

    with clock.stage("mdtw"):
        samples = config.mdtw.samples
        error = mdtw(
            line.skeleton(even_parameters(line.skeleton, samples)),
            resample(chain.joints, samples),
        )

    with clock.stage("checks"):
        findings = [
            *_left_out(int(far.sum())),
            *check_line(line.skeleton, line.radius, line.distance, line.on_tube, bend),
            *check_deviation(line.skeleton, segmentation, e_max),
        ]

    result = Result(
        name=name or _stem(cloud),
        profile=config.profile,
        skeleton=line.skeleton,
        skeleton_points=line.skeleton(even_parameters(line.skeleton, SKELETON_POINTS)),
        segmentation=segmentation,
        joints=segmentation.joints,
        chain=chain,
        e_max=e_max,
        max_deviation=segmentation.deviation,
        mdtw=error,
        residual=tube_residual(line.distance[line.on_tube], line.radius),
        quality=Quality((*line.findings, *findings)),
        settings=settings,
        provenance=_provenance(whole, len(near), settings),
        timings=clock.seconds,
        intermediates=line.intermediates,
    )
    return in_frame(result, frame, centre * scale)


@dataclass(frozen=True, eq=False)
class _Line:
    """A skeleton line with what a profile knows of it.

    Attributes:
        skeleton: the line.
        radius: of the object, metres.
        distance: (M,) distance of the cloud's points to the line, metres.
        on_tube: (M,) which of them count as points of the tube.
        intermediates: what the profile's stages made.
        findings: what they found.
    """

    skeleton: Skeleton
    radius: float
    distance: Array
    on_tube: BoolArray
    intermediates: tuple[Intermediate, ...]
    findings: tuple[Finding, ...]


def _refined_line(cloud: Cloud, config: Config, settings: dict[str, Any], clock: _Clock) -> _Line:
    """The skeleton line by a robust fit of the tube's surface, from an order that survives real captures."""
    # Imported here: the paper's profile need not wait for them.
    from dlogen.stages.quality.contacts import check_contacts
    from dlogen.stages.quality.cut_ends import cut_ends
    from dlogen.stages.refined.ordering import order
    from dlogen.stages.refined.refine import refine

    points = cloud.points
    given = None if config.r == AUTO else config.r
    with clock.stage("scale"):
        _check_radius(points, given)
        scale = estimate_scale(points, radius=given)

    with clock.stage("ordering"):
        ordering = order(points, given, scale)

    with clock.stage("refine"):
        try:
            fitted = refine(points, ordering.backbone, ordering.radius, fixed_radius=given is not None)
        except FitError as reason:
            raise _explained(reason, ordering.findings) from reason
        skeleton, radius = fitted.skeleton, fitted.radius
        settings.update(r=radius, N=skeleton.basis.size)

    default = Config()
    unused = [key for key in _PAPER_ONLY if _setting(config, key) != _setting(default, key)]
    s, residual = fitted.s, fitted.residuals
    on_tube = fitted.inliers
    along = np.flatnonzero(on_tube)[np.argsort(s[on_tube], kind="stable")]
    oval = any(item.code == "side-by-side" for item in ordering.findings)
    # The two ends of a ring overlap.
    ring = any(item.code == "closed-ring" and item.severity == "bad" for item in ordering.findings)
    even = skeleton(even_parameters(skeleton, round(skeleton.length / radius) + 1))
    return _Line(
        skeleton,
        radius,
        residual + radius,
        on_tube,
        (
            Intermediate("ordering", ordering.backbone),
            Intermediate("tube", points[along], {"s": s[along], "residual": residual[along]}, colour="s"),
            Intermediate("off_tube", points[~on_tube], {"residual": residual[~on_tube]}),
        ),
        (
            *([_not_used(unused)] if unused else []),
            *_findings_of_refined(ordering, fitted),
            *([] if ring else check_contacts(even, ordering.backbone, radius)),
            *cut_ends(points, s, on_tube, skeleton, radius),
            *check_followed(points, ordering.backbone, residual + radius, radius),
            *check_radius_along(skeleton, radius, s, residual + radius),
            *([] if oval else check_cross_section(points, s, residual, skeleton, radius)),
            *check_bends(skeleton, radius, s[on_tube]),
            *([] if given is None else check_radius(given, estimate_scale(points))),
        ),
    )


def _left_out(count: int) -> list[Finding]:
    if count == 0:
        return []
    message = f"left out {count} point{'s' if count > 1 else ''} very far from all others: missing data, it seems"
    return [Finding("stray-points", message, "note")]


def _explained(error: FitError, findings: tuple[Finding, ...]) -> FitError:
    """What was wrong before, if anything was: a line through what is no line fails later, in ways that say little."""
    bad = next((finding for finding in findings if finding.severity == "bad"), None)
    if bad is None:
        return error
    return FitError(
        f"no chain can be made of this cloud: {bad.message}",
        "leave only the object in it: no table, background or fixtures (dlogen extract cuts an object out of a scene); "
        "check r and units",
        stage="ordering",
    )


def _setting(config: Config, key: str) -> Any:
    """The value of a dotted key."""
    value: Any = config
    for part in key.split("."):
        value = getattr(value, part)
    return value


def _not_used(keys: list[str]) -> Finding:
    return Finding(
        "settings-not-used", f"settings of profile paper only, which this fit did not use: {', '.join(keys)}", "note"
    )


def _findings_of_refined(ordering: Ordering, fitted: Refined) -> tuple[Finding, ...]:
    """What ordering and fit found, each thing once."""
    line, radius = fitted.skeleton, fitted.radius
    findings = [finding for finding in ordering.findings if finding.code != "gap"]
    bridged = [finding for finding in ordering.findings if finding.code == "gap"]
    # The fit knows best where a gap begins and ends; short ones must have been noticed by the ordering as well.
    for start, end in fitted.gaps:
        middle, length = 0.5 * (start + end), (end - start) * line.length
        seen = [item for item in bridged if item.s is not None and start - 0.03 < item.s < end + 0.03]
        bridged = [item for item in bridged if item not in seen]
        crossed = any(join.s[0] < end and start < join.s[1] for join in ordering.joins)
        if seen or crossed or length > 4.0 * radius:
            doubt = any(item.severity != "note" for item in seen) or end - start > SMALL_GAP
            x, y, z = (float(value) for value in line(middle)[0])
            findings.append(
                Finding(
                    "gap",
                    f"no points over {1e3 * length:.3g} mm ({100 * (end - start):.1f} % of the length): bridged",
                    "doubtful" if doubt else "note",
                    middle,
                    (x, y, z),
                )
            )
    share = fitted.noise / radius
    if share > 0.01:
        findings.append(
            Finding(
                "noise",
                f"the points scatter by {1e3 * fitted.noise:.2g} mm, {100 * share:.0f} % of the radius",
                "doubtful" if share > 0.5 else "note",
            )
        )
    return (*findings, *bridged, *fitted.findings)


def _paper_line(cloud: Cloud, config: Config, settings: dict[str, Any], clock: _Clock) -> _Line:
    """The skeleton line by the paper's stages as published (III.B and III.C)."""
    points = cloud.points
    with clock.stage("scale"):
        _check_radius(points, None if config.r == AUTO else config.r)
        free = estimate_scale(points)
        radius = free.radius if config.r == AUTO else config.r
        r_n = search_radius(points, radius) if config.r_n == AUTO else config.r_n
        settings["r"], settings["r_n"] = radius, r_n
        if r_n < 2.0 * radius:
            raise ConfigError(
                f"r_n = {r_n:g} m is below the diameter 2 r = {2 * radius:g} m",
                "the search radius has to span the object (paper III.B): leave r_n at auto, or try 8 r",
            )

    with clock.stage("normals"):
        normals = _normals(cloud, radius, config, settings)

    with clock.stage("projection"):
        projected = project(points, normals, radius) if config.projection.enabled else points

    with clock.stage("sorting"):
        start = default_start(projected) if config.sorting.start == AUTO else config.sorting.start
        if start >= len(points):
            raise ConfigError(
                f"sorting.start = {start}, but the cloud has {len(points)} points", "points are counted from 0"
            )
        walk = sort_points(projected, normals, r_n, start)
        reached = projected[walk.index]

    with clock.stage("skeleton"):
        basis = paper_basis(
            None if config.N == AUTO else config.N, None if config.skeleton.tau == AUTO else config.skeleton.tau
        )
        beta = choose_beta(basis, reached, walk.s) if config.beta == AUTO else config.beta
        settings.update(N=basis.size, beta=beta)
        settings["skeleton"]["tau"] = basis.tau
        settings["sorting"]["start"] = start
        skeleton = fit_skeleton(reached, walk.s, basis, beta)
    if skeleton.length <= radius:
        raise FitError(
            f"the object would be {1e3 * skeleton.length:.2g} mm long at a radius of {1e3 * radius:.2g} mm: no line",
            "is it a cable at all? dlogen info shows the cloud's size; give r if it was estimated wrongly",
            stage="skeleton",
        )

    with clock.stage("residual"):
        s, distance = foot_points(points, skeleton)
        if not config.projection.enabled:
            # The points are on the axis, or so near to it that it does not matter: anywhere in the tube is right.
            distance = np.maximum(distance, radius)
        on_tube = on_surface(distance, radius)
    return _Line(
        skeleton,
        radius,
        distance,
        on_tube,
        (
            Intermediate("normals", points, {f"n{axis}": normals[:, i] for i, axis in enumerate("xyz")}),
            Intermediate("projected", projected),
            Intermediate("sorted", reached, {"s": walk.s}, colour="s"),
            Intermediate("unreached", projected[walk.unreached]),
        ),
        (
            *check_walk(skeleton, radius, s, on_tube, len(walk.unreached)),
            *check_radius_along(skeleton, radius, s, distance),
            *check_radius(None if config.r == AUTO else radius, free),
        ),
    )


def _wish(config: Config) -> Wish:
    """What the configuration says of the segments."""
    wanted = config.segmentation

    def given(value: Any) -> Any:
        return None if value == AUTO else value

    criterion = wanted.criterion
    if criterion == AUTO:
        a_priori = wanted.curvature_max != AUTO or wanted.min_bend_radius != AUTO
        criterion = "paper" if a_priori or config.profile == "paper" else "fewest"
    radius = given(wanted.min_bend_radius)
    if wanted.curvature_max != AUTO:
        radius = 1.0 / wanted.curvature_max
    return Wish(
        criterion=criterion,
        placement=wanted.placement,
        segments=given(wanted.segments),
        segment_length=given(wanted.segment_length),
        bend_radius=radius,
        min_last=wanted.min_last,
        alternatives=config.report.alternatives,
    )


def _check_radius(points: Array, radius: float | None) -> None:
    """Refuse a radius that cannot be that of this cloud; mostly it was given in the cloud's units."""
    extent = float(np.ptp(points, axis=0).max())
    if radius is not None and 2.0 * radius > extent:
        raise ConfigError(
            f"the diameter 2 r = {2.0 * radius:g} m is more than the whole cloud, which is {extent:.4g} m large",
            "r is in metres whatever the cloud's units are; units says what those are",
        )


def _normals(cloud: Cloud, radius: float, config: Config, settings: dict[str, Any]) -> Array:
    """Outward normals as the configuration wants them."""
    options = config.normals
    if options.orientation == "stored":
        if cloud.normals is None:
            raise ConfigError("normals.orientation is stored, but the cloud stores no normals", "use auto")
        return cloud.normals
    if options.orientation == "viewpoint" and cloud.viewpoint is None:
        raise ConfigError("normals.orientation is viewpoint, but the cloud names none", "use auto or outward")
    tree = cKDTree(cloud.points)
    if options.radius != AUTO:
        normals = estimate_normals(cloud.points, radius=options.radius, tree=tree)
    else:
        k = choose_neighbours(cloud.points, radius) if options.neighbours == AUTO else options.neighbours
        settings["normals"]["neighbours"] = k
        normals = estimate_normals(cloud.points, neighbours=k, tree=tree)
    return orient_normals(cloud.points, normals, radius, viewpoint=cloud.viewpoint, method=options.orientation)


def search_radius(points: Array, radius: float) -> float:
    """r_n for `auto`: twice the diameter, more where the points are sparse.

    The paper's experiment has 8 r (Table III); its results do not change between 3 r and 8 r, and the smaller one
    keeps more distance to other strands.
    """
    sample = points[:: max(1, len(points) // 1000)]
    spacing = float(np.median(cKDTree(points).query(sample, min(9, len(points)))[0][:, -1]))
    return max(4.0 * radius, 3.0 * spacing)


def _cloud_of(points: npt.ArrayLike) -> Cloud:
    """A clean cloud from an array."""
    from dlogen.stages.clean import clean

    return clean(points)


def _stem(cloud: Cloud) -> str:
    return "cloud" if cloud.source is None else cloud.source.name.rsplit(".", 1)[0]


def _provenance(cloud: Cloud, used: int, settings: dict[str, Any]) -> dict[str, Any]:
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
        "seed": settings["seed"],
        "config": settings,
    }


class _Clock:
    """Seconds per stage; names the stage in errors that come out of it."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        except DlogenError as error:
            error.stage = error.stage or name
            raise
        finally:
            self.seconds[name] = time.perf_counter() - start
