"""What the inputs of a batch stand for, and where the results of each cloud go."""

from __future__ import annotations

import io
import os
import pickle
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from found_items import clouds, keys, refusal

from dlogen.batch.discover import find_items
from dlogen.batch.item import Item
from dlogen.errors import InputError
from dlogen.io.cloud_files import read_cloud

Make = Callable[..., None]


# ---------------------------------------------------------------- folders


def test_several_folders_keep_their_names(make: Make, tmp_path: Path) -> None:
    make("captures/day1/x.ply", "captures/day2/x.ply", "captures/day2/a/y.ply", "z.ply")
    assert keys("captures/day1", "captures/day2/") == ["captures/day1/x", "captures/day2/x", "captures/day2/a/y"]
    assert keys(f"{tmp_path}/captures/day1", "captures/day2", "z.ply") == [
        *("day1/x", "captures/day2/x", "captures/day2/a/y", "z")
    ]
    # What is in one of them is in the other as well.
    assert keys("captures", "captures/day1") == ["captures/day1/x", "captures/day2/x", "captures/day2/a/y"]
    assert keys(".", "captures/day1") == ["z", "captures/day1/x", "captures/day2/x", "captures/day2/a/y"]
    assert keys("captures/day1", "captures/day2", root="captures") == ["day1/x", "day2/x", "day2/a/y"]


def test_a_folder_is_searched_to_the_bottom_in_a_fixed_order(make: Make) -> None:
    names = ["b.ply", "a.pcd", "z/c.PLY", "m/n/d.Pcd", "m/e.ply", "m.x/f.ply", "notes.txt", "g.ply.gz", "ply"]
    make(*(f"captures/{name}" for name in names))
    assert find_items(["captures"]) == [
        Item("captures/a.pcd", "a"),
        Item("captures/b.ply", "b"),
        Item("captures/m/e.ply", "m/e"),
        Item("captures/m/n/d.Pcd", "m/n/d"),
        Item("captures/m.x/f.ply", "m.x/f"),
        Item("captures/z/c.PLY", "z/c"),
    ]
    assert keys("captures/") == keys("./captures") == keys(str(Path("captures").resolve())) == keys("captures")


def test_hidden_files_and_folders_are_left_out(make: Make) -> None:
    make("c/.a.ply", "c/.git/b.ply", "c/d.ply", ".e/f.ply")
    assert keys("c") == ["d"]
    # Unless they are named.
    assert keys(".e") == ["f"]
    assert keys("c/.a.ply") == ["c/.a"]


def test_links_to_folders_are_followed_once(make: Make) -> None:
    make("c/a/x.ply", "c/b/y.ply", "elsewhere/z.ply")
    Path("c/a/up").symlink_to("../..")  # everything is below it again
    Path("c/b/here").symlink_to(".")
    Path("c/a_link_to_b").symlink_to("b")
    Path("c/other").symlink_to("../elsewhere")
    Path("c/circle").symlink_to("circle")
    # Through c/a/up as well, but a folder has its own name if it has one below the one that was named.
    assert keys("c") == ["a/x", "a/up/elsewhere/z", "b/y"]
    Path("c/a/up").unlink()
    assert keys("c") == ["a/x", "b/y", "other/z"]


def test_the_output_folder_and_other_results_are_not_searched(make: Make) -> None:
    make("c/x.ply", "c/out/y.tube.ply", "c/old/dlogen.sqlite", "c/old/run/z.ply", "c/new/w.ply")
    assert keys("c", out=Path("c/out")) == ["x", "new/w"]
    assert keys("c", out=Path("nothing yet")) == ["x", "new/w", "out/y.tube"]
    Path("c/latest").symlink_to(Path("c/out").resolve())
    assert keys("c", out=Path("c/latest")) == ["x", "new/w"]
    assert keys("c/**/*.ply", "c/*/*.ply", "c/*", out=Path("c/out")) == ["x", "new/w"]
    # One that is named is searched.
    assert keys("c/old") == ["run/z"]


