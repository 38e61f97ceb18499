"""Curves from files: every kind against points that are known, and everything else refused in so many words."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from curve_files import HOOK, ply, refused, table, written
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.errors import InputError
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import truth, truth_bytes
from dlogen.io.cloud_files import write_cloud
from dlogen.io.curves.curve import KINDS, Curve, load_curve
from dlogen.io.json_text import dump_json
from dlogen.io.models import chain as chain_json
from dlogen.io.models import urdf
from dlogen.io.report import report_dict
from dlogen.types import FitData


def test_a_chain_is_its_joints_unless_the_skeleton_is_asked_for(result: FitData, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.json", chain_json.write(result, "cable")["cable.json"])
    chain, named, skeleton = load_curve(path), load_curve(f"{path}#chain"), load_curve(f"{path}#skeleton")
    assert (chain.kind, chain.is_chain, chain.name) == ("chain", True, str(path))
    assert np.array_equal(chain.points, result.chain.joints)
    assert np.array_equal(named.points, chain.points)
    assert (skeleton.kind, skeleton.is_chain) == ("skeleton", False)
    assert np.array_equal(skeleton.points, result.skeleton_points)
    assert chain.length == pytest.approx(result.chain.length)


def test_truth(tmp_path: Path) -> None:
    line = centre_line("helical")
    (tmp_path / "t.json").write_bytes(truth_bytes(truth(line, 0.02, {}, None)))
    curve = load_curve(tmp_path / "t.json")
    assert (curve.kind, curve.is_chain) == ("truth", False)
    assert curve.points == pytest.approx(line.points(1000), abs=1e-9)
    assert curve.length == pytest.approx(line.length, rel=1e-5)


def test_a_report_is_told_from_a_chain(result: FitData, tmp_path: Path) -> None:
    error = refused(written(tmp_path, "cable.report.json", dump_json(report_dict(result))), "report")
    assert "NAME.json" in str(error.hint)


def test_a_part_that_is_not_there(result: FitData, tmp_path: Path) -> None:
    path = written(tmp_path, "cable.json", chain_json.write(result, "cable")["cable.json"])
    error = refused(f"{path}#joints", "'joints'")
    assert "chain, skeleton" in str(error.hint)
    refused(f"{written(tmp_path, 'a.csv', table(HOOK))}#skeleton", "'skeleton'")


def test_a_file_whose_name_has_the_mark_itself(tmp_path: Path) -> None:
    path = written(tmp_path, "run#skeleton", table(HOOK))
    assert load_curve(path).kind == "csv"
    assert load_curve(f"{path}#csv").kind == "csv"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"\n\n", "not a curve"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n", "Git LFS"),
        (b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n", "point cloud"),
        (b"<!DOCTYPE html>\n<html><body>Not Found", "web page"),
        (b"solid cable\nfacet normal 0 0 1\n", "STL"),
        (b"import numpy as np\n", "not a curve"),
        (bytes(range(256)) * 20, "not a curve"),
        (b"\x1f\x8b\x08\x00\x00\x00", "gzip"),
    ],
)
def test_files_of_other_kinds_are_named(tmp_path: Path, content: bytes, words: str) -> None:
    refused(written(tmp_path, "thing.dat", content), words)


def test_the_hint_names_all_kinds(tmp_path: Path) -> None:
    hint = str(refused(written(tmp_path, "a.py", "import numpy\n"), "not a curve").hint)
    assert all(kind in hint for kind in KINDS)


@settings(deadline=None, max_examples=150)
@given(st.binary(max_size=300), st.sampled_from([b"", b"ply\n", b"{", b"<robot>", b"x,y,z\n", b'{"schema": "dlogen.']))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes, start: bytes) -> None:
    path = written(tmp_path_factory.mktemp("f"), "a.csv" if len(data) % 2 else "a.dat", start + data)
    try:
        assert isinstance(load_curve(path), Curve)
    except InputError as error:
        assert error.hint and error.path == str(path)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert "check the path" in str(refused(tmp_path / "none.json", "No such file").hint)
    refused(tmp_path, "cannot read")


def test_stdin(monkeypatch: pytest.MonkeyPatch, result: FitData, tmp_path: Path) -> None:
    def pipe(data: bytes, terminal: bool = False) -> None:
        stream = SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: terminal)
        monkeypatch.setattr(sys, "stdin", stream)

    chain = chain_json.write(result, "cable")["cable.json"]
    write_cloud(tmp_path / "a.ply", HOOK)
    for data, kind in (
        (chain, "chain"),
        (table(HOOK).encode(), "csv"),
        (urdf.write(result, "cable")["cable.urdf"], "urdf"),
        ((tmp_path / "a.ply").read_bytes(), "ply"),
        (ply(HOOK, [[0, 1], [1, 2], [2, 3]]).encode(), "ply"),
    ):
        pipe(data)
        curve = load_curve("-")
        assert (curve.kind, curve.name) == (kind, "stdin")
    pipe(chain)
    assert load_curve("-#skeleton").kind == "skeleton"
    pipe(b"")
    refused("-", "empty")
    pipe(b"", terminal=True)
    refused("-", "nothing is piped in")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("text", [table(HOOK), ply(HOOK)])
def test_named_pipes(tmp_path: Path, text: str) -> None:
    import threading

    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert load_curve(pipe).points == pytest.approx(HOOK)
    writer.join()


def test_the_public_names_are_the_functions() -> None:
    # A public name that is a module's as well would turn into the module when that is imported.
    import dlogen

    for name in dlogen.__all__:
        if name != "__version__":
            assert callable(getattr(dlogen, name)) and callable(getattr(dlogen, name)), name
    assert dlogen.compare(HOOK, HOOK)["max"] == 0.0
    assert dlogen.load_curve is load_curve
