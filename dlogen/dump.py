"""What every stage made, as files that other tools open: PLY (CloudCompare, MeshLab, Open3D) and CSV."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dlogen.model import Array
from dlogen.stages.curvature import curvature

if TYPE_CHECKING:
    from dlogen.model import Result


def dump_files(result: Result) -> dict[str, bytes]:
    """File names and contents, numbered in the order of the paper's section III; metres.

    The sorted points carry their coordinate s as a property and as a colour from dark blue (s = 0) to yellow (s = 1).
    """
    made = result.intermediates
    order = made.sorted
    line = result.skeleton
    s = np.linspace(0.0, 1.0, len(result.skeleton_points))
    chain = result.chain
    rotation = chain.transforms[:, :3, :3].reshape(-1, 9)
    return {
        "1_normals.ply": _ply(made.points, {**_xyz("n", made.normals)}),
        "2_projected.ply": _ply(made.projected, {}),
        "3_sorted.ply": _ply(made.projected[order.index], {"s": order.s}, colour=order.s),
        "3_unreached.ply": _ply(made.projected[order.unreached], {}),
        "4_skeleton.csv": _csv("s,x,y,z,curvature", s, line(s), curvature(line, s)),
        "5_joints.csv": _csv("s,x,y,z", chain.s, chain.joints),
        "6_chain.csv": _csv(
            "length,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33", chain.lengths, chain.transforms[:, :3, 3], rotation
        ),
        "7_mdtw.csv": _csv("s,error,skeleton_index,chain_index", result.mdtw.s, result.mdtw.error, result.mdtw.path),
    }


def _xyz(prefix: str, vectors: Array) -> dict[str, Array]:
    return {f"{prefix}{axis}": vectors[:, i] for i, axis in enumerate("xyz")}


def _ply(points: Array, extra: Mapping[str, Array], colour: Array | None = None) -> bytes:
    """Binary little-endian PLY with double properties and, from `colour` in [0, 1], red, green and blue."""
    columns = {**_xyz("", points), **extra}
    kinds = [(name, "<f8") for name in columns]
    header = [f"property double {name}" for name in columns]
    if colour is not None:
        kinds += [(name, "u1") for name in ("red", "green", "blue")]
        header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    rows = np.empty(len(points), dtype=kinds)
    for name, values in columns.items():
        rows[name] = values
    if colour is not None:
        for name, values in zip(("red", "green", "blue"), _colours(colour).T, strict=True):
            rows[name] = values
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *header, "end_header", ""]
    return "\n".join(head).encode() + rows.tobytes()


def _colours(value: Array) -> np.ndarray:
    """Dark blue, teal, yellow: readable without colour vision and in print, since brightness grows with the value."""
    stops = np.array([[48, 18, 92], [38, 130, 142], [253, 231, 37]], dtype=float)
    return np.stack([np.interp(value, [0.0, 0.5, 1.0], stops[:, i]) for i in range(3)], axis=1).round().astype("u1")


def _csv(header: str, *columns: Array) -> bytes:
    table = np.column_stack(columns)
    out = io.StringIO()
    out.write(header + "\n")
    for row in table.tolist():
        out.write(",".join(repr(value) for value in row) + "\n")
    return out.getvalue().encode()
