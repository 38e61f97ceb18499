from __future__ import annotations

import io
import json

import pytest

from dlogen.console import Console, dump_json, print_json, use_colour


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
