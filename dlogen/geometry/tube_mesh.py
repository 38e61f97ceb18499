"""The tube around the skeleton line as a triangle mesh (the paper's Fig. 8a): a circle swept along the line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dlogen.geometry.arc_length import even_parameters
from dlogen.geometry.curvature import curvature
from dlogen.geometry.parallel_transport import minimal_rotation_frames
from dlogen.geometry.vectors import unit
from dlogen.types import Array, IntArray, Skeleton

#: Places along the line that its curvature is looked at.
_SAMPLES = 2001

#: Nobody wants more rings; a line that asks for them is not smooth.
_MOST_RINGS = 20_000


@dataclass(frozen=True, eq=False)
class TubeMesh:
    """A closed triangle mesh.

    Attributes:
        vertices: (V, 3) metres: the rings one after another, then the centres of the first and of the last one.
        faces: (F, 3) indices of vertices, anticlockwise seen from outside.
        s: (R,) material coordinates of the rings.
        sides: vertices in a ring.
    """

    vertices: Array
    faces: IntArray
    s: Array
    sides: int


def tube_mesh(line: Skeleton, radius: float, *, tolerance: float = 0.005, origin: Array | None = None) -> TubeMesh:
    """Sweep a circle along the skeleton line, closed with flat ends.

    The vertices of a ring lie on the tube, at the radius from f(s) in the plane across the line. The rings are turned
    against one another by the smallest rotation, so that the mesh has no twist. Their number follows from the curvature
    and that of their vertices from the radius: nowhere does the mesh leave the tube by much more than the tolerance.

    Where the line is bent more tightly than the radius, rings cut into one another: the mesh is still closed, but meets
    itself, as the tube would.

    Args:
        line: the skeleton line.
        radius: of the tube, metres.
        tolerance: largest distance between mesh and tube as a fraction of the radius; 0.005 gives 32 sides.
        origin: (3,) a place near the line that the vertices are relative to, metres; by default that of the line's
            frame.

    Returns:
        The mesh; faces outward.
    """
    sides = max(8, math.ceil(math.pi / math.acos(1.0 - tolerance)))
    s = _rings(line, radius, tolerance)
    # Taken off before anything is added: far from the origin the vertices keep their digits.
    centres = line(s) - (0.0 if origin is None else origin)
    frames = minimal_rotation_frames(unit(line(s, 1)))
    angle = np.arange(sides) * (2.0 * math.pi / sides)
    circle = radius * np.stack([np.zeros(sides), np.cos(angle), np.sin(angle)])
    rings = centres[:, None] + np.swapaxes(frames @ circle, 1, 2)
    vertices = np.vstack([rings.reshape(-1, 3), centres[0], centres[-1]])
    return TubeMesh(vertices, _faces(len(s), sides), s, sides)


def _rings(line: Skeleton, radius: float, tolerance: float) -> Array:
    """Where the rings are: between two of them the line leaves its chord by tolerance * radius.

    A chord of length h is h^2 kappa / 8 off its arc, so the rings stand sqrt(kappa / (8 tolerance radius)) a metre
    dense.
    """
    s = even_parameters(line, _SAMPLES)
    # Margins of the basis included: the mesh shows the line as it is.
    density = np.sqrt(curvature(line, s) / (8.0 * tolerance * radius))
    # Straight pieces need few; none at all would make triangles as long as the object.
    density = np.maximum(density, 0.05 / radius)
    step = line.length / (_SAMPLES - 1)
    count = np.concatenate([[0.0], np.cumsum(0.5 * step * (density[:-1] + density[1:]))])
    rings = min(max(math.ceil(count[-1]), 1), _MOST_RINGS) + 1
    result: Array = np.interp(np.linspace(0.0, count[-1], rings), count, s)
    return result


def _faces(rings: int, sides: int) -> IntArray:
    """Two triangles for each side of each stretch between two rings, and a fan for each end."""
    i, j = np.arange(rings - 1)[:, None] * sides, np.arange(sides)
    following = (j + 1) % sides
    a, b, c, d = (np.ravel(index) for index in (i + j, i + following, i + sides + j, i + sides + following))
    last = (rings - 1) * sides
    start, end = np.full(sides, rings * sides), np.full(sides, rings * sides + 1)
    triangles = [(a, b, d), (a, d, c), (start, following, j), (end, last + j, last + following)]
    return np.concatenate([np.stack(corners, axis=1) for corners in triangles]).astype(np.intp)
