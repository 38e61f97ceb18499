"""Gauss-Newton on the distance of surface points to the tube around a curve, with smoothing chosen from the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.vectors import column_dots
from dlogen.stages.refined.linearisation import LOG_LAMBDA, Linearisation
from dlogen.stages.refined.medial import cells
from dlogen.stages.refined.normal_equations import NormalEquations, normal_equations
from dlogen.stages.refined.shared_noise import PATCH, patch_inflation
from dlogen.stages.refined.tube import Tube, expected_distance, median, robust_scale, tukey
from dlogen.stages.refined.tube_curve import (
    TubeCurve,
    evened,
    foot_points,
    nearest,
    nearest_by_cells,
)
from dlogen.types import Array, BoolArray, IntArray

#: The least of it as long as the curve is far from the points: it keeps ends in place that hardly a point holds.
_LOG_ROUGH = -3.0

#: Points that are worked on at a time: bounds the memory, and stays in the processor's cache.
_CHUNK = 1 << 14

#: Smallest scale of the robust weights in the last steps, in radii: the error of the curve itself.
LEAST_FLOOR = 5e-4

#: A step that changes the distances by less than the sum of these, in radii and in standard deviations, is the last.
_STILL, _STILL_NOISE = 1e-5, 0.02

#: Noise over radius up to which clouds are exact.
_EXACT = 0.01

#: Fewest points near the curve that a fit goes on with.
_FEWEST = 10


def gauss_newton(
    points: Array, tube: Tube, *, free_radius: bool, steps: int, floor: float, search: bool = False
) -> Tube:
    """Gauss-Newton on the robust squared distances of points to a tube, until steps are small beside the noise.

    The residual of a point is |p - f(u)| - E|p - f(u)| with u its foot point; since f'(u) is normal to p - f(u), its
    derivative with respect to the coefficient j is -B_j(u) times the unit vector from axis to point. No normals and no
    full circumference are needed.

    Args:
        points: (3, M), metres.
        tube: where to start.
        free_radius: whether the radius is estimated.
        steps: the most steps.
        floor: smallest scale of the robust weights, in radii. A scale below the error of the curve itself would make
            outliers of whole bends.
        search: look for the nearest place on the whole curve first, not only near the present feet.

    Returns:
        The tube after the last step, its speed not evened; x and distances are those to the curve before it.

    Raises:
        FitError: hardly any points near the curve.
    """
    curve, radius, sigma, x = tube.curve, tube.radius, tube.sigma, tube.x
    smoothing, solution, shared = tube.smoothing, tube.solution, tube.shared
    if search:
        x = nearest(curve, points, 0.5 * radius)
    patch = cells(points.T, PATCH * radius)[0]
    for step in range(steps):
        if step > 0:
            curve = evened(curve)
        x, k, t, offset = foot_points(curve, points, x, 2 if search and step == 0 else 1)
        distance = np.sqrt(column_dots(offset, offset))
        expected = expected_distance(radius, sigma)
        near = (x > 0.0) & (x < curve.intervals) & (distance < expected + radius)
        if np.count_nonzero(near) < _FEWEST:
            raise FitError(
                f"only {np.count_nonzero(near)} of {len(x)} points are near the line that the fit started from",
                "check r and units: dlogen info shows what the cloud suggests",
                stage="refine",
            )
        direction = offset / np.maximum(distance, 1e-12 * radius)
        if tube.solid:
            sums = _solid_normals(curve, k, t, direction, distance, near)
        else:
            residual = distance - expected
            inside = residual[near]
            scale = robust_scale(inside)
            # A wrong radius shifts all residuals; only their spread about that is noise.
            sigma = min(scale, robust_scale(inside - median(inside)))
            weight = np.where(near, tukey(residual, max(scale, floor * radius)), 0.0)
            # What is left over without noise is the curve's own error, which neighbours share as well.
            noisy = sigma**2 / (sigma**2 + (_EXACT * radius) ** 2)
            more = patch_inflation(patch, residual, near & (np.abs(residual) < 4.0 * scale)) - 1.0
            shared = 1.0 + noisy * more
            sums = normal_equations(k, t, direction, residual, weight, curve.intervals).scaled(
                1.0 / shared, 1.0 / shared
            )
        problem = Linearisation(curve, sums, free_radius)
        solution = problem.best(smoothing, _LOG_ROUGH if floor >= 0.1 else LOG_LAMBDA[0])
        smoothing = solution.smoothing
        radius = max(radius + solution.radius_step, 0.2 * radius)
        curve = solution.curve
        # The next step would be some ten times smaller again.
        if step < steps - 1 and problem.moved(solution) < _STILL * radius + _STILL_NOISE * sigma:
            break
    return Tube(curve, radius, sigma, x, distance, smoothing, solution, tube.solid, shared)


def _solid_normals(
    curve: TubeCurve, k: IntArray, t: Array, direction: Array, distance: Array, near: BoolArray
) -> NormalEquations:
    """Normal equations for an axis through the points themselves: both components of their offset across the axis."""
    # The median of the distance of a two-dimensional Gaussian is 1.1774 standard deviations.
    weight = np.where(near, tukey(distance, float(np.median(distance[near])) / 1.1774), 0.0)
    tangent = curve.at(k, t, 1)
    sideways = np.cross(tangent, direction, axis=0)
    sideways /= np.maximum(np.sqrt(column_dots(sideways, sideways)), 1e-9)
    along = normal_equations(k, t, direction, distance, weight, curve.intervals)
    return along + normal_equations(k, t, sideways, np.zeros_like(distance), weight, curve.intervals)


def all_points(points: Array, tube: Tube, *, free_radius: bool, steps: int, search: bool) -> Tube:
    """Steps as in `gauss_newton` over any number of points, in chunks, and the feet of all points at the end.

    Args:
        points: (3, M), metres.
        tube: a tube that is nearly right.
        free_radius: whether the radius is estimated.
        steps: number of steps; 0 only finds the feet.
        search: whether the points are others than those of the tube, so that their feet have to be looked for.

    Returns:
        The tube with x and distance of every point to its curve.
    """
    # The more points there are, the more of them share their noise.
    shared = 1.0 + (tube.shared - 1.0) * points.shape[1] / len(tube.x)
    x = nearest_by_cells(tube.curve, points, 0.5 * tube.radius) if search else tube.x.copy()
    distance = np.empty(len(x))
    for step in range(steps + 1):
        curve, radius = tube.curve, tube.radius
        expected = expected_distance(radius, tube.sigma)
        sums = None
        for first in range(0, len(x), _CHUNK):
            part = slice(first, first + _CHUNK)
            x[part], k, t, offset = foot_points(curve, points[:, part], x[part], 2 if search else 1)
            distance[part] = away = np.sqrt(column_dots(offset, offset))
            if step < steps:
                near = (x[part] > 0.0) & (x[part] < curve.intervals)
                weight = np.where(near, tukey(away - expected, max(tube.sigma, LEAST_FLOOR * radius)), 0.0)
                direction = offset / np.maximum(away, 1e-12 * radius)
                more = normal_equations(k, t, direction, away - expected, weight, curve.intervals)
                sums = more if sums is None else sums + more
        search = False
        residual = distance - expected
        near = (x > 0.0) & (x < curve.intervals) & (np.abs(residual) < radius)
        if np.count_nonzero(near) < _FEWEST:
            raise FitError("the line that was found is not near the points", "check r and units", stage="refine")
        tube = replace(tube, sigma=robust_scale(residual[near]), x=x, distance=distance, shared=shared)
        if sums is not None:
            sums = sums.scaled(1.0 / shared, 1.0 / shared)
            solution = Linearisation(curve, sums, free_radius).best(tube.smoothing)
            tube = replace(
                tube,
                curve=evened(solution.curve),
                radius=radius + solution.radius_step,
                smoothing=solution.smoothing,
                solution=solution,
            )
    return tube
