"""Results of clouds that are found have places of their own, and none lies over a cloud."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from found_items import clouds, keys, refusal
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.batch.discover import find_items
from dlogen.errors import UsageError
from dlogen.io.outputs import Outputs

Make = Callable[..., None]

_STEMS = st.sampled_from(
    ["x", "x.report", "x.json", "x.ply", "summary", "dlogen", "a", "-", "..", "@a", "ü\n", "\udcff"]
)
_NAMES = st.one_of(
    st.builds(str.__add__, _STEMS, st.sampled_from([".ply", ".pcd", ".PLY", ".report.ply", ".tube.ply"])),
    st.binary(min_size=1, max_size=8)
    .map(os.fsdecode)
    .filter(lambda name: not {"/", "\0"} & set(name))
    .map("{}.ply".format),
)
_TREES = st.lists(st.tuples(st.lists(st.sampled_from(["a", "b", "x.json", "a_description"]), max_size=2), _NAMES))


def test_the_same_file_twice_is_one_item(make: Make) -> None:
    make("c/x.ply", "c/y.ply")
    Path("link").symlink_to("c")
    assert clouds("c/x.ply", "c/y.ply", "./c/x.ply", "c//x.ply") == ["c/x.ply", "c/y.ply"]
    assert clouds("c", "c/*.ply", "c/**") == ["c/x.ply", "c/y.ply"]
    assert clouds("link", "link/*.ply", "c/**") == ["link/x.ply", "link/y.ply"]
    # Under another key it is another.
    assert keys("c/x.ply", "c") == ["c/x", "x", "y"]


def test_clouds_whose_files_would_collide_keep_their_endings(make: Make) -> None:
    make("c/x.ply", "c/x.pcd", "c/x.PLY", "c/y.ply", "c/d/x.ply")
    assert dict(zip(clouds("c"), keys("c"), strict=True)) == {
        "c/x.PLY": "x.PLY",
        "c/x.pcd": "x.pcd",
        "c/x.ply": "x.ply",
        "c/y.ply": "y",
        "c/d/x.ply": "d/x",
    }


def test_other_files_than_the_models_can_collide(make: Make) -> None:
    make("c/x.ply", "c/x.report.ply", "c/x.tube.ply")
    # x.report.json is the report of x, and the chain of x.report.
    assert keys("c") == ["x.ply", "x.report.ply", "x.tube"]
    assert keys("c", outputs=lambda stem: (f"{stem}.urdf",)) == ["x", "x.report", "x.tube"]
    package = Outputs.parse("ros2").files
    make("d/Hose 1.ply", "d/hose_1.pcd")  # the package of both is hose_1_description
    assert keys("d", outputs=package) == ["Hose 1.ply", "hose_1.pcd"]
    assert keys("d") == ["Hose 1", "hose_1"]
    make("d/hose_1.ply")
    error = refusal("d", outputs=package)
    assert "hose_1_ply_description" in error.message and "rename" in str(error.hint)


def test_a_longer_key_can_collide_in_its_turn(make: Make) -> None:
    make("c/x.ply", "c/x.pcd", "c/x.ply.pcd", "c/x.ply.pcd.ply")
    assert keys("c") == ["x.pcd", "x.ply", "x.ply.pcd", "x.ply.pcd.ply"]


def test_a_file_does_not_take_the_place_of_a_folder(make: Make) -> None:
    make("c/x.ply", "c/x.json/a/y.ply", "c/z_description/w.ply", "c/z.ply")
    assert keys("c", outputs=Outputs.parse("json,ros2").files) == ["x.ply", "z.ply", "x.json/a/y", "z_description/w"]


def test_a_cloud_without_an_ending_leaves_its_place_to_none(make: Make) -> None:
    make("x", "x.ply")
    assert keys("x", "x.ply") == ["x", "x.ply"]


def test_clouds_that_collide_nevertheless_are_refused(make: Make) -> None:
    make("s/a/x.ply", "s/b/x.ply", "s/c/y.ply")
    here = Path.cwd()
    error = refusal(*(str(here / f"s/{name}.ply") for name in ("a/x", "b/x", "c/y")))
    assert "s/a/x.ply" in error.message and "s/b/x.ply" in error.message
    # The hint can be followed.
    assert f"--root {here / 's'}:" in str(error.hint)
    assert keys("s/a", "s/b", "s/c", root=str(here / "s")) == ["a/x", "b/x", "c/y"]
    make("t/a/x.ply")
    refusal(str(here / "s" / "a"), str(here / "t" / "a"))


def test_the_batch_keeps_its_own_files(make: Make) -> None:
    make("c/summary.ply", "c/Summary.pcd", "c/a/summary.ply", "c/dlogen.ply")
    assert dict(zip(clouds("c"), keys("c"), strict=True)) == {
        "c/Summary.pcd": "Summary.pcd",
        "c/dlogen.ply": "dlogen",
        "c/summary.ply": "summary.ply",
        "c/a/summary.ply": "a/summary",
    }
    make("summary")
    assert "summary" in refusal("summary").message
    make("d/summary.json/x.ply")
    assert "summary.json" in refusal("d").message
    assert keys("d", root=".") == ["d/summary.json/x"]


def test_no_cloud_is_overwritten(make: Make) -> None:
    make("c/x.ply", "c/x.tube.ply", "c/d/y.ply")
    outputs = Outputs.parse("ply-mesh").files
    for inputs in (["c"], ["c/*.ply"]):
        error = refusal(*inputs, out=Path("c"), outputs=outputs)
        assert "c/x.tube.ply" in error.message
    assert "x.tube.ply" in refusal("c/x.ply", "c/x.tube.ply", out=Path(), outputs=outputs).message
    assert keys("c", out=Path("c")) == ["x", "x.tube", "d/y"]
    assert keys("c", out=Path("out"), outputs=outputs) == ["x", "x.tube", "d/y"]


def test_results_of_an_earlier_run_beside_the_clouds_are_no_clouds(make: Make) -> None:
    make("c/x.ply", "c/x.tube.ply", "c/dlogen.sqlite", "c/y.ply", "c/y.pcd", "c/y.ply.tube.ply", "c/y.pcd.tube.ply")
    outputs = Outputs.parse("ply-mesh").files
    assert keys("c", out=Path("c"), outputs=outputs) == ["x", "y.pcd", "y.ply"]


@settings(max_examples=40, deadline=None)
@given(_TREES, st.sampled_from(["urdf,json", "urdf,json,ros2,csv"]))
def test_results_of_any_names_have_places_of_their_own(tree: list[tuple[list[str], str]], formats: str) -> None:
    outputs = Outputs.parse(formats).files
    with tempfile.TemporaryDirectory() as folder:
        top, out = Path(folder, "c"), Path(folder, "out")
        wanted = set()
        for parents, name in tree:
            path = top.joinpath(*parents, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
            if not name.startswith("."):
                wanted.add(str(path))
        if not wanted:
            return
        try:
            items = find_items([str(top)], outputs=outputs)
        except UsageError as error:
            # Packages have names of a few letters only.
            assert "ros2" in formats and "_description" in error.message
            return
        assert {item.cloud for item in items} == wanted
        assert len(items) == len({item.key for item in items}) == len(wanted)
        out.mkdir()
        for name in ("summary.csv", "summary.json", "dlogen.sqlite"):
            (out / name).touch()
        for item in items:
            assert not {"", ".", ".."} & set(item.key.split("/"))
            # The layout is kept: only endings come and go.
            relative = Path(item.cloud).relative_to(top)
            assert item.key in (str(relative), str(relative.with_suffix("")))
            where, _, stem = item.key.rpartition("/")
            for name in outputs(stem):
                file = out / where / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.touch(exist_ok=False)


@settings(max_examples=60, deadline=None)
@given(st.lists(_NAMES, min_size=1, unique=True), st.booleans())
def test_lists_name_any_file(names: list[str], absolute: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        paths = [f"{folder}/{name}" for name in names]
        for path in paths:
            Path(path).touch()
        data = b"\0".join(os.fsencode(path if absolute else name) for path, name in zip(paths, names, strict=True))
        Path(folder, "0").write_bytes(data + b"\0")
        assert clouds(f"@{folder}/0") == paths
