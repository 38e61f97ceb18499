"""Unknown keys lead to those that were meant."""

from __future__ import annotations

import pytest
from configurations import refused


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("neighbors", "normals.neighbours"),
        ("neighbour", "normals.neighbours"),
        ("k", "normals.neighbours"),
        ("radius", "'r' or 'normals.radius'"),
        ("diameter", "'r'"),
        ("emax", "'e_max'"),
        ("e-max", "'e_max'"),
        ("max_error", "'e_max'"),
        ("tolerence", "'e_max'"),
        ("n", "'N'"),
        ("R", "'r'"),
        ("rn", "'r_n'"),
        ("Beta", "'beta'"),
        ("betta", "'beta'"),
        ("lambda", "'beta'"),
        ("profil", "'profile'"),
        ("unit", "'units'"),
        ("density", "'material.density'"),
        ("tau", "'skeleton.tau'"),
        ("samples", "'mdtw.samples'"),
        ("normal", "'normals'"),
        ("skelton", "'skeleton'"),
    ],
)
def test_unknown_key_names_the_nearest(write, key, near):
    error = refused(write(f"seed: 1\n{key}: 2\n"))
    assert error.message == f"line 2: unknown key '{key}'"
    assert error.hint.startswith("did you mean ")
    assert near in error.hint
    assert str(error.path).endswith("cfg.yaml")
    assert refused(None, [f"{key}=2"]).hint == error.hint


@pytest.mark.parametrize(
    ("content", "line", "key", "near"),
    [
        ("normals:\n  neighbors: 2\n", 2, "normals.neighbors", "'normals.neighbours'"),
        ("normals: {density: 2}\n", 1, "normals.density", "'material.density'"),
        ("material:\n  rho: 2\n", 2, "material.rho", "'material.density'"),
        ("mdtw:\n  sample: 2\n", 2, "mdtw.sample", "'mdtw.samples'"),
    ],
)
def test_unknown_key_in_a_section(write, content, line, key, near):
    error = refused(write(content))
    assert error.message == f"line {line}: unknown key '{key}'"
    assert error.hint == f"did you mean {near}?"


def test_unknown_key_that_resembles_none_lists_the_known(write):
    error = refused(write("qqqq: 1\n"))
    assert error.hint.startswith("known keys: profile, units, r, ")
    assert "normals" in error.hint
    assert refused(write("mdtw: {qqqq: 1}\n")).hint == "known in mdtw: samples"