def test_clouds_among_results_are_not_left_out_in_silence(make: Make) -> None:
    def warned(*inputs: str, out: str = "new") -> list[str]:
        said: list[str] = []
        find_items(inputs, out=Path(out), warn=said.append)
        return [text.split(" are left out")[0] for text in said]

    # Results beside their clouds, results only, and a folder for results that has clouds in it.
    make("c/day1/dlogen.sqlite", "c/day1/a/x.ply", "c/day1/a/x.json", "c/old/dlogen.sqlite", "c/old/x.tube.ply")
    make("c/day2/y.ply", "c/out/z.pcd")
    said = "the clouds in c/day1"
    assert warned("c") == warned("c/*/*.ply") == warned("c/**/*.ply") == warned("c", "c") == [said]
    assert warned("c", out="c/out") == [said, "the clouds in c/out"]
    assert warned("c", "c/day1") == warned("c/day1", "c") == warned("c/day1") == warned("c/day2") == []
    Path("c/day2/y.ply").unlink()
    Path("c/out/z.pcd").unlink()
    for text in ("c", "c/*", "c/**/*.ply"):
        assert "the clouds in c/day1 are left out" in str(refusal(text).hint)


def test_results_among_what_a_shell_expands_are_no_mistake(make: Make) -> None:
    make("c/x.ply", "c/out/x.urdf", "c/old/dlogen.sqlite")
    assert clouds("c/old", "c/out", "c/x.ply", out=Path("c/out")) == ["c/x.ply"]
    refusal("c/old", "c/out", out=Path("c/out"))


def test_a_broken_link_and_what_is_no_file_are_clouds_that_fail(make: Make) -> None:
    make("c/x.ply")
    Path("c/link.ply").symlink_to("nowhere")
    Path("c/circle.ply").symlink_to("circle.ply")
    os.mkfifo("c/pipe.ply")  # opening it would wait for ever
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind("c/socket.ply")
    expected = ["circle", "link", "pipe", "socket", "x"]
    assert keys("c") == expected
    assert keys("c/*") == keys("c/**/*.ply") == expected
    assert keys("c/pipe.ply", "c/link.ply") == ["c/pipe", "c/link"]
    with pytest.raises(InputError):
        read_cloud("c/link.ply")


def test_a_folder_without_clouds_is_refused(make: Make) -> None:
    make("c/x.txt")
    error = refusal("c")
    assert "c" in error.message and ".ply" in str(error.hint)


