"""What every stage made, as files that other tools open: PLY (CloudCompare, MeshLab, Open3D) and CSV."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from dlogen.geometry.curvature import curvature
from dlogen.io.parsing.ply_writer import write_ply
from dlogen.types import Array, IntArray

if TYPE_CHECKING:
    from dlogen.types import FitData, Intermediate


def dump_files(result: FitData) -> dict[str, bytes]:
    """File names and contents, numbered in the order in which they were made; metres.

    Points carry what the stage found about them as properties; sorted ones their coordinate s as a colour too, from
    dark blue (s = 0) to yellow (s = 1).
    """
    line, chain = result.skeleton, result.chain
    s = np.linspace(0.0, 1.0, len(result.skeleton_points))
    rotation = chain.transforms[:, :3, :3].reshape(-1, 9)
    files = {f"{item.name}.ply": _ply(item) for item in result.intermediates}
    files["skeleton.csv"] = csv_bytes("s,x,y,z,curvature", s, line(s), curvature(line, s))
    files["joints.csv"] = csv_bytes("s,x,y,z", chain.s, chain.joints)
    files["chain.csv"] = csv_bytes(
        "length,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33", chain.lengths, chain.transforms[:, :3, 3], rotation
    )
    files["mdtw.csv"] = csv_bytes(
        "s,error,skeleton_index,chain_index", result.mdtw.s, result.mdtw.error, result.mdtw.path
    )
    return {f"{i + 1}_{name}": content for i, (name, content) in enumerate(files.items())}


def _ply(item: Intermediate) -> bytes:
    """Binary little-endian PLY with double properties, and red, green and blue where there is something to colour."""
    columns = {**{axis: item.points[:, i] for i, axis in enumerate("xyz")}, **item.columns}
    kinds = [(name, "<f8") for name in columns]
    if item.colour is not None:
        channels = _colours(item.columns[item.colour]).T
        columns |= dict(zip(("red", "green", "blue"), channels, strict=True))
        kinds += [(name, "u1") for name in ("red", "green", "blue")]
    rows = np.empty(len(item.points), dtype=kinds)
    for name, values in columns.items():
        rows[name] = values
    stream = io.BytesIO()
    write_ply(stream, {"vertex": rows}, "binary_little_endian")
    return stream.getvalue()


def _colours(value: Array) -> np.ndarray:
    """Dark blue, teal, yellow: readable without colour vision and in print, since brightness grows with the value."""
    stops = np.array([[48, 18, 92], [38, 130, 142], [253, 231, 37]], dtype=float)
    shades = np.stack([np.interp(value, [0.0, 0.5, 1.0], stops[:, i]) for i in range(3)], axis=1)
    colours: np.ndarray = shades.round().astype("u1")
    return colours


def csv_bytes(header: str, *columns: Array | IntArray) -> bytes:
    """A table as CSV with a header; numbers read back as they are. Columns are (K,) or (K, D)."""
    table = np.column_stack(columns)
    out = io.StringIO()
    out.write(header + "\n")
    for row in table.tolist():
        out.write(",".join(repr(value) for value in row) + "\n")
    return out.getvalue().encode()
