"""Curves that are known, and files of all kinds that hold them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dlogen.errors import InputError
from dlogen.io.curves.curve import load_curve

HOOK = np.array([[0.0, 0, 0.1], [0.3, 0, 0.1], [0.3, 0.2, 0.1], [0.3, 0.2, -0.25]])


def bent(s: np.ndarray) -> np.ndarray:
    return np.c_[np.sin(np.pi * s), 2 * np.cos(np.pi * s) - 1, 0 * s]


def helical(s: np.ndarray) -> np.ndarray:
    return np.c_[0.5 * np.sin(3 * np.pi * s), 0.5 * np.cos(3 * np.pi * s), 0.5 * s]


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def table(points: np.ndarray, delimiter: str = ",", header: str | None = None) -> str:
    lines = [delimiter.join(repr(float(value)) for value in row) for row in points]
    return "\n".join([*([header] if header is not None else []), *lines]) + "\n"


def refused(source: str | Path, words: str) -> InputError:
    """The refusal: with those words, the file's name and a hint."""
    with pytest.raises(InputError) as caught:
        load_curve(source)
    error = caught.value
    assert words in error.message, error
    assert error.hint
    assert str(error.path).startswith(str(source).replace("-", "stdin", 1) if source == "-" else str(source))
    assert error.exit_code == 2
    return error


def truth(points: object, **more: object) -> str:
    return json.dumps({"schema": "dlogen.truth/1", "units": "m", "points": points} | more)


def joint(name: str, parent: str, child: str, origin: str = 'xyz="1 0 0"', kind: str = "revolute") -> str:
    limit = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>' if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin {origin}/>'
        f"{limit}</joint>"
    )


def robot(*joints: str, links: str | None = None, bodies: bool = True) -> str:
    names = dict.fromkeys(word for text in joints for word in text.split('link="')[1:3])
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    made = "".join(f'<link name="{n.split(chr(34))[0]}">{body if bodies else ""}</link>' for n in names)
    return f'<?xml version="1.0"?>\n<robot name="arm">{made if links is None else links}{"".join(joints)}</robot>'


def ply(points: np.ndarray, edges: object = (), faces: int = 0, claimed: int | None = None) -> str:
    edges = np.reshape(edges, (-1, 2)).astype(int)
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    if len(edges):
        header += [f"element edge {len(edges) if claimed is None else claimed}"]
        header += ["property int vertex1", "property int vertex2"]
    if faces:
        header += [f"element face {faces}", "property list uchar int vertex_indices"]
    rows = [
        " ".join(map(str, row)) for part in (points.tolist(), edges.tolist(), [[3, 0, 1, 2]] * faces) for row in part
    ]
    return "\n".join([*header, "end_header", *rows, ""])
