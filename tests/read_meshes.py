"""Meshes as they are written, and read back by trimesh."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from dlogen.io.registry import model_format

FAR = np.array([5e6, -4e6, 300.0])


def written(name: str, result: Any) -> bytes:
    (path, content), *others = model_format(name).write(result, "cable").items()
    assert not others
    assert (path,) == model_format(name).files("cable")
    return content


def load(name: str, result: Any) -> Any:
    import trimesh

    suffix = model_format(name).suffixes[0].rpartition(".")[2]
    return trimesh.load(io.BytesIO(written(name, result)), file_type=suffix)
