"""Lists of clouds: text with a path on each line, and CSV with columns."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dlogen.batch.paths import opened, shown
from dlogen.errors import UsageError

_CLOUD_COLUMNS = ("cloud", "path", "file")


class CloudSettings(NamedTuple):
    """What a list says of a cloud besides its path; see `Item`."""

    config: str | None = None
    overrides: tuple[str, ...] = ()
    time: float | None = None


NO_SETTINGS = CloudSettings()


class ListRow(NamedTuple):
    """A cloud or folder of a list.

    Attributes:
        named: its path as the list has it.
        path: how it is opened; None if there is nothing.
        settings: of that cloud.
    """

    named: str
    path: str | None
    settings: CloudSettings = NO_SETTINGS


def read_lines(data: bytes, folders: Sequence[str], list_name: str) -> Iterator[ListRow]:
    """The rows of a text: paths, one a line; or with NUL between them, as `find -print0` writes them.

    Args:
        data: the list.
        folders: paths are taken from the first of these where there is something.
        list_name: for messages.

    Raises:
        UsageError: the text is in UTF-16.
    """
    _refuse_utf16(data, list_name)
    if b"\0" in data:
        names = [name for name in data.split(b"\0") if name]
    else:
        lines = data.removeprefix(b"\xef\xbb\xbf").split(b"\n")
        names = [line.removesuffix(b"\r") for line in lines if line.strip()]
    for name in names:
        text = os.fsdecode(name)
        folder = _folder_of(text, folders)
        yield ListRow(text, None if folder is None else os.path.join(folder, text))


def read_table(data: bytes, folders: Sequence[str], list_name: str) -> Iterator[ListRow]:
    """The rows of a CSV.

    The column `cloud` (or `path`, or `file`) is the path; `config` a YAML file; `time` seconds; those whose names start
    with "#" are ignored; all others are configuration keys. An empty cell sets nothing.

    Args:
        data: the list.
        folders: paths are taken from the first of these where there is something.
        list_name: for messages.

    Raises:
        UsageError: something in it is wrong; names the line.
    """
    _refuse_utf16(data, list_name)
    columns: _Columns | None = None
    for line, cells in _cells(data, list_name):
        if columns is None:
            columns = _Columns(line, cells, list_name)
        else:
            yield columns.row(line, cells, folders)


class _Columns:
    """What the columns of a CSV hold, by its header."""

    def __init__(self, line: int, header: list[str], name: str) -> None:
        from dlogen.config.problems import show
        from dlogen.config.schema import config_keys

        self._name = name
        self._count = len(header)
        self._keys = config_keys()
        self._checked: set[str] = set()
        header = [cell.strip() for cell in header]
        cloud = next((column for column in _CLOUD_COLUMNS if column in header), None)
        if cloud is None:
            hint = "the first line names the columns, with commas between: cloud, config, time or configuration keys"
            raise _wrong(name, line, "there is no column 'cloud'", hint)
        places: dict[str, int] = {}
        for place, column in enumerate(header):
            if column.startswith("#"):
                continue
            key = column if column in (cloud, "config", "time") else self._keys.find(column)
            if key is None:
                problem = self._keys.unknown("", column)
                hint = f"{problem.hint} A column whose name starts with # is ignored"
                raise _wrong(name, line, f"unknown column: {problem.message}", hint)
            if key in places:
                raise _wrong(name, line, f"the column {show(column)} is there twice", "keep one of them")
            places[key] = place
        self._cloud = places.pop(cloud)
        self._config, self._time = places.pop("config", None), places.pop("time", None)
        self._settings = places

    def row(self, line: int, cells: list[str], folders: Sequence[str]) -> ListRow:
        """What a row says."""
        if len(cells) != self._count:
            message = f"{len(cells)} cells, but the header has {self._count}"
            raise _wrong(self._name, line, message, "put cells with commas in them in quotes")
        named = cells[self._cloud]
        if not named.strip():
            raise _wrong(self._name, line, "no cloud is named", "leave the row out")
        folder = _folder_of(named, folders)
        # The same place before others.
        config = self._config_file(line, cells, folders if folder is None else [folder, *folders])
        settings = CloudSettings(config, self._overrides(line, cells), self._seconds(line, cells))
        return ListRow(named, None if folder is None else os.path.join(folder, named), settings)

    def _config_file(self, line: int, cells: list[str], folders: Sequence[str]) -> str | None:
        text = "" if self._config is None else cells[self._config]
        if not text.strip():
            return None
        folder = _folder_of(text, folders)
        if folder is None:
            raise _wrong(self._name, line, f"there is no configuration file {shown(text)}", "check the path")
        return opened(os.path.join(folder, text))

    def _seconds(self, line: int, cells: list[str]) -> float | None:
        from dlogen.config.problems import show

        text = "" if self._time is None else cells[self._time]
        if not text.strip():
            return None
        try:
            seconds = float(text)
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds):
            raise _wrong(self._name, line, f"time = {show(text)}: expected a number (s)", "such as 0.04")
        return seconds

    def _overrides(self, line: int, cells: list[str]) -> tuple[str, ...]:
        from dlogen.config.problems import Problem
        from dlogen.config.reader import read_override

        given = tuple(f"{key}={text}" for key, place in self._settings.items() if (text := cells[place].strip()))
        for override in given:
            if override not in self._checked:
                problems: list[Problem] = []
                read_override(self._keys, override, problems)
                if problems:
                    raise _wrong(self._name, line, problems[0].message, problems[0].hint)
                self._checked.add(override)
        return given


def _cells(data: bytes, name: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV that are not blank, with the lines that they start on."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise _wrong(name, line, "not UTF-8 text", "save it as UTF-8") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise _wrong(name, line, "a NUL byte", "this is no CSV: give another list a name that ends otherwise")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    while True:
        line = reader.line_num + 1
        try:
            row = next(reader, None)
        except csv.Error as error:
            raise _wrong(name, line, f"not CSV: {error}", "check the quotes") from None
        if row is None:
            return
        if any(cell.strip() for cell in row):
            yield line, row


def _folder_of(text: str, folders: Sequence[str]) -> str | None:
    """The first of the folders from which the path leads to something."""
    return next((folder for folder in folders if os.path.lexists(os.path.join(folder, text))), None)


def _refuse_utf16(data: bytes, name: str) -> None:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise UsageError("the list is in UTF-16", "save it as UTF-8", path=name)


def _wrong(name: str, line: int, message: str, hint: str) -> UsageError:
    return UsageError(f"line {line}: {message}", hint, path=name)
