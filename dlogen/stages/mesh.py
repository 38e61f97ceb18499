"""Clouds that are the vertices of a mesh: where these are too sparse for the surface, its faces are sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from dlogen.config.fields import AUTO
from dlogen.geometry.mesh_sampling import longest_edges, sample_triangles, triangle_areas
from dlogen.stages.prepare import without_far_points
from dlogen.stages.quality.findings import MESH_SAMPLED
from dlogen.types import Array, Cloud, Finding, FittedLine, IntArray

#: Vertices are too sparse where edges are so many times as long as vertices are apart on average, on more than this
#: share of the surface. Meshes of scans have edges of 1 to 2 times that.
_LONG, _SHARE = 4.0, 0.05
#: So few vertices are too sparse, too.
_FEW = 300
#: Points that a surface is sampled with, at least and at most; between, they are half a short edge apart.
_FEWEST, _MOST = 10_000, 200_000
#: Places of the line for each radius that distances of vertices are measured to, and the largest difference of those
#: distances, relative, that is one radius.
_PER_RADIUS, _ALIKE = 32.0, 0.1


def surface_points(cloud: Cloud, how: str = AUTO) -> tuple[Cloud, list[Finding]]:
    """The cloud, or points spread over its faces if it is a mesh whose vertices do not cover its surface.

    Args:
        cloud: the vertices, in any units.
        how: "auto"; "sample" samples the faces of every mesh, "vertices" those of none.

    Returns:
        Points of the surface, and what to say if they are sampled: then they have no normals, and the mesh; else not.
    """
    mesh = cloud.mesh
    if mesh is None:
        return cloud, []
    if how == "vertices":
        return replace(cloud, mesh=None), []
    near = without_far_points(cloud)[0].points
    triangles = _usable(mesh.vertices, mesh.triangles, near)
    area = triangle_areas(mesh.vertices, triangles)
    if not area.sum() > 0.0 or (how == AUTO and not _sparse(mesh.vertices, triangles, area, len(near))):
        return replace(cloud, mesh=None), []
    count = _count(mesh.vertices, triangles, area)
    points = sample_triangles(mesh.vertices, triangles, count)
    message = (
        f"a mesh with {len(near)} vertices and {len(triangles)} triangles: {count} points spread over its faces were "
        "used in place of its vertices"
    )
    return replace(cloud, points=points, normals=None), [MESH_SAMPLED.found(message)]


def with_vertex_radius(line: FittedLine, vertices: Array) -> FittedLine:
    """The line with the radius that the vertices have, where it was fitted to points of flat faces.

    The corners of a faceted pipe are on its surface, and its faces inside: a pipe with eight corners that is fitted to
    its faces has a radius that is 5 % too small.

    Args:
        line: fitted to points of the faces.
        vertices: (V, 3) of the mesh, in the frame of the line, metres; the missing ones are not finite.
    """
    vertices = vertices[np.isfinite(vertices).all(axis=1)]
    steps = min(_MOST, 2 + round(_PER_RADIUS * line.skeleton.length / line.radius))
    axis = line.skeleton(np.linspace(0.0, 1.0, steps))
    distance = cKDTree(axis).query(vertices, distance_upper_bound=1.5 * line.radius)[0]
    around = distance[(distance > 0.5 * line.radius) & np.isfinite(distance)]
    if len(around) < max(6.0, 0.5 * len(vertices)):
        return line
    low, radius, high = (float(value) for value in np.quantile(around, [0.25, 0.5, 0.75]))
    if high - low > _ALIKE * radius or radius < line.radius:
        return line
    return replace(line, radius=radius, chosen={**line.chosen, "r": radius})


def _usable(vertices: Array, triangles: IntArray, near: Array) -> IntArray:
    """The triangles whose corners are there, finite and among the points that are not far away."""
    triangles = triangles[((triangles >= 0) & (triangles < len(vertices))).all(axis=1)]
    inside = ((vertices >= near.min(axis=0)) & (vertices <= near.max(axis=0))).all(axis=1)
    usable: IntArray = triangles[inside[triangles].all(axis=1)]
    return usable


def _sparse(vertices: Array, triangles: IntArray, area: Array, count: int) -> bool:
    """Whether the vertices do not show where the surface is."""
    apart = np.sqrt(area.sum() / count)
    long = longest_edges(vertices, triangles) > _LONG * apart
    return bool(area[long].sum() > _SHARE * area.sum()) or count < _FEW


def _count(vertices: Array, triangles: IntArray, area: Array) -> int:
    """How many points show what the triangles show."""
    corners = vertices[triangles[area > 0.0]]
    shortest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    apart = 0.5 * float(np.quantile(shortest, 0.25))
    return int(np.clip(area.sum() / max(apart, 1e-300) ** 2, _FEWEST, _MOST))
