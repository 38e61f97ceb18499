"""Meshes of pipes as CAD programs export them: rings of vertices where a pipe begins, ends and bends only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pipe:
    """A mesh and what it is of.

    Attributes:
        vertices: (V, 3) metres.
        polygons: corners of each face.
        length: of the axis, metres.
        radius: metres.
    """

    vertices: np.ndarray
    polygons: list[tuple[int, ...]]
    length: float
    radius: float

    def ply(self, kind: str = "float", number: str = "%.9g") -> bytes:
        """As a text file."""
        lines = ["ply", "format ascii 1.0", f"element vertex {len(self.vertices)}"]
        lines += [f"property {kind} {axis}" for axis in "xyz"]
        lines += [f"element face {len(self.polygons)}", "property list uchar int vertex_indices", "end_header"]
        lines += [" ".join(number % value for value in vertex) for vertex in self.vertices]
        lines += [" ".join(map(str, (len(corners), *corners))) for corners in self.polygons]
        return "\n".join([*lines, ""]).encode()


def elbow(radius: float, straight: float, bend: float, corners: int = 32, rings: int = 16, caps: bool = False) -> Pipe:
    """Two straight pieces with a quarter bend between them.

    Args:
        radius: of the pipe, metres.
        straight: length of either piece, metres.
        bend: radius of the bend of the axis, metres.
        corners: of a cross-section.
        rings: of vertices in the bend.
        caps: close the ends with polygons.
    """
    around = 2 * np.pi * np.arange(corners) / corners
    across, up = radius * np.cos(around), radius * np.sin(around)
    turns = np.linspace(0.0, np.pi / 2, rings)
    found = [np.c_[np.zeros(corners), across, up]]
    found += [
        np.c_[straight + np.sin(turn) * (bend - across), bend - np.cos(turn) * (bend - across), up] for turn in turns
    ]
    found.append(np.c_[straight + bend - across, np.full(corners, bend + straight), up])
    count = len(found)
    faces: list[tuple[int, ...]] = [
        (k * corners + j, k * corners + (j + 1) % corners, (k + 1) * corners + (j + 1) % corners, (k + 1) * corners + j)
        for k in range(count - 1)
        for j in range(corners)
    ]
    if caps:
        faces += [tuple(range(corners)), tuple(range((count - 1) * corners, count * corners))]
    return Pipe(np.concatenate(found), faces, 2 * straight + bend * np.pi / 2, radius)
