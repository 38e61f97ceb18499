"""Lists of clouds, as files and on stdin."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.batch.discover import find_items
from dlogen.batch.item import Item
from dlogen.batch.lists import read_table
from dlogen.config.reader import load_config
from dlogen.errors import DlogenError, InputError, UsageError


@pytest.fixture(autouse=True)
def captures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """c/x.ply, c/y.ply and c/d/z.ply in the current folder."""
    monkeypatch.chdir(tmp_path)
    Path("c/d").mkdir(parents=True)
    for name in ("c/x.ply", "c/y.ply", "c/d/z.ply"):
        Path(name).touch()


def piped(data: bytes, **more: Any) -> list[Item]:
    return find_items(["-"], stdin=io.BytesIO(data), **more)


def table(text: str | bytes, name: str = "list.csv", **more: Any) -> list[Item]:
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return find_items([f"@{name}"], **more)


def refusal(call: Callable[..., object], *args: Any, **more: Any) -> UsageError:
    with pytest.raises(UsageError) as caught:
        call(*args, **more)
    assert caught.value.hint
    return caught.value


# ---------------------------------------------------------------- text


@pytest.mark.parametrize(
    "data",
    [
        b"c/x.ply\nc/y.ply\n",
        b"c/x.ply\nc/y.ply",
        b"c/x.ply\r\n\r\nc/y.ply\r\n",
        b"\n  \nc/x.ply\n\n\nc/y.ply\n \n",
        b"\xef\xbb\xbfc/x.ply\nc/y.ply\n",
        b"c/x.ply\0c/y.ply\0",
        b"c/x.ply\0\0c/y.ply",
    ],
)
def test_text(data: bytes) -> None:
    expected = [Item("c/x.ply", "c/x"), Item("c/y.ply", "c/y")]
    assert piped(data) == expected
    assert table(data, "list.txt") == table(data, "list") == expected


@pytest.mark.parametrize(
    "name",
    ["#x.ply", " x.ply ", "-", "@y", "*.ply", '"x".ply', "x,y.ply", "x\r.ply", "-n", "a.csv", os.fsdecode(b"\xff")],
)
def test_names_are_taken_as_they_are(name: str) -> None:
    Path(name).touch()
    (item,) = piped(os.fsencode(name) + b"\n")
    assert item.cloud in (name, f"./{name}") and Path(item.cloud).samefile(Path(name).absolute())
    assert item.cloud != "-"


def test_newlines_in_names() -> None:
    Path("a\n\r\nb.ply").touch()
    assert piped(b"a\n\r\nb.ply\0c/x.ply\0") == [Item("a\n\r\nb.ply", "a\n\r\nb"), Item("c/x.ply", "c/x")]


def test_folders_in_lists_are_searched_but_lists_and_globs_are_not() -> None:
    assert [item.key for item in piped(b"c/d\nc/x.ply\n")] == ["z", "c/x"]
    Path("more.txt").write_text("c/y.ply\n")
    assert piped(b"c/x.ply\n@more.txt\nc/*.ply\n")[1:] == [Item("@more.txt", "@more"), Item("c/*.ply", "c/*")]
    # Those of `find` that hold no clouds are passed over.
    Path("empty").mkdir()
    assert len(piped(b"empty\nc\n")) == 3


def test_paths_are_from_the_current_folder_or_from_that_of_the_list() -> None:
    Path("c/list.txt").write_text("x.ply\nd\nc/y.ply\n")
    assert find_items(["@c/list.txt"]) == [Item("c/x.ply", "x"), Item("c/d/z.ply", "z"), Item("c/y.ply", "c/y")]
    Path("x.ply").touch()
    assert find_items(["@c/list.txt"])[0] == Item("x.ply", "x")
    # Not so on stdin.
    assert piped(b"y.ply\nc/y.ply\n")[0].cloud == "y.ply"


def test_a_cloud_that_is_gone_is_left_to_fail() -> None:
    assert piped(b"gone/a.ply\nc/x.ply\n../b.ply\n/no/c.ply\n") == [
        Item("gone/a.ply", "gone/a"),
        Item("c/x.ply", "c/x"),
        Item("../b.ply", "b"),
        Item("/no/c.ply", "c"),
    ]
    assert [item.key for item in piped(b"c/gone.ply\nc/x.ply\n", root="c")] == ["gone", "x"]


def test_a_list_of_nothing_is_refused() -> None:
    error = refusal(piped, b"x.ply\ny.ply\n")
    assert error.path == "stdin" and "x.ply" in error.message
    for data in (b"", b"\n\n", b"\0"):
        assert "empty" in refusal(piped, data).message
    # A cloud that is given as a list.
    Path("x.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nend_header\n")
    assert "list" in str(refusal(find_items, ["@x.ply"]).hint)
    refusal(piped, b"c/x.ply\nmissing/..\n")


def test_utf16_is_refused() -> None:
    for encoding in ("utf-16", "utf-16-be"):
        data = "\ufeffc/x.ply\n".encode(encoding)
        assert "UTF-8" in str(refusal(table, data, "list.txt").hint)
        assert "UTF-8" in str(refusal(table, data).hint)


def test_a_list_that_cannot_be_read_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        find_items(["@c"])
    assert caught.value.path == "c" and caught.value.hint


def test_nothing_is_piped_in() -> None:
    class Terminal(io.BytesIO):
        def isatty(self) -> bool:
            return True

    with pytest.raises(InputError) as caught:
        find_items(["-"], stdin=Terminal())
    assert "find" in str(caught.value.hint)


# ---------------------------------------------------------------- CSV


def test_columns() -> None:
    Path("own.yaml").touch()
    Path("c/x.yaml").touch()
    Path("c/y.yml").touch()
    text = "cloud,config,time,r,material.preset,β,#note\n"
    text += 'c/x.ply,own.yaml,0.5,0.02,"steel-wire",auto,"a ""b"", c"\n'
    text += "c/y.ply,,,,,,\n\n,,,,,,\n"
    text += "c/d/z.ply,, -1e-3 , 0.01 ,,1e-2,\n"
    for data in (text.encode(), text.encode("utf-8-sig"), text.replace("\n", "\r\n").encode()):
        found = table(data)
        assert found == [
            Item("c/x.ply", "c/x", "own.yaml", ("r=0.02", "material.preset=steel-wire", "beta=auto"), 0.5),
            Item("c/y.ply", "c/y", "c/y.yml"),
            Item("c/d/z.ply", "c/d/z", None, ("r=0.01", "beta=1e-2"), -1e-3),
        ]
    assert table(data, own_configs=False)[1].config is None
    assert load_config(None, found[2].overrides).beta == 0.01


@pytest.mark.parametrize("column", ["cloud", "path", "file", " cloud "])
def test_the_column_of_the_cloud_has_several_names(column: str) -> None:
    assert table(f"r,{column}\n0.02,c/x.ply\n", "LIST.CSV") == [Item("c/x.ply", "c/x", None, ("r=0.02",))]


def test_settings_of_a_folder_are_those_of_all_in_it() -> None:
    assert table("cloud,r\nc/d,0.02\n.,\n")[:2] == [Item("c/d/z.ply", "z", None, ("r=0.02",)), Item("./c/x.ply", "c/x")]


def test_a_csv_on_stdin_is_text() -> None:
    Path("cloud").touch()
    assert [item.cloud for item in piped(b"cloud\nc/x.ply\n")] == ["cloud", "c/x.ply"]


def test_a_configuration_is_looked_for_where_the_cloud_is() -> None:
    Path("d.yaml").touch()
    Path("c/d.yaml").touch()
    Path("-").touch()
    Path("c/only.yaml").touch()
    assert table("cloud,config\nx.ply,d.yaml\nc/y.ply,d.yaml\n", "c/list.csv")[0].config == "c/d.yaml"
    assert table("cloud,config\nx.ply,d.yaml\nc/y.ply,d.yaml\n", "c/list.csv")[1].config == "d.yaml"
    assert table("cloud,config\nc/y.ply,only.yaml\nx.ply,-\n", "c/list.csv")[0].config == "c/only.yaml"
    # Which would be read from stdin.
    assert table("cloud,config\nc/y.ply,-\n")[0].config == "./-"


@pytest.mark.parametrize(
    ("text", "line", "message", "hint"),
    [
        ("cloud,radius\nc/x.ply,1\n", 1, "unknown", "'r'"),
        ("cloud,nonsense\nc/x.ply,1\n", 1, "nonsense", "#"),
        ("cloud,\nc/x.ply,1\n", 1, "unknown", "#"),
        ("\n\ncloud,radius\nc/x.ply,1\n", 3, "unknown", "'r'"),
        ("c/x.ply\nc/y.ply\n", 1, "cloud", "commas"),
        ("cloud;r\nc/x.ply;1\n", 1, "cloud", "commas"),
        ("cloud,file\nc/x.ply,c/y.ply\n", 1, "file", "#"),
        ("cloud,beta,β\nc/x.ply,1,2\n", 1, "twice", "one"),
        ("cloud,r\nc/x.ply,0.02\nc/y.ply\n", 3, "1 cells", "quotes"),
        ("cloud,r\nc/x.ply,0.02\nc/y,2.ply,0.02\n", 3, "3 cells", "quotes"),
        ("cloud,r\n ,0.02\n", 2, "no cloud", "row"),
        ("cloud,r\nc/x.ply,0.01\nc/y.ply,-1\n", 3, "r = -1", "Radius"),
        ("cloud,r\nc/x.ply,twenty\n", 2, "twenty", ""),
        ('cloud,#\n"c/x.ply","a\nb"\nc/y.ply\n', 4, "1 cells", "quotes"),
        ("cloud,config\nc/x.ply,gone.yaml\n", 2, "gone.yaml", "path"),
        ("cloud,time\nc/x.ply,soon\n", 2, "soon", "0.04"),
        ("cloud,time\nc/x.ply,nan\n", 2, "nan", "0.04"),
        ("cloud,time\nc/x.ply,1e999\n", 2, "1e999", "0.04"),
        ('cloud,r\n"c/x.ply"x,1\n', 2, "CSV", "quotes"),
        ('cloud,r\nc/x.ply,"1\n', 2, "CSV", "quotes"),
        (b"cloud,r\nc/\xff.ply,1\n", 2, "UTF-8", "UTF-8"),
        (b"cloud,r\nc/x.ply\0,1\n", 2, "NUL", "CSV"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text: str | bytes, line: int, message: str, hint: str) -> None:
    error = refusal(table, text)
    assert error.path == "list.csv"
    assert error.message.startswith(f"line {line}: ") and message in error.message
    assert hint in str(error.hint)


def test_a_csv_without_rows_is_refused() -> None:
    for text in ("", "\n", "cloud,r\n", ",,\n"):
        assert "empty" in refusal(table, text).message


def test_the_same_cloud_twice() -> None:
    first = Item("c/x.ply", "c/x", None, ("r=0.02",))
    assert table("cloud,r\nc/x.ply,0.02\n./c/x.ply,0.02\nc/x.ply,\n") == [first]
    # Settings are not lost in silence.
    for text in ("cloud,r\nc/x.ply,0.02\nc/x.ply,0.03\n", "cloud,time\nc/x.ply,\nc/x.ply,1\n"):
        assert "settings" in refusal(table, text).message
    Path("list.csv").write_text("cloud,r\nc/x.ply,0.02\n")
    assert find_items(["@list.csv", "c/x.ply"]) == [first]
    refusal(find_items, ["c/x.ply", "@list.csv"])
    Path("own.yaml").touch()
    Path("c/x.yaml").touch()
    Path("list.csv").write_text("cloud,config\nc/x.ply,own.yaml\n")
    assert find_items(["@list.csv", "c/x.ply"])[0].config == "own.yaml"
    refusal(find_items, ["c/x.ply", "@list.csv"])


_CELLS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=12)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.lists(_CELLS, min_size=2, max_size=2), min_size=1, max_size=5))
def test_what_csv_writers_write_is_read(rows: list[list[str]]) -> None:
    text = io.StringIO(newline="")
    csv.writer(text).writerows([["cloud", "#note"], *rows])
    expected = [row[0] for row in rows if any(cell.strip() for cell in row)]
    try:
        found = [row.named for row in read_table(text.getvalue().encode(), [""], "list.csv")]
    except UsageError as error:
        assert "no cloud" in error.message and not all(name.strip() for name in expected)
    else:
        assert found == expected


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=60))
def test_nothing_but_a_message_comes_of_garbage(data: bytes) -> None:
    for garbage in (data, b"cloud,r\n" + data):
        try:
            list(read_table(garbage, [""], "list.csv"))
        except DlogenError as error:
            assert error.hint
