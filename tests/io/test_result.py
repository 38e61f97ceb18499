"""A result writes and draws itself: the files that were asked for, all of them or none."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from dlogen.errors import UsageError
from dlogen.io.registry import model_format
from dlogen.io.result import Result


@pytest.fixture(scope="module")
def result(fitted, helix, make_result) -> Result:
    made = make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01)
    return made if isinstance(made, Result) else Result(**vars(made))


def test_the_files_that_were_asked_for(result: Result, tmp_path: Path) -> None:
    paths = result.write(tmp_path / "new", ["urdf", "json-plain"])
    assert [path.name for path in paths] == ["cable.urdf", "cable.plain.json", "cable.report.json"]
    assert sorted(tmp_path.rglob("*.*")) == sorted(paths)
    for name, path in zip(("urdf", "json-plain"), paths, strict=False):
        (content,) = model_format(name).write(result, "cable").values()
        assert path.read_bytes() == content
    assert json.loads(paths[-1].read_bytes())["schema"] == "dlogen.report/1"
    # A text with commas is the same.
    again = result.write(tmp_path / "again", "urdf,json-plain")
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in paths]


def test_what_exists_stays_and_nothing_else_is_written(result: Result, tmp_path: Path) -> None:
    (tmp_path / "cable.json").write_text("mine")
    with pytest.raises(UsageError):
        result.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["cable.json"]
    assert (tmp_path / "cable.json").read_text() == "mine"
    result.write(tmp_path, force=True)
    assert json.loads((tmp_path / "cable.json").read_text())["schema"] == "dlogen.chain/1"
    assert (tmp_path / "cable.urdf").exists()


def test_a_format_that_is_none(result: Result, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="urfd"):
        result.write(tmp_path / "x", "urfd")
    assert not (tmp_path / "x").exists()


def test_the_model_is_made_once_and_has_the_links_of_the_chain(result: Result) -> None:
    assert result.model is result.model
    assert len(result.model.bodies) == len(result.chain.lengths)


def test_pictures(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    data = result.plot(tmp_path / "a.png")
    assert data.startswith(b"\x89PNG")
    assert (tmp_path / "a.png").read_bytes() == data == result.plot()
    names = [path.name for path in result.write(tmp_path / "out", "json", plot=True)]
    assert set(names) == {"cable.json", "cable.report.json", "cable.png"}
    assert (tmp_path / "out" / "cable.png").read_bytes() == data


def test_a_picture_needs_matplotlib(result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UsageError, match="matplotlib"):
        result.plot(tmp_path / "a.png")
    assert not (tmp_path / "a.png").exists()
