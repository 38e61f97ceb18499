"""The tube and the chain as meshes, read back by trimesh."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from read_meshes import load, written

from dlogen.evaluation.shapes import hose_centre_line


def test_one_straight_segment(straight, make_result) -> None:
    result = make_result(straight([1, 2, 3], [1, 2, 4]), 0.01)
    assert load("glb", result).to_geometry().is_watertight
    assert set(load("chain-glb", result).graph.nodes_geometry) == {"segment_01", "joint_00", "joint_01"}


def test_the_same_bytes_in_every_process() -> None:
    # Sets of names inside trimesh are ordered by hashes, which differ from process to process.
    code = (
        "import sys, hashlib, dlogen; from dlogen.evaluation.synthetic import *;"
        "from dlogen.evaluation.shapes import centre_line;"
        "from dlogen.io.registry import model_format;"
        "import numpy as np;"
        "c = sample_tube(centre_line('straight'), 0.02, 2000, np.random.default_rng(0));"
        "r = dlogen.fit(c.points, {'r': 0.02});"
        "d = [w for n in ('glb', 'obj', 'ply-mesh', 'chain-glb') for w in model_format(n).write(r, 'x').values()];"
        "print(hashlib.sha256(b''.join(d)).hexdigest())"
    )
    found = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONHASHSEED": value},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for value in ("0", "4242")
    ]
    assert found[0] == found[1]


def test_pillow_is_not_needed(fitted, make_result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    result = make_result(fitted(hose_centre_line()), 0.02, 0.01)
    assert written("glb", result).startswith(b"glTF")
    assert written("chain-glb", result).startswith(b"glTF")
