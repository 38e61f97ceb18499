"""Curves from PLY: vertices in order, or edges in any order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from curve_files import HOOK, helical, ply, refused, written

from dlogen.io.cloud_files import write_cloud
from dlogen.io.curves.curve import load_curve


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_vertices_in_file_order(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.ply"
    write_cloud(path, HOOK, encoding=encoding)
    curve = load_curve(path)
    assert (curve.kind, curve.is_chain) == ("ply", False)
    assert curve.points == pytest.approx(HOOK)


def test_ply_edges_give_the_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    line = helical(np.linspace(0, 1, 300))
    order = rng.permutation(len(line))  # vertex i of the file is order[i] on the line
    place = np.argsort(order)
    edges = np.stack([place[:-1], place[1:]], axis=1)
    edges = rng.permuted(edges[rng.permutation(len(edges))], axis=1)
    points = load_curve(written(tmp_path, "a.ply", ply(line[order], edges))).points
    assert np.array_equal(points, line if place[0] < place[-1] else line[::-1])


def test_ply_vertices_without_an_edge_are_left_out(tmp_path: Path) -> None:
    points = np.concatenate([[[9.0, 9, 9]], HOOK])
    path = written(tmp_path, "a.ply", ply(points, [[1, 2], [2, 3], [3, 4]]))
    assert np.array_equal(load_curve(path).points, HOOK)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ply(HOOK, [[0, 1], [1, 2], [2, 3], [3, 0]]), "no single open line"),
        (ply(HOOK, [[0, 1], [0, 2], [0, 3]]), "no single open line"),
        (ply(HOOK, [[0, 1], [2, 3]]), "no single open line"),
        (ply(np.tile(HOOK, (2, 1)), [[0, 1], [2, 3], [3, 4], [4, 2]]), "no single open line"),
        (ply(HOOK, [[0, 0], [0, 1]]), "no single open line"),
        (ply(HOOK, [[0, 1], [1, 4]]), "not there"),
        (ply(HOOK, [[0, 1], [1, -1]]), "not there"),
        (ply(HOOK, [[0, 1]], claimed=10**12), "claims 1000000000000"),
        (ply(HOOK, [[0, 1]], claimed=5), "claims 5"),
        (ply(HOOK, [[0, 1]]).replace("vertex2", "to"), "edges cannot be read"),
        (ply(HOOK, faces=1), "mesh"),
        (ply(np.full((3, 3), np.nan)), "not finite"),
        (ply(HOOK)[:60], ""),
    ],
)
def test_ply_that_is_no_curve(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, "a.ply", text), words)
