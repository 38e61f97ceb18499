"""Paths as texts, in real folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlogen.batch import paths
from dlogen.batch.paths import below, identity, key_as_named, nearest, opened, shown


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


@pytest.mark.parametrize(
    ("path", "text"), [("a b/ü.ply", "a b/ü.ply"), ("a\nb", r"'a\nb'"), ("\x1b[31m", r"'\x1b[31m'"), ("", "")]
)
def test_what_would_garble_a_message_is_escaped(path: str, text: str) -> None:
    assert shown(path) == text


def test_the_nearest_name_is_of_the_first_part_that_is_missing(here: Path) -> None:
    (here / "captures" / "monday").mkdir(parents=True)
    (here / "captures" / "monday" / "cable_01.ply").touch()
    assert nearest("captures/monday/cable_1.ply") == "did you mean captures/monday/cable_01.ply?"
    assert nearest("captures/mondey/cable_01.ply") == "did you mean captures/monday?"
    assert nearest("capture/monday/x.ply") == "did you mean captures?"
    assert nearest("captures/monday/xyz") == ""


def test_among_very_many_names_none_is_looked_for(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(5):
        (here / f"cloud_{k}.ply").touch()
    monkeypatch.setattr(paths, "_MOST_NAMES", 5)
    assert nearest("cloud_9.ply") != ""
    monkeypatch.setattr(paths, "_MOST_NAMES", 4)
    assert nearest("cloud_9.ply") == ""


def test_a_file_called_minus_is_not_stdin() -> None:
    assert opened("-") == "./-"
    assert opened("a/-") == "a/-"
    assert opened("-x") == "-x"


def test_one_folder_by_two_names(here: Path) -> None:
    (here / "a").mkdir()
    (here / "link").symlink_to(here / "a")
    assert identity("a") == identity("link") == identity(str(here / "a")) != identity(".")
    assert identity("none") is None


@pytest.mark.parametrize(
    ("path", "key"),
    [
        ("x.ply", "x.ply"),
        ("a/b/x.ply", "a/b/x.ply"),
        ("./a/../b/x.ply", "b/x.ply"),
        ("../x.ply", "x.ply"),
        ("../../a/x.ply", "x.ply"),
        ("/data/a/x.ply", "x.ply"),
        ("..x/y.ply", "..x/y.ply"),
    ],
)
def test_keys_never_leave_the_output_folder(path: str, key: str) -> None:
    assert key_as_named(path) == key


def test_what_is_below_what(here: Path) -> None:
    (here / "root" / "a" / "b").mkdir(parents=True)
    (here / "link").symlink_to(here / "root" / "a")
    assert below("root/a/b", "root") == "a/b"
    assert below("root", "root") == ""
    assert below(str(here / "root" / "a"), "root/../root") == "a"
    # Through the link it lies below only by its real place.
    assert below("link/b", "root") == "a/b"
    assert below("root", "root/a") is None
    assert below("rooted", "root") is None
