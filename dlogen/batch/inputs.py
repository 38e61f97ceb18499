"""The clouds of a batch: finds them in files, folders, globs and lists, and says where the results of each go.

Nothing is opened here but folders and lists: a cloud that cannot be read fails when it is its turn, not before.
"""

from __future__ import annotations

import csv
import heapq
import io
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

from dlogen.errors import InputError, UsageError

#: The record of a batch; a folder that holds one holds results.
LEDGER = "dlogen.sqlite"

#: What a batch itself writes at the top of its output folder.
OWN_FILES = frozenset({LEDGER, f"{LEDGER}-wal", f"{LEDGER}-shm", "summary.csv", "summary.json", ".dlogen"})

_CONFIG_ENDINGS = (".yaml", ".yml")
_CLOUD_COLUMNS = ("cloud", "path", "file")
_WILDCARDS = frozenset("*?[")

# With more entries, looking for the nearest name would take longer than finding the mistake.
_MOST_NAMES = 5000


@dataclass(frozen=True, slots=True)
class Item:
    """One cloud of a batch.

    Attributes:
        cloud: path of the cloud as it is opened. A folder that cannot be listed is here as well: reading it fails,
            so that it is among the failures.
        key: where its results go below the output folder, without an ending and with "/" between folders: those of
            "a/x" are a/x.urdf and so on. Unique in a batch, also on file systems that do not tell cases apart if the
            system does not; never absolute, without "..".
        config: YAML file of its own: the one beside the cloud, or that of the column `config`.
        overrides: "KEY=VALUE" from the columns of a CSV list.
        time: column `time` of a CSV list, seconds.
    """

    cloud: str
    key: str
    config: str | None = None
    overrides: tuple[str, ...] = ()
    time: float | None = None


def find_items(
    inputs: Sequence[str],
    *,
    out: Path | None = None,
    root: str | None = None,
    own_configs: bool = True,
    stdin: BinaryIO | None = None,
    outputs: Callable[[str], tuple[str, ...]] | None = None,
) -> list[Item]:
    """The clouds that the inputs of a batch stand for, in their order; those of a folder sorted.

    What exists is itself, whatever its name. Otherwise "-" is a list on stdin, "@FILE" a list in a file (a CSV if its
    name ends so), and what has wildcards is a glob.

    Args:
        inputs: as on the command line.
        out: the output folder: it is not searched, and no cloud in it is overwritten.
        root: keys are relative to this folder.
        own_configs: take `x.yaml` or `x.yml` beside `x.ply` for the configuration of that cloud.
        stdin: where "-" is read from; default the process's.
        outputs: stem -> names of the files that are written for it; default those of `dlogen fit`.

    Raises:
        UsageError: something named does not exist or holds no cloud, a list is wrong, or results would overwrite one
            another or a cloud.
        InputError: a folder or list that is named cannot be read.
    """
    outputs = outputs or _default_outputs
    finder = _Finder(out, root, own_configs, stdin)
    found = [item for text in inputs for item in finder.find(text)]
    if not found:
        raise UsageError("there are no clouds to work on", "name files or folders of clouds")
    found = _without_repeats(found)
    items = _with_unique_keys(found, outputs)
    overwritten = _overwritten(items, out, outputs)
    if overwritten and out is not None:
        if not (out / LEDGER).exists():
            one = items[min(overwritten)].cloud
            raise UsageError(
                f"the results would overwrite the cloud {_shown(one)}", "choose another folder with -o, or rename it"
            )
        # An earlier run of the same batch wrote them.
        items = _with_unique_keys([item for i, item in enumerate(found) if i not in overwritten], outputs)
    return items


def _default_outputs(stem: str) -> tuple[str, ...]:
    return (f"{stem}.urdf", f"{stem}.json", f"{stem}.report.json")


class _Settings(NamedTuple):
    """What a row of a list says of its cloud."""

    config: str | None = None
    overrides: tuple[str, ...] = ()
    time: float | None = None


_NONE = _Settings()


@dataclass(slots=True)
class _Folder:
    """A folder and the names of the clouds and YAML files in it.

    Attributes:
        path: how it is opened.
        below: its path below the folder that the walk started from, in parts.
        error: why it cannot be listed.
    """

    path: str
    below: tuple[str, ...]
    clouds: list[str] = field(default_factory=list)
    configs: set[str] = field(default_factory=set)
    error: OSError | None = None


