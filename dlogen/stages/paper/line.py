"""The skeleton line of the profile paper: the paper's stages as published (III.B and III.C), one after another."""

from __future__ import annotations

import numpy as np

from dlogen.config.fields import AUTO, given
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, FitError
from dlogen.stages.clock import Clock
from dlogen.stages.paper.normals import outward_normals
from dlogen.stages.paper.projection import project
from dlogen.stages.paper.skeleton import choose_beta, fit_skeleton, paper_basis
from dlogen.stages.paper.sorting import choose_search_radius, choose_start, sort_points
from dlogen.stages.prepare import check_given_radius
from dlogen.stages.quality.checks import check_radius, check_radius_along, on_surface
from dlogen.stages.quality.residual import foot_points
from dlogen.stages.quality.walk import check_walk
from dlogen.stages.scale import estimate_scale
from dlogen.types import Cloud, FittedLine, Intermediate


def paper_line(cloud: Cloud, config: Config, clock: Clock) -> FittedLine:
    """Normals, projection (Eq. 4), sorting walk (Eq. 5-6) and regression (Eq. 7-11).

    Args:
        cloud: near the origin, metres.
        config: `r`, `r_n`, `N`, `beta` and the sections normals, projection, sorting and skeleton.
        clock: takes the time of each stage.

    Raises:
        ConfigError: the configuration does not fit the cloud.
        FitError: no line can be made from it.
    """
    points = cloud.points
    with clock.stage("scale"):
        known = given(config.r)
        check_given_radius(points, known)
        free = estimate_scale(points)
        radius = free.radius if known is None else known
        r_n = choose_search_radius(points, radius) if config.r_n == AUTO else config.r_n
        if r_n < 2.0 * radius:
            raise ConfigError(
                f"r_n = {r_n:g} m is below the diameter 2 r = {2 * radius:g} m",
                "the search radius has to span the object (paper III.B): leave r_n at auto, or try 8 r",
            )

    with clock.stage("normals"):
        normals, neighbours = outward_normals(cloud, radius, config.normals)

    with clock.stage("projection"):
        projected = project(points, normals, radius) if config.projection.enabled else points

    with clock.stage("sorting"):
        start = choose_start(projected) if config.sorting.start == AUTO else config.sorting.start
        if start >= len(points):
            raise ConfigError(
                f"sorting.start = {start}, but the cloud has {len(points)} points", "points are counted from 0"
            )
        walk = sort_points(projected, normals, r_n, start)
        reached = projected[walk.index]

    with clock.stage("skeleton"):
        basis = paper_basis(given(config.N), given(config.skeleton.tau))
        beta = choose_beta(basis, reached, walk.s) if config.beta == AUTO else config.beta
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

    chosen = {"r": radius, "r_n": r_n, "N": basis.size, "beta": beta, "skeleton.tau": basis.tau, "sorting.start": start}
    if neighbours is not None:
        chosen["normals.neighbours"] = neighbours
    return FittedLine(
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
            *check_radius(known, free),
        ),
        chosen,
    )
