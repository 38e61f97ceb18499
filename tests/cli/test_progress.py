"""Progress in words, and when it is shown."""

from __future__ import annotations

import io
import sys

import pytest

from dlogen.cli import progress as module
from dlogen.cli.console import Console
from dlogen.cli.progress import duration, line, progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min 0 s"),
        (71.0, "1 min 11 s"),
        (3600.0, "1 h 0 min"),
        (1e5, "27 h 46 min"),
    ],
)
def test_durations_in_words(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_a_line_of_a_log() -> None:
    assert line(417, 3, 1000, 51.0) == "420 of 1000 clouds (3 failed), 8.2 a second, 1 min 10 s left"
    assert line(0, 0, 10, 5.0) == "0 of 10 clouds, 0.0 a second, ? left"
    assert line(10, 0, 10, 0.0).endswith("0 s left")


def test_lines_come_now_and_then(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    now = 100.0
    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    with progress(Console(), 10_000) as show:
        for i in range(3600):
            now += 1.0
            show(i + 1, 0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "10 of 10000 clouds, 1.0 a second, 2 h 46 min left"
    # Every ten seconds for ten minutes, then every minute.
    assert len(lines) == 59 + 50


@pytest.mark.parametrize(("level", "total"), [(-1, 10), (0, 0)])
def test_nothing_when_quiet_or_without_work(level: int, total: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with progress(Console(level), total) as show:
        show(1, 0)
    assert terminal.getvalue() == ""


def test_a_bar_on_a_terminal_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    monkeypatch.setattr(sys, "stdout", data := io.StringIO())
    with progress(Console(), 20) as show:
        show(4, 3)
        # Data goes where it would without a bar.
        print("data")
    assert data.getvalue() == "data\n"
    shown = terminal.getvalue()
    assert "7/20" in shown
    assert "3 failed" in shown
    # The cursor is there again, and the line of the bar is erased.
    assert "\x1b[?25h" in shown
    assert shown.rstrip().endswith("\x1b[2K")


def test_no_bar_where_lines_would_mix_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with progress(Console(), 20, bar=False) as show:
        show(4, 3)
    assert terminal.getvalue() == ""