class _Finder:
    """Turns inputs into items whose keys are not checked against one another yet."""

    def __init__(self, out: Path | None, root: str | None, own_configs: bool, stdin: BinaryIO | None) -> None:
        from dlogen.formats import cloud_formats

        self._endings = tuple(suffix for item in cloud_formats() for suffix in item.suffixes)
        self._out = None if out is None else _identity(str(out))
        self._root = root
        self._own_configs = own_configs
        self._stdin = stdin
        self._below_root: dict[str, str] = {}
        if root is not None and not os.path.isdir(root):
            raise UsageError(f"there is no folder {_shown(root)}", _nearest(root) or "--root takes a folder")

    def find(self, text: str) -> Iterator[Item]:
        """The clouds of one input."""
        if _is_folder(text):
            yield from self._named_folder(text)
        elif os.path.lexists(text):
            yield self._file(text, _named_key(text), _NONE)
        elif text == "-":
            yield from self._list("standard input", self._read_stdin(), [""])
        elif text.startswith("@"):
            path = text[1:] if os.path.lexists(text[1:]) else os.path.expanduser(text[1:])
            yield from self._list(path, _read_list(path), ["", os.path.dirname(path)])
        elif not _WILDCARDS.isdisjoint(text):
            yield from self._glob(text)
        elif text.startswith("~") and os.path.lexists(os.path.expanduser(text)):
            yield from self.find(os.path.expanduser(text))
        else:
            raise UsageError(f"there is no {_shown(text) or 'file without a name'}", _nearest(text) or "check the path")

    def _file(self, path: str, key: str, settings: _Settings) -> Item:
        """A cloud whose key, if there is no root, is this one with its ending."""
        folder, name = os.path.split(path)
        stem = os.path.splitext(name)[0]
        config = settings.config
        if config is None and self._own_configs:
            beside = (os.path.join(folder, stem + ending) for ending in _CONFIG_ENDINGS)
            config = next((_opened(path) for path in beside if os.path.isfile(path)), None)
        if self._root is not None:
            key = self._prefix(folder, path) + name
        key = key.removesuffix(name) + stem
        return Item(_opened(path), key, config, settings.overrides, settings.time)

    def _prefix(self, folder: str, cloud: str) -> str:
        """Keys of what is in this folder start so, when there is a root."""
        assert self._root is not None
        if folder not in self._below_root:
            below = _relative(folder or os.curdir, self._root)
            if below is None:
                raise UsageError(f"{_shown(cloud)} is not below {_shown(self._root)}", "choose another --root")
            self._below_root[folder] = f"{below}/" if below else ""
        return self._below_root[folder]

    def _named_folder(self, path: str) -> Iterator[Item]:
        folders = self._walk(path)
        if folders[0].error is not None:
            reason = folders[0].error.strerror or folders[0].error
            raise InputError(f"the folder cannot be listed: {reason}", "check its permissions", path=path)
        if not any(folder.clouds or folder.error for folder in folders):
            # Shells expand captures/* to everything in it, the results of earlier runs as well.
            if _identity(path) == self._out or os.path.lexists(os.path.join(path, LEDGER)):
                return
            raise UsageError(f"there is no cloud in {_shown(path)}", f"looked for names that end in {self._expected}")
        yield from self._items(folders, "", _NONE)

    @property
    def _expected(self) -> str:
        return " or ".join(self._endings)

    def _items(self, folders: Iterable[_Folder], above: str, settings: _Settings) -> Iterator[Item]:
        """The clouds of folders; `above` comes before their keys, if there is no root."""
        config, overrides, time = settings
        for folder in folders:
            inside = os.path.join(folder.path, "")
            if folder.error is not None:
                parent, name = os.path.split(inside[:-1])
                where = above + "/".join(folder.below) if self._root is None else self._prefix(parent, inside) + name
                yield Item(folder.path, where, config, overrides, time)
            if not folder.clouds:
                continue
            if self._root is not None:
                prefix = self._prefix(folder.path, inside + folder.clouds[0])
            else:
                prefix = above + "".join(f"{part}/" for part in folder.below)
            for name in folder.clouds:
                stem = os.path.splitext(name)[0]
                own = config
                if own is None and folder.configs:
                    beside = (stem + ending for ending in _CONFIG_ENDINGS)
                    own = next((inside + name for name in beside if name in folder.configs), None)
                yield Item(inside + name, prefix + stem, own, overrides, time)

    def _walk(self, top: str) -> list[_Folder]:
        """A folder and those below it, sorted. Left out: hidden ones, results of batches, and any a second time.

        Links to folders are followed after all else, so that a folder is found under its own name if it has one.
        """
        found: list[_Folder] = []
        seen = {_identity(top), self._out}
        folders: list[tuple[tuple[str, ...], str]] = [((), top)]
        links: list[tuple[tuple[str, ...], str]] = []
        while folders or links:
            below, path = folders.pop() if folders else heapq.heappop(links)
            try:
                identity = _identity_or_raise(path)
                if below and identity in seen:
                    continue
                seen.add(identity)
                folder = _Folder(path, below)
                inside = os.path.join(path, "")
                results = False
                subfolders: list[tuple[tuple[str, ...], str]] = []
                sublinks: list[tuple[tuple[str, ...], str]] = []
                with os.scandir(path) as entries:
                    for entry in entries:
                        name = entry.name
                        if name.startswith("."):
                            continue
                        if _entry_is_folder(entry):
                            (sublinks if entry.is_symlink() else subfolders).append(((*below, name), inside + name))
                        elif name.lower().endswith(self._endings):
                            folder.clouds.append(name)
                        elif name.endswith(_CONFIG_ENDINGS):
                            folder.configs.add(name)
                        elif name == LEDGER:
                            results = True
            except OSError as error:
                found.append(_Folder(path, below, error=error))
                continue
            if results and below:
                continue
            folder.clouds.sort()
            if not self._own_configs:
                folder.configs.clear()
            found.append(folder)
            folders += subfolders
            for link in sublinks:
                heapq.heappush(links, link)
        return sorted(found, key=lambda folder: folder.below)

    def _glob(self, text: str) -> Iterator[Item]:
        """What matches a pattern: clouds by the endings of their names, and folders of them."""
        parts = Path(os.path.expanduser(text)).parts
        first = next((i for i, part in enumerate(parts) if not _WILDCARDS.isdisjoint(part)), len(parts))
        base = os.path.join(*parts[:first]) if first else ""
        matches = 0
        some = False
        for below, path in self._matches(base, (), parts[first:]):
            matches += 1
            if _is_folder(path):
                found = self._items(self._walk(path), "".join(f"{part}/" for part in below), _NONE)
            elif path.lower().endswith(self._endings):
                found = iter([self._file(path, "/".join(below), _NONE)])
            else:
                continue
            for item in found:
                some = True
                yield item
        if not some:
            hint = f"{matches} other names do, but none that ends in {self._expected}" if matches else _nearest(base)
            raise UsageError(f"no cloud matches {_shown(text)}", hint or "check the pattern")

    def _matches(
        self, folder: str, below: tuple[str, ...], parts: tuple[str, ...]
    ) -> Iterator[tuple[tuple[str, ...], str]]:
        """What in a folder matches the parts of a pattern, sorted: (path below the first folder in parts, path)."""
        part, rest = parts[0], parts[1:]
        if part == "**":
            while rest and rest[0] == "**":
                rest = rest[1:]
            if not rest:
                if _is_folder(folder or os.curdir):
                    yield below, folder or os.curdir
                return
            for sub in self._walk(folder or os.curdir):
                yield from self._matches(sub.path, (*below, *sub.below), rest)
            return
        if _WILDCARDS.isdisjoint(part):
            names = [part]
        else:
            try:
                names = sorted(name for name in os.listdir(folder or os.curdir) if fnmatchcase(name, part))
            except FileNotFoundError:
                return
            except NotADirectoryError:
                return
            except OSError:
                yield below, folder or os.curdir
                return
            if not part.startswith("."):
                names = [name for name in names if not name.startswith(".")]
        for name in names:
            path = os.path.join(folder, name)
            if rest:
                if _is_folder(path):
                    yield from self._matches(path, (*below, name), rest)
            elif os.path.lexists(path) and not self._is_result(path):
                yield (*below, name), path

    def _is_result(self, path: str) -> bool:
        """Whether it is a folder of results."""
        return _is_folder(path) and (_identity(path) == self._out or os.path.lexists(os.path.join(path, LEDGER)))

    def _read_stdin(self) -> bytes:
        stream = self._stdin
        if stream is None:
            if sys.stdin.isatty():
                raise InputError("nothing is piped in", "pipe a list of clouds: find . -name '*.ply' | dlogen batch -")
            stream = sys.stdin.buffer
        return stream.read()

    def _list(self, name: str, data: bytes, bases: Sequence[str]) -> Iterator[Item]:
        """The clouds of a list. Paths are taken from the first of the bases where there is something.

        A cloud that is not there is one of its failures, unless none of them is there.
        """
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise UsageError("the list is in UTF-16", "save it as UTF-8", path=_shown(name))
        table = len(bases) > 1 and name.lower().endswith(".csv")
        rows = _table_rows(_shown(name), data, bases) if table else ((text, _NONE) for text in _lines(data))
        missing: list[str] = []
        some = False
        for text, settings in rows:
            path = _first_existing(text, bases)
            if path is None:
                missing.append(text)
                yield self._file(text, _named_key(text), settings)
                continue
            some = True
            if _is_folder(path):
                yield from self._items(self._walk(path), "", settings)
            else:
                yield self._file(path, _named_key(text), settings)
        if missing and not some:
            what = _shown(missing[0])
            raise UsageError(
                f"none of the {len(missing)} clouds in the list exists, such as {what}",
                "paths are taken from the current folder" + (" or from that of the list" if len(bases) > 1 else ""),
                path=_shown(name),
            )
        if not some:
            raise UsageError("the list is empty", "write one path a line", path=_shown(name))


