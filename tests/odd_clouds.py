"""Cloud files written by hand that make reading hard: odd orders of fields, much between them, rows to be left out.

Nothing here uses dlogen, so that a mistake there cannot hide itself.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Rows:
    """Rows of a cloud file.

    Attributes:
        points, normals: (M, 3) as they stand in the file.
        kept: (M,) rows that are to be left after reading: finite, and the first in their place.
        unknown: (M,) rows of those whose normal is not a number.
    """

    points: Array
    normals: Array
    kept: Array
    unknown: Array


def with_defects(points: Array, normals: Array, seed: int, unknown: int = 0) -> Rows:
    """The rows with 300 others between them.

    Half of them are in the place of an earlier row, and have the opposite normal; of the others a part of the place is
    missing, or all of it.

    Args:
        points, normals: (M, 3).
        seed: of what is random.
        unknown: how many of the normals are lost.
    """
    rng = np.random.default_rng(seed)
    count = len(points)
    normals = normals.copy()
    normals[rng.choice(count, unknown, replace=False)] = np.nan
    source, again = rng.integers(0, count // 2, 150), np.sort(rng.integers(count // 2, count, 150))
    places = np.insert(points, again, points[source], axis=0)
    directions = np.insert(normals, again, -normals[source], axis=0)
    kept = np.insert(np.ones(count, dtype=bool), again, False)
    lost = np.sort(rng.integers(0, len(places), 150))
    lost[0] = 0
    nowhere = rng.normal(size=(150, 3))
    nowhere[np.arange(150), rng.integers(0, 3, 150)] = np.nan
    nowhere[::2] = np.nan
    nowhere[1::4, 1] = np.inf
    places = np.insert(places, lost, nowhere, axis=0)
    directions = np.insert(directions, lost, rng.normal(size=(150, 3)), axis=0)
    kept = np.insert(kept, lost, False)
    return Rows(places, directions, kept, kept & np.isnan(directions).any(axis=1))


def write_ply(path: Path, points: Array, normals: Array, encoding: str, *, lists: bool, shape: tuple[int, int]) -> None:
    """A PLY file with a label, lists of unlike lengths on request, other elements before and after, normals apart."""
    mark = {"binary_big_endian": ">"}.get(encoding, "<")
    listed = ["property list uchar int tags"] * lists
    head = [
        "ply",
        f"format {encoding} 1.0",
        "comment by hand",
        f"obj_info num_cols {shape[0]}",
        f"obj_info num_rows {shape[1]}",
        *("element seen 2", "property list uchar ushort who", "property float how_well"),
        f"element vertex {len(points)}",
        *("property double nz", "property uchar label", "property double y", *listed, "property double x"),
        *("property double nx", "property float confidence", "property double z", "property double ny"),
        *("element edge 1", "property int vertex1", "property int vertex2"),
        *("end_header", ""),
    ]
    text, binary = [], []
    for who in ((3, 1), (7,)):
        text.append(f"{len(who)} {' '.join(map(str, who))} 0.5")
        binary.append(struct.pack(f"{mark}B{len(who)}Hf", len(who), *who, 0.5))
    for k, ((x, y, z), (nx, ny, nz)) in enumerate(zip(points.tolist(), normals.tolist(), strict=True)):
        tags = list(range(k % 4)) if lists else []
        counted = [len(tags), *tags] if lists else []
        row = [nz, k % 200, y, *counted, x, nx, 0.25, z, ny]
        text.append(" ".join(map(repr, row)))
        binary.append(struct.pack(f"{mark}dBd{f'B{len(tags)}i' if lists else ''}ddfdd", *row))
    text.append("0 1")
    binary.append(struct.pack(f"{mark}2i", 0, 1))
    body = "\n".join([*text, ""]).encode() if encoding == "ascii" else b"".join(binary)
    path.write_bytes("\n".join(head).encode() + body)


def write_pcd(path: Path, points: Array, normals: Array, encoding: str, *, shape: tuple[int, int]) -> None:
    """A PCD file with normals apart, a field of three numbers, colours and padding between the coordinates."""
    x, y, z = points.T
    nx, ny, nz = normals.T
    count = len(points)
    numbers = np.arange(count)
    fields: list[tuple[str, str, Array]] = [
        ("normal_z", "<f8", nz),
        ("y", "<f8", y),
        ("rgb", "<u4", numbers),
        ("_", "u1", np.zeros((count, 4))),
        ("x", "<f8", x),
        ("normal_x", "<f8", nx),
        ("histogram", "<f4", np.column_stack([numbers, 0.5 * numbers, -numbers])),
        ("z", "<f8", z),
        ("normal_y", "<f8", ny),
    ]
    wide = [np.atleast_2d(values.T).T for _, _, values in fields]
    head = [
        "# .PCD v0.7 - by hand",
        "VERSION 0.7",
        "FIELDS " + " ".join(name for name, _, _ in fields),
        "SIZE " + " ".join(code[-1] for _, code, _ in fields),
        "TYPE " + " ".join(code[-2].upper() for _, code, _ in fields),
        "COUNT " + " ".join(str(values.shape[1]) for values in wide),
        f"WIDTH {shape[0]}",
        f"HEIGHT {shape[1]}",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {count}",
        f"DATA {encoding}",
        "",
    ]
    if encoding == "ascii":
        body = "".join(" ".join(map(repr, row)) + "\n" for row in np.hstack(wide).tolist()).encode()
    else:
        stored = [
            np.ascontiguousarray(values.astype(code)).view(np.uint8).reshape(count, -1)
            for (_, code, _), values in zip(fields, wide, strict=True)
        ]
        if encoding == "binary":
            body = np.hstack(stored).tobytes()
        else:  # PCL leaves the padding out; runs of up to 32 bytes that are stored as they are
            kept = [values for (name, _, _), values in zip(fields, stored, strict=True) if name != "_"]
            plain = b"".join(values.tobytes() for values in kept)
            runs = [plain[i : i + 32] for i in range(0, len(plain), 32)]
            packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
            body = struct.pack("<2I", len(packed), len(plain)) + packed
    path.write_bytes("\n".join(head).encode() + body)
