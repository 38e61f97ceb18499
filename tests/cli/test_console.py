from __future__ import annotations

import io
import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dlogen.cli.console import Console, print_json, use_colour
from dlogen.io.json_text import dump_json


def said(capsys, level: int) -> tuple[str, str]:
    console = Console(level)
    console.info("result")
    console.detail("step")
    console.warning("odd")
    console.error("broken", "mend it")
    captured = capsys.readouterr()
    return captured.out, captured.err


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (-1, "error: broken\nhint: mend it\n"),
        (0, "result\nwarning: odd\nerror: broken\nhint: mend it\n"),
        (1, "result\nstep\nwarning: odd\nerror: broken\nhint: mend it\n"),
    ],
)
def test_levels(capsys, level: int, expected: str) -> None:
    assert said(capsys, level) == ("", expected)  # stdout is for data


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_colour_on_terminals_only(monkeypatch) -> None:
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    assert not use_colour()
    monkeypatch.setattr("sys.stderr", Terminal())
    assert use_colour()
    monkeypatch.setenv("TERM", "dumb")
    assert not use_colour()
    monkeypatch.setenv("TERM", "xterm")
    assert use_colour()
    monkeypatch.setenv("NO_COLOR", "1")
    assert not use_colour()
    monkeypatch.setenv("NO_COLOR", "")  # https://no-color.org: when present and not empty
    assert use_colour()


def test_no_spinner_without_a_terminal(capsys) -> None:
    with Console().status("fitting"):
        pass
    assert capsys.readouterr() == ("", "")


def test_json_is_text_that_reads_back(capsys) -> None:
    data = {"b": [1, 2.5, 0.1 + 0.2], "a": "größe", "none": None}
    print_json(data)
    out = capsys.readouterr().out
    assert out == dump_json(data)
    assert json.loads(out) == data
    assert out.endswith("}\n")
    assert "größe" in out
    assert list(json.loads(out)) == ["b", "a", "none"]


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_json_has_no_nan(value: float) -> None:
    with pytest.raises(ValueError, match="Out of range float"):
        dump_json({"x": value})


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(_JSON)
@example([[], [1]])
@example([[[1.5, 2], [3, 4]], [[5, 6]]])
@example([["], ["], [",["]])
@example({"a": [[1], [{"b": []}]], "c": {}})
def test_json_is_that_of_the_standard_library(data) -> None:
    assert json.loads(dump_json(data)) == data


def test_json_has_an_item_of_a_list_on_a_line() -> None:
    text = dump_json({"points": [[1.5, 2.0], [3.0, 4.0]], "s": [0.0, 1.0], "links": [{"name": "a", "b": [[1], [2]]}]})
    assert text == (
        '{\n  "points": [\n    [1.5, 2.0],\n    [3.0, 4.0]\n  ],\n  "s": [0.0, 1.0],\n'
        '  "links": [\n    {"name": "a", "b": [[1], [2]]}\n  ]\n}\n'
    )