def _read_list(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise UsageError(f"there is no list {_shown(path)}", _nearest(path) or "check the path") from None
    except OSError as error:
        raise InputError(f"the list cannot be read: {error.strerror or error}", "check it", path=_shown(path)) from None


def _lines(data: bytes) -> list[str]:
    """Paths, one a line; or with NUL between them, as `find -print0` writes them."""
    if b"\0" in data:
        return [os.fsdecode(part) for part in data.split(b"\0") if part]
    lines = data.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    return [os.fsdecode(line.removesuffix(b"\r")) for line in lines if line.strip()]


def _table_rows(name: str, data: bytes, bases: Sequence[str]) -> Iterator[tuple[str, _Settings]]:
    """Path and settings in every row of a CSV."""
    from dlogen.config import config_keys
    from dlogen.config_reader import read_override
    from dlogen.settings import Problem, show

    def wrong(line: int, message: str, hint: str) -> UsageError:
        return UsageError(f"line {line}: {message}", hint, path=name)

    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise wrong(data.count(b"\n", 0, error.start) + 1, "not UTF-8 text", "save it as UTF-8") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise wrong(line, "a NUL byte", "a list with NUL between the paths must not be called .csv")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    keys = config_keys()
    checked: set[str] = set()
    header: list[str] | None = None
    columns: dict[str, int] = {}
    while True:
        line = reader.line_num + 1
        try:
            row = next(reader, None)
        except csv.Error as error:
            raise wrong(line, f"not CSV: {error}", "check the quotes") from None
        if row is None:
            break
        if not any(cell.strip() for cell in row):
            continue
        if header is None:
            header = [cell.strip() for cell in row]
            cloud = next((column for column in _CLOUD_COLUMNS if column in header), None)
            if cloud is None:
                raise wrong(line, "there is no column 'cloud'", "the first line names the columns, with commas between")
            for place, column in enumerate(header):
                if column.startswith("#"):
                    continue
                key = column if column in (cloud, "config", "time") else keys.find(column)
                if key is None:
                    problem = keys.unknown("", column)
                    raise wrong(line, problem.message, f"{problem.hint}; a column whose name starts with # is ignored")
                if key in columns:
                    raise wrong(line, f"{show(column)} is there twice", "keep one of the columns")
                columns[key] = place
            where = columns.pop(cloud)
            config_at, time_at = columns.pop("config", None), columns.pop("time", None)
            continue
        if len(row) != len(header):
            raise wrong(
                line, f"{len(row)} cells, but there are {len(header)} columns", "put cells with commas in quotes"
            )
        if not row[where].strip():
            raise wrong(line, "no cloud is named", "leave the row out")
        config = time = None
        if config_at is not None and row[config_at].strip():
            config = _first_existing(row[config_at], bases)
            if config is None or _is_folder(config):
                raise wrong(line, f"there is no configuration file {_shown(row[config_at])}", "check the path")
            config = _opened(config)
        if time_at is not None and row[time_at].strip():
            time = _seconds(row[time_at])
            if time is None:
                raise wrong(line, f"time = {show(row[time_at])}: expected a number of seconds", "such as 0.04")
        overrides = tuple(f"{key}={row[i].strip()}" for key, i in columns.items() if row[i].strip())
        for override in overrides:
            if override not in checked:
                problems: list[Problem] = []
                read_override(keys, override, problems)
                if problems:
                    raise wrong(line, problems[0].message, problems[0].hint)
                checked.add(override)
        yield row[where], _Settings(config, overrides, time)


def _seconds(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _first_existing(text: str, bases: Sequence[str]) -> str | None:
    """The path, from the first of the folders where there is something."""
    paths = (os.path.join(base, text) for base in bases)
    return next((path for path in paths if os.path.lexists(path)), None)


def _without_repeats(items: list[Item]) -> list[Item]:
    """One of those that are the same file and have the same key.

    Raises:
        UsageError: they have different settings.
    """
    seen: set[str] = set()
    repeated = {item.key for item in items if item.key in seen or seen.add(item.key)}  # type: ignore[func-returns-value]
    if not repeated:
        return items
    kept: list[Item] = []
    first: dict[tuple[str, str], Item] = {}
    for item in items:
        if item.key in repeated:
            earlier = first.setdefault((item.key, os.path.realpath(item.cloud)), item)
            if earlier is not item:
                if item.overrides != earlier.overrides or item.time != earlier.time or item.config != earlier.config:
                    raise UsageError(
                        f"{_shown(item.cloud)} is there twice, with different settings",
                        "one result can be made of a cloud: run a batch for each, with different -o",
                    )
                continue
        kept.append(item)
    return kept


def _with_unique_keys(items: Sequence[Item], outputs: Callable[[str], tuple[str, ...]]) -> list[Item]:
    """The items, with the ending kept in the keys of those whose files would collide.

    Raises:
        UsageError: they collide nevertheless.
    """
    settled = list(items)
    whole: set[int] = set()
    while grow := _to_grow(settled, outputs, whole):
        for i in grow:
            item = settled[i]
            settled[i] = replace(item, key=item.key + os.path.splitext(item.cloud)[1])
        whole |= grow
    return settled


def _to_grow(items: Sequence[Item], outputs: Callable[[str], tuple[str, ...]], whole: set[int]) -> set[int]:
    """Items whose keys need their endings because what is written for them collides with something.

    Two files collide also where one would have to be a folder: x.json of x.ply, and x.json/ of x.json/y.ply.
    """
    members: dict[str, list[int]] = {}
    for i, item in enumerate(items):
        members.setdefault(os.path.normcase(item.key.rpartition("/")[0]), []).append(i)
    above: dict[str, int] = {}
    for folder, inside in members.items():
        while folder and folder not in above:
            above[folder] = inside[0]
            folder = folder.rpartition("/")[0]
    grow: set[int] = set()

    def clash(i: int, other: int | None, able: tuple[int, ...]) -> None:
        fit = {j for j in able if j not in whole and os.path.splitext(items[j].cloud)[1]}
        if not fit:
            raise _collision(items[i], None if other is None else items[other])
        grow.update(fit)

    for folder, inside in members.items():
        owners: dict[str, int] = {}
        for i in inside:
            stem = items[i].key.rpartition("/")[2]
            for name in {os.path.normcase(name.partition("/")[0]) for name in outputs(stem) or (stem,)}:
                if not folder and name.casefold() in OWN_FILES:
                    clash(i, None, (i,))
                other = owners.setdefault(name, i)
                if other != i:
                    clash(i, other, (i, other))
                if (path := f"{folder}/{name}" if folder else name) in above:
                    clash(i, above[path], (i,))
    for name in OWN_FILES:
        if name in above:
            raise _collision(items[above[name]], None)
    return grow


def _collision(item: Item, other: Item | None) -> UsageError:
    if other is None:
        return UsageError(
            f"the results of {_shown(item.cloud)} would collide with the batch's own files",
            "use --root with a folder higher up, or rename it",
        )
    clouds = [os.path.abspath(cloud) for cloud in (item.cloud, other.cloud)]
    try:
        common = os.path.commonpath([os.path.dirname(cloud) for cloud in clouds])
    except ValueError:  # on different drives
        hint = "run a batch for each, with different -o"
    else:
        hint = f"use --root {_shown(common)}: results are then laid out as the clouds are below that folder"
    return UsageError(f"the results of {_shown(other.cloud)} and {_shown(item.cloud)} would collide", hint)


def _overwritten(items: Sequence[Item], out: Path | None, outputs: Callable[[str], tuple[str, ...]]) -> set[int]:
    """Items whose clouds lie where results go."""
    if out is None or not out.is_dir():
        return set()
    target = os.path.realpath(out)
    inside: dict[str, str | None] = {}
    places: dict[str, int] = {}
    for i, item in enumerate(items):
        folder, name = os.path.split(item.cloud)
        if folder not in inside:
            inside[folder] = _relative(os.path.realpath(folder or os.curdir), target)
        if (below := inside[folder]) is not None:
            places[f"{below}/{name}" if below else name] = i
    if not places:
        return set()
    written = (
        f"{folder}{slash}{name}"
        for item in items
        for folder, slash, stem in [item.key.rpartition("/")]
        for name in outputs(stem)
    )
    return {places[path] for path in written if path in places}


def _named_key(path: str) -> str:
    """Key, with its ending, of a cloud that is named: its path if that is below the current folder, else its name."""
    normal = os.path.normpath(path)
    if os.path.isabs(normal) or os.path.splitdrive(normal)[0] or normal.split(os.sep)[0] == os.pardir:
        return os.path.basename(normal)
    return normal.replace(os.sep, "/")


def _relative(folder: str, root: str) -> str | None:
    """Path of a folder below another one, with "/" and "" for itself; None if it is not below."""
    for path, start in (
        (os.path.abspath(folder), os.path.abspath(root)),
        (os.path.realpath(folder), os.path.realpath(root)),
    ):
        try:
            relative = os.path.relpath(path, start)
        except ValueError:  # on another drive
            continue
        if relative.split(os.sep)[0] != os.pardir:
            return "" if relative == os.curdir else relative.replace(os.sep, "/")
    return None


def _opened(path: str) -> str:
    """A path that readers do not take for stdin."""
    return os.path.join(os.curdir, path) if path == "-" else path


def _is_folder(path: str) -> bool:
    return os.path.isdir(path)


def _entry_is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link in a circle, or to a place that is closed to us
        return False


def _identity(path: str) -> tuple[int, int] | None:
    try:
        return _identity_or_raise(path)
    except OSError:
        return None


def _identity_or_raise(path: str) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_dev, status.st_ino


def _nearest(path: str) -> str:
    """A hint at the name that is most like the first part of the path that does not exist, or nothing."""
    import difflib

    missing = os.path.normpath(path)
    while (parent := os.path.dirname(missing)) and parent != missing and not os.path.lexists(parent):
        missing = parent
    try:
        with os.scandir(parent or os.curdir) as entries:
            names = [entry.name for entry in islice(entries, _MOST_NAMES + 1)]
    except OSError:
        return ""
    if len(names) > _MOST_NAMES:
        return ""
    near = difflib.get_close_matches(os.path.basename(missing), sorted(names), n=1)
    return f"did you mean {_shown(os.path.join(parent, near[0]))}?" if near else ""


def _shown(path: str) -> str:
    """A path as messages have it: with escapes where it would garble them."""
    return path if path.isprintable() else repr(path)
