"""Where the results of a batch go: no two to one place, none over a cloud."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.batch.item import Item
from dlogen.batch.output_names import OWN_FILES, overwritten, with_unique_keys, without_repeats
from dlogen.errors import UsageError


def outputs(stem: str) -> tuple[str, ...]:
    return (f"{stem}.urdf", f"{stem}.json", f"{stem}_ros/model.xacro")


def item(cloud: str, key: str | None = None, **more: object) -> Item:
    return Item(cloud, str(Path(cloud).with_suffix("")) if key is None else key, **more)  # type: ignore[arg-type]


def keys(*items: Item) -> list[str]:
    return [made.key for made in with_unique_keys(items, outputs)]


class TestRepeats:
    @pytest.fixture(autouse=True)
    def _here(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)

    def test_the_first_of_the_same_is_kept(self) -> None:
        first, again, other = item("a.ply"), item("./a.ply", "a"), item("b/../c.ply", "a")
        assert without_repeats([first, again, other]) == [first, other]
        nothing = [item("a.ply"), item("b.ply")]
        assert without_repeats(nothing) is nothing

    def test_through_a_link_it_is_the_same_file(self) -> None:
        Path("a.ply").touch()
        Path("b.ply").symlink_to("a.ply")
        assert without_repeats([item("a.ply"), item("b.ply", "a")]) == [item("a.ply")]

    @pytest.mark.parametrize("settings", [{"overrides": ("r=1",)}, {"time": 2.0}, {"config": "other.yaml"}])
    def test_settings_are_not_lost_in_silence(self, settings: dict[str, object]) -> None:
        with pytest.raises(UsageError, match="twice, with different settings"):
            without_repeats([item("a.ply"), item("a.ply", **settings)])
        assert len(without_repeats([item("a.ply", **settings), item("a.ply", **settings)])) == 1
        # The plain one adds nothing; nor does the configuration beside the cloud.
        assert len(without_repeats([item("a.ply", **settings), item("a.ply", config="a.yaml")])) == 1


class TestUnique:
    def test_the_ending_stays_where_files_would_collide(self) -> None:
        assert keys(item("a.ply"), item("b.ply")) == ["a", "b"]
        assert keys(item("a.ply"), item("a.pcd"), item("b.ply")) == ["a.ply", "a.pcd", "b"]
        assert keys(item("x/a.ply"), item("y/a.pcd")) == ["x/a", "y/a"]

    def test_a_longer_key_may_collide_in_its_turn(self) -> None:
        # a.ply becomes the key of two, of which one can still be longer.
        assert keys(item("a.ply"), item("a.pcd"), item("a.ply.ply")) == ["a.ply", "a.pcd", "a.ply.ply"]

    def test_a_file_and_a_folder_of_one_name(self) -> None:
        assert keys(item("x.ply"), item("x.json/y.ply")) == ["x.ply", "x.json/y"]
        assert keys(item("x.ply"), item("x_ros/y.ply")) == ["x.ply", "x_ros/y"]

    def test_what_collides_nevertheless_is_refused(self) -> None:
        with pytest.raises(UsageError, match=r"a\.ply and .*b/a\.ply would both write a"):
            keys(item("a.ply", "a"), item("b/a.ply", "a"))

    @pytest.mark.parametrize("name", sorted(OWN_FILES))
    def test_the_batchs_own_files(self, name: str) -> None:
        with pytest.raises(UsageError, match="own files"):
            keys(item(f"{name}/x.ply"))

    @pytest.mark.parametrize("stem", ["summary", "Summary", "SUMMARY"])
    def test_the_batchs_own_files_where_letters_have_no_case(self, stem: str) -> None:
        # The ending stays where there is one: Summary.ply.json is another file everywhere.
        assert keys(item(f"{stem}.ply"), item(f"d/{stem}.ply")) == [f"{stem}.ply", f"d/{stem}"]
        with pytest.raises(UsageError, match="own files"):
            keys(Item(stem, stem))

    @settings(max_examples=60, deadline=None)
    @given(
        st.lists(
            st.tuples(st.sampled_from(["", "d/", "a.json/"]), st.sampled_from("ab"), st.sampled_from([".ply", ".pcd"])),
            unique=True,
            max_size=10,
        )
    )
    def test_every_file_has_one_owner(self, parts: list[tuple[str, str, str]]) -> None:
        made = with_unique_keys([item(folder + stem + ending) for folder, stem, ending in parts], outputs)
        assert [one.cloud for one in made] == [folder + stem + ending for folder, stem, ending in parts]
        files = [
            f"{folder}{slash}{name}"
            for one in made
            for folder, slash, stem in [one.key.rpartition("/")]
            for name in outputs(stem)
        ]
        assert len(set(files)) == len(files)
        folders = {parent for file in files for parent in map(str, Path(file).parents)}
        assert not folders & set(files)


def test_clouds_that_results_would_overwrite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("out/d").mkdir(parents=True)
    items = [item("out/a.ply", "a"), item("out/b.ply", "b"), item("c.ply", "c"), item("out/d/e.ply", "d/e")]

    def meshes(stem: str) -> tuple[str, ...]:
        return (f"{stem}.ply",)

    assert overwritten(items, "out", meshes) == {0, 1, 3}
    assert overwritten(items, "out", outputs) == set()
    assert overwritten(items, "elsewhere", meshes) == set()
    # The results of one over the cloud of another.
    assert overwritten([item("out/a.ply", "x"), item("y.ply", "a")], "out", meshes) == {0}
