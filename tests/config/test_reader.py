"""Where values come from: files, standard input, overrides; what is no configuration."""

from __future__ import annotations

import io
import sys

import pytest
from configurations import refused

from dlogen.config.fields import AUTO
from dlogen.config.reader import load_config


def test_precedence_is_last_override_then_file_then_default(write):
    path = write("r: 0.01\ne_max: 0.002\nN: 30\n")
    config = load_config(path, ["e_max=0.003", "N=31", "N=32"])
    assert (config.r, config.e_max, config.N, config.beta) == (0.01, 0.003, 32, AUTO)


def test_an_override_can_go_back_to_auto(write):
    assert load_config(write("r: 0.01\n"), ["r=auto"]).r == AUTO


@pytest.mark.parametrize("override", ["normals.neighbours=20", " normals.neighbours = 20 ", "normals.neighbours=20.0"])
def test_dotted_override(override):
    assert load_config(None, [override]).normals.neighbours == 20


def test_override_of_a_text_is_taken_as_it_is():
    assert load_config(None, ["material.name=316"]).material.name == "316"
    assert load_config(None, ["material.name=a: b = #c"]).material.name == "a: b = #c"


@pytest.mark.parametrize(
    ("override", "says", "hint"),
    [
        ("r", "--set r: expected KEY=VALUE", "--set e_max=0.005"),
        ("=1", "unknown key ''", "known keys"),
        ("r=", "--set r=: r = nothing: expected a number", "leave the key out"),
        ("r=-1", "--set r=-1: r = -1: expected a number > 0", "Radius"),
        ("projection.enabled=no", "projection.enabled = 'no': expected true or false", "true or false"),
        ("normals=3", "--set normals=3: normals is a section", "--set normals.neighbours=..."),
        ("material.name=", "material.name = '': expected text", "Name"),
        ("e_max=0.005=1", "e_max = '0.005=1'", "Largest"),
        ("r=\udcff\x1b[31m", r"--set 'r=\udcff\x1b[31m'", "Radius"),
        (f"r={'x' * 200}", "...: r = ", "Radius"),
    ],
)
def test_wrong_override(override, says, hint):
    error = refused(None, [override])
    assert says in error.message
    assert hint in error.hint
    error.message.encode()
    assert len(error.message) < 250


def test_a_broken_file_is_not_mended_by_an_override(write):
    assert "r = -1" in refused(write("r: -1\n"), ["r=0.02"]).message


def test_byte_order_mark_and_crlf(write):
    assert load_config(write(b"\xef\xbb\xbfr: 0.02\r\nnormals:\r\n  neighbours: 12\r\n")).normals.neighbours == 12


def test_standard_input(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"r: 0.02\nN: x\n")))
    error = refused("-")
    assert str(error).startswith("standard input: line 2: N = 'x'")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"r: 0.02\n")))
    assert load_config("-").r == 0.02


def test_key_given_twice(write):
    error = refused(write("r: 0.01\nN: 21\nr: 0.02\n"))
    assert error.message == "line 3: 'r' is given twice, first in line 1"
    error = refused(write("normals:\n  radius: 0.01\n  radius: 0.01\n"))
    assert error.message == "line 3: 'normals.radius' is given twice, first in line 2"
    error = refused(write("mdtw: {samples: 5}\nr: 0.01\nmdtw: {samples: 5}\n"))
    assert error.message == "line 3: 'mdtw' is given twice, first in line 1"


def test_syntax_error_names_file_and_line(write):
    error = refused(write("r: 1\nnormals:\n\tradius: 2\n"))
    assert str(error.path).endswith("cfg.yaml")
    assert error.message.startswith("line 3: ")
    assert "tab" in error.message


def test_missing_file(tmp_path):
    error = refused(tmp_path / "none.yaml")
    assert error.message == "no such configuration file"
    assert str(error.path).endswith("none.yaml")
    assert "dlogen config show" in error.hint


def test_folder(tmp_path):
    assert "folder" in refused(tmp_path).message


def test_impossible_names():
    assert "cannot be read" in refused("a\0b").message
    assert "cannot be read" in refused("x" * 5000).message


def test_not_utf8(write):
    assert refused(write(b"r: 0.02\n# \xff\n")).message == "line 2: not UTF-8 text"
    assert "not UTF-8" in refused(write("r: 0.02\n".encode("utf-16"))).message


def test_a_cloud_by_mistake(write):
    assert "not a configuration" in refused(write(b"ply\n" + b"0 0 0\n" * 100_000)).message
    assert "expected keys and values" in refused(write(b"ply\nformat ascii 1.0\nelement vertex 1\n")).message
    assert "U+0000" in refused(write(b"a: 1\nb: \0\1\2")).message


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /dev/zero")
def test_endless_file():
    assert "larger than" in refused("/dev/zero").message