@pytest.fixture
def locked(make: Make, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Folders called locked cannot be listed, as without permission; here also for the superuser."""
    make("c/x.ply", "c/a/locked/y.ply", "c/locked.d/z.ply", "c/b.ply")
    scandir = os.scandir

    def refusing(path: str = ".") -> Any:
        if Path(path).name.startswith("locked"):
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    with monkeypatch.context() as patch:
        patch.setattr(os, "scandir", refusing)
        yield


@pytest.mark.usefixtures("locked")
def test_a_folder_that_cannot_be_listed_is_not_lost() -> None:
    for text in ("c", "c/*", "c/**", "c/**/*.ply"):
        found = {item.cloud: item.key for item in find_items([text])}
        assert found == {"c/x.ply": "x", "c/b.ply": "b", "c/a/locked": "a/locked", "c/locked.d": "locked"}
    with pytest.raises(InputError, match="folder"):
        read_cloud("c/a/locked")


@pytest.mark.usefixtures("locked")
def test_a_folder_that_is_named_and_cannot_be_listed_is_refused() -> None:
    for inputs in (["c/locked.d"], ["c/x.ply", "c/a/locked/"], ["c/a/locked/*.ply"], ["c/a/locked/**/*.ply"], ["-"]):
        error = refusal(*inputs, kind=InputError, stdin=io.BytesIO(b"c/locked.d\n"))
        assert "Permission denied" in error.message and "locked" in str(error.path)


@pytest.mark.usefixtures("locked")
def test_a_folder_that_cannot_be_listed_keeps_its_place_with_a_root() -> None:
    assert keys("c/a", root=".") == ["c/a/locked"]


# ---------------------------------------------------------------- names and globs


@pytest.mark.parametrize("name", ["@x", "a*.ply", "-x.ply", "-", "~", "~x.ply", "[ab].ply", "?", "**", " ", "#x.ply"])
def test_what_exists_is_itself(make: Make, name: str) -> None:
    make(name, "ab.ply", "a.ply")
    (item,) = find_items([name])
    assert Path(item.cloud).samefile(Path(name).absolute())
    assert item.key == Path(name).stem
    assert item.cloud != "-"  # which readers take for stdin


def test_a_folder_that_exists_is_itself(make: Make) -> None:
    make("run[1]/x.ply", "run1/y.ply", "@z/z.ply")
    assert clouds("run[1]", "@z") == ["run[1]/x.ply", "@z/z.ply"]


def test_any_ending_is_taken_of_files_that_are_named(make: Make) -> None:
    make("scan.xyz", "a/scan", "b/scan.tar.gz")
    assert keys("scan.xyz", "a/scan", "b/scan.tar.gz") == ["scan", "a/scan", "b/scan.tar"]


def test_globs(make: Make) -> None:
    make("c/a1.ply", "c/a2.pcd", "c/a3.txt", "c/b1.ply", "c/.a4.ply", "c/d/a5.ply", "c/d/e/a6.ply", "c/d/.f/a7.ply")
    assert keys("c/*.ply") == ["a1", "b1"]
    assert keys("c/a*") == ["a1", "a2"]
    assert keys("c/a?.ply") == ["a1"]
    assert keys("c/[!b]*") == ["a1", "a2", "d/a5", "d/e/a6"]
    assert keys("c/.a*") == [".a4"]
    assert keys("c/*") == keys("c/**") == keys("c/**/**") == ["a1", "a2", "b1", "d/a5", "d/e/a6"]
    assert keys("c/**/*.ply") == ["a1", "b1", "d/a5", "d/e/a6"]
    assert keys("c/**/e/*") == ["d/e/a6"]
    assert keys("c/**/a5.ply") == ["d/a5"]
    assert keys("c/*/a5.ply") == ["d/a5"]
    assert keys("*/d") == ["c/d/a5", "c/d/e/a6"]
    assert clouds("**/a5.ply") == ["c/d/a5.ply"]
    assert keys("c/../c/./d/*.ply") == ["a5"]
    assert keys(str(Path("c/d/*/*.ply").absolute())) == ["e/a6"]


def test_globs_in_loops_of_links_end(make: Make) -> None:
    make("c/a/x.ply")
    Path("c/a/up").symlink_to("..")
    assert keys("c/**/*.ply") == ["a/x"]
    assert keys("c/**/up/**/x.ply") == ["a/up/a/x"]


def test_home(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    make("home/c/x.ply", "home/list.txt")
    Path("home/list.txt").write_text("c/x.ply\n")
    monkeypatch.setenv("HOME", str(Path("home").absolute()))
    home = Path("home").absolute()
    assert find_items(["~/c/*.ply"]) == find_items(["~/c"]) == [Item(str(home / "c/x.ply"), "x")]
    assert find_items(["~/c/x.ply"]) == [Item(str(home / "c/x.ply"), "x")]
    assert find_items(["@~/list.txt"]) == [Item(str(home / "c/x.ply"), "c/x")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("captures/x.pyl", "captures/x.ply"),
        ("captrues/x.ply", "captures"),
        ("captures/run/x.ply", "check"),
        ("captures/*.pcd", "check"),
        ("captures/*.txt", "list"),
        ("captrues/*.ply", "captures"),
        ("nothing/at/all", "check"),
        ("@lists.txt", "list.txt"),
        ("@", "check"),
        ("~nobody/x", "check"),
        ("", "name"),
    ],
)
def test_what_does_not_exist_is_refused(make: Make, text: str, words: str) -> None:
    make("captures/x.ply", "captures/x.txt", "list.txt")
    assert words in str(refusal(text).hint)
    refusal("captures", text)


def test_no_inputs() -> None:
    refusal()


def test_many_names_are_not_compared(make: Make) -> None:
    for i in range(5001):
        Path(f"scan_{i}.ply").touch() if i == 0 else os.link("scan_0.ply", f"scan_{i}.ply")
    assert refusal("scan_9999.ply").hint == "check the path"


def test_messages_are_readable(make: Make) -> None:
    name = os.fsdecode(b"a\n\xff.ply")
    error = refusal(name)
    assert error.message.isprintable() and r"\n\udcff" in error.message


# ---------------------------------------------------------------- keys


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("x.ply", "x"),
        ("./a/../b/x.ply", "b/x"),
        ("b//x.ply", "b/x"),
        ("b/../../work/x.ply", "x"),
        ("../other/x.ply", "x"),
        ("..x.ply", "..x"),
        ("..b/x.ply", "..b/x"),
        ("...ply", "...ply"),
        (".ply", ".ply"),
        ("b/..ply", "b/..ply"),
        ("a b/ü x.ply", "a b/ü x"),
        ("a\nb.ply", "a\nb"),
        ("a\\b.ply", "a\\b"),
        ("--root.ply", "--root"),
    ],
)
def test_keys_of_named_clouds(make: Make, monkeypatch: pytest.MonkeyPatch, name: str, key: str) -> None:
    make("work/a/q", "work/b/q", "other/q")
    monkeypatch.chdir("work")
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).touch()
    assert keys(name) == [key]
    assert keys(str(Path(name).absolute())) == [key.rpartition("/")[2]]


def test_a_root_lays_out_everything_alike(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    make("d/a/x.ply", "d/b/x.ply", "d/b/c/y.ply", "d/list.txt", "d/z.ply", "e/w.ply")
    Path("d/list.txt").write_text("a/x.ply\n")
    for root in ("d", "./d/", str(Path("d").absolute()), "e/../d"):
        inputs = ["d/a", str(Path("d/b").absolute()), "d/*/c/*.ply", "@d/list.txt", "d/a/../z.ply"]
        assert keys(*inputs, root=root) == ["a/x", "b/x", "b/c/y", "z"]
    assert keys("d/a", "d/b", root=".") == ["d/a/x", "d/b/x", "d/b/c/y"]
    assert keys("d", root="/")[0].endswith("/d/z")
    monkeypatch.chdir("d/a")
    assert keys(".", "..", "x.ply", root="..") == ["a/x", "z", "b/x", "b/c/y"]


def test_a_root_is_recognised_through_links(make: Make) -> None:
    make("data/a/x.ply")
    Path("link").symlink_to("data")
    assert keys("link/a", root="data") == keys("data/a", root="link") == ["a/x"]


def test_what_is_not_below_the_root_is_refused(make: Make) -> None:
    make("d/x.ply", "d/list.txt", "dd/y.ply")
    for text in ("dd/y.ply", "dd", "dd/*.ply"):
        error = refusal("d", text, root="d")
        assert "dd/y.ply" in error.message and "--root d" in error.message
    assert "dd?" in str(refusal("d", root="ddd").hint)
    refusal("d", root="d/x.ply")


# ---------------------------------------------------------------- configurations beside clouds


def test_the_configuration_beside_a_cloud(make: Make) -> None:
    make("c/x.ply", "c/x.yaml", "c/y.pcd", "c/y.yml", "c/z.ply", "c/z.yaml", "c/z.yml", "c/w.ply", "c/w.ply.yaml")
    make("c/v.ply", "c/v.yaml/q", "c/d/x.ply")
    expected = ["c/x.yaml", "c/y.yml", "c/z.yaml"]
    for text in ("c", "c/**", "c/**/*", "-"):
        found = find_items([text], stdin=io.BytesIO("\n".join(clouds("c")).encode()))
        assert [item.config for item in found if item.config] == expected
        assert len(found) == 6
        assert not any(item.config for item in find_items([text], own_configs=False, stdin=io.BytesIO(b"c/x.ply")))
    assert find_items(["c/x.ply"])[0].config == "c/x.yaml"


# ---------------------------------------------------------------- all names


def test_names_that_are_not_unicode(make: Make) -> None:
    name = os.fsdecode(b"\xff\xfe \xc3\xa4.ply")
    make(f"c/{name}")
    assert find_items(["c"]) == find_items(["c/*.ply"]) == [Item(f"c/{name}", name.removesuffix(".ply"))]
    listed = find_items(["-"], stdin=io.BytesIO(os.fsencode(f"c/{name}\n")))
    assert os.path.lexists(listed[0].cloud)


# ---------------------------------------------------------------- the type, the imports


def test_items_can_be_sent_to_workers() -> None:
    item = Item("a.ply", "a", "a.yaml", ("r=0.02",), 0.5)
    assert pickle.loads(pickle.dumps(item)) == item
    assert not hasattr(item, "__dict__")


def test_nothing_heavy_is_imported(make: Make) -> None:
    make("c/x.ply", "c/x.yaml")
    Path("list.csv").write_text("cloud,r\nc/x.ply,0.02\n")
    code = (
        "import sys; from dlogen.batch.discover import find_items\n"
        "assert len(find_items(['c', 'c/*', '@list.csv'])) == 2\n"
        "heavy = {'numpy', 'scipy', 'yaml', 'rich', 'trimesh', 'plyfile', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_many_files_in_little_time_and_memory(make: Make) -> None:
    import time
    import tracemalloc

    make("c/q.ply")
    count = 3000
    for i in range(count - 1):
        os.link("c/q.ply", f"c/scan_{i}.ply")
    start = time.perf_counter()
    assert len(find_items(["c"])) == count
    assert time.perf_counter() - start < 1e-3 * count  # 0.01 ms each, where nothing else runs
    tracemalloc.start()
    find_items(["c"])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1500 * count
