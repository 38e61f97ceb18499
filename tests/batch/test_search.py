"""Clouds in real folders: walks and globs against a list made by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlogen.batch import store
from dlogen.batch.search import Match, Search, is_glob, split_glob

ENDINGS, RESULTS = (".ply", ".pcd"), (".tube.ply",)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in (
        "b/two.ply",
        "b/ONE.PLY",
        "b/one.yaml",
        "b/notes.txt",
        "a/deep/three.pcd",
        "a/.hidden/x.ply",
        "a/.x.ply",
        "top.ply",
        "out/copy.ply",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def search(out: str | None = None) -> Search:
    return Search(ENDINGS, RESULTS, out)


def globbed(pattern: str, made: Search | None = None) -> list[str]:
    return [match.path for match in (made or search()).glob(*split_glob(pattern))]


def test_a_walk_finds_every_folder_once_and_sorted(here: Path) -> None:
    (here / "b" / "loop").symlink_to(here)
    (here / "c").symlink_to(here / "a")
    found = search().walk("")
    assert [folder.below for folder in found] == [(), ("a",), ("a", "deep"), ("b",), ("out",)]
    by_name = {"/".join(folder.below): folder for folder in found}
    assert by_name[""].clouds == ["top.ply"]
    assert by_name["b"].clouds == ["ONE.PLY", "two.ply"]
    assert by_name["b"].configs == {"one.yaml"}
    assert by_name["a"].clouds == []
    assert by_name["a/deep"].clouds == ["three.pcd"]
    assert by_name["b"].path == "b" and by_name["a/deep"].path == "a/deep"


def test_a_folder_outside_is_found_under_the_links_name(here: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    outside = tmp_path_factory.mktemp("outside")
    (outside / "far.ply").touch()
    (here / "a" / "elsewhere").symlink_to(outside)
    found = {folder.below: folder.clouds for folder in search().walk("")}
    assert found[("a", "elsewhere")] == ["far.ply"]


def test_results_are_left_out_and_clouds_in_them_are_told(here: Path) -> None:
    made = search("out")
    assert ("out",) not in {folder.below for folder in made.walk("")}
    assert made.left_out == ["out"]
    (here / "b" / store.NAME).touch()
    (here / "b" / "ONE.PLY").unlink()
    (here / "b" / "two.ply").rename(here / "b" / "two.tube.ply")
    made = search()
    assert ("b",) not in {folder.below for folder in made.walk("")}
    # Only a mesh that the batch has written itself.
    assert made.left_out == []
    # A folder that is named itself is searched.
    assert made.walk("b")[0].results


def test_is_results(here: Path) -> None:
    assert search("out").is_results("out") and not search().is_results("out")
    (here / "a" / store.NAME).touch()
    assert search().is_results("a")


def test_clouds_are_told_by_their_endings() -> None:
    assert search().is_cloud("x/Y.PLY") and search().is_cloud("a.pcd")
    assert not search().is_cloud("a.ply.txt")


@pytest.mark.parametrize(("text", "expected"), [("a*", True), ("a?", True), ("[ab]", True), ("a/b.ply", False)])
def test_globs_have_wildcards(text: str, expected: bool) -> None:
    assert is_glob(text) == expected


@pytest.mark.parametrize(
    ("pattern", "folder", "parts"),
    [("*.ply", "", ("*.ply",)), ("a/b/*/x.ply", "a/b", ("*", "x.ply")), ("/data/**", "/data", ("**",))],
)
def test_the_folder_before_the_first_wildcard(pattern: str, folder: str, parts: tuple[str, ...]) -> None:
    assert split_glob(pattern) == (folder, parts)


def test_globs() -> None:
    assert globbed("*") == ["a", "b", "out", "top.ply"]
    assert globbed("*/*.ply") == ["b/two.ply", "out/copy.ply"]
    assert globbed("b/[OT]*") == ["b/ONE.PLY"]
    assert globbed("**/*.p?d") == ["a/deep/three.pcd"]
    # Hidden ones only where they are asked for.
    assert globbed("a/*") == ["a/deep"]
    assert globbed("a/.*") == ["a/.hidden", "a/.x.ply"]
    assert globbed("?/two.ply") == ["b/two.ply"]


def test_what_matches_knows_where_it_is() -> None:
    assert list(search().glob("", ("b", "t*"))) == [Match(("b", "two.ply"), "b/two.ply", False)]
    assert list(search().glob("a", ("d*",), ("x",))) == [Match(("x", "deep"), "a/deep", True)]
    deep = Match(("a", "deep", "three.pcd"), "a/deep/three.pcd", False)
    assert list(search().glob("", ("a", "**", "*.pcd"))) == [deep]
    assert list(search().glob("b", ("**",))) == [Match((), "b", True)]


def test_a_glob_leaves_results_out_but_not_in_silence() -> None:
    made = search("out")
    assert globbed("*", made) == ["a", "b", "top.ply"]
    assert [Path(path) for path in made.left_out] == [Path("out")]


def test_what_cannot_be_listed_is_found_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("os.scandir", fail)
    assert list(search().glob("b", ("*.ply",))) == [Match((), "b", True)]
    (folder,) = search().walk("b")
    assert isinstance(folder.error, PermissionError)
