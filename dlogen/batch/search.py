"""Clouds in folders: walking them, and globs."""

from __future__ import annotations

import heapq
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

from dlogen.batch import store
from dlogen.batch.paths import identity

#: Endings of the configuration beside a cloud.
CONFIG_ENDINGS = (".yaml", ".yml")

#: Parts of a path, which sort by folder.
Parts = tuple[str, ...]

_WILDCARDS = frozenset("*?[")


def is_glob(text: str) -> bool:
    """Whether it has wildcards."""
    return not _WILDCARDS.isdisjoint(text)


def split_glob(pattern: str) -> tuple[str, Parts]:
    """The folder before the first wildcard of a pattern, and the parts after it."""
    parts = Path(pattern).parts
    first = next(i for i, part in enumerate(parts) if is_glob(part))
    return os.path.join("", *parts[:first]), parts[first:]


@dataclass(slots=True)
class Folder:
    """A folder and the names in it that matter. Hidden ones are left out.

    Attributes:
        path: how it is opened.
        below: its path below the folder that the search started from.
        clouds: names of files that end like a cloud, sorted.
        configs: names of YAML files.
        folders: names of folders.
        links: names of links to folders.
        results: whether it holds the records of a batch.
        error: why it cannot be listed.
    """

    path: str
    below: Parts = ()
    clouds: list[str] = field(default_factory=list)
    configs: set[str] = field(default_factory=set)
    folders: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    results: bool = False
    error: OSError | None = None


class Match(NamedTuple):
    """What matches a glob.

    Attributes:
        below: its path below the folder that the search started from.
        path: how it is opened.
        is_folder: whether it is a folder, or a link to one.
    """

    below: Parts
    path: str
    is_folder: bool


class Search:
    """Where to look for clouds.

    Args:
        endings: what the names of clouds end with, in small letters.
        results: endings of results that look like clouds.
        out: the folder for the results: it is left out, and so are results of other batches.

    Attributes:
        left_out: folders of results that were left out although there are clouds in them.
    """

    def __init__(self, endings: tuple[str, ...], results: tuple[str, ...], out: str | None) -> None:
        self.endings = endings
        self.left_out: list[str] = []
        self._results = results
        self._out = None if out is None else identity(out)

    def is_cloud(self, path: str) -> bool:
        """Whether its name ends like that of a cloud."""
        return path.lower().endswith(self.endings)

    def is_results(self, folder: str) -> bool:
        """Whether it is the folder for the results, or holds those of another batch."""
        is_out = self._out is not None and identity(folder) == self._out
        return is_out or os.path.lexists(os.path.join(folder, store.NAME))

    def walk(self, top: str) -> list[Folder]:
        """A folder ("" is the current one) and those below it, sorted; each of them once.

        Links to folders are followed after all else, so that a folder is found under its own name if it has one.
        """
        found: list[Folder] = []
        seen: set[tuple[int, int] | None] = set()
        folders: list[tuple[Parts, str]] = [((), top)]
        links: list[tuple[Parts, str]] = []
        while folders or links:
            below, path = folders.pop() if folders else heapq.heappop(links)
            this = identity(path or os.curdir)
            if below and this is not None and this in seen:
                continue
            seen.add(this)
            if below and this is not None and this == self._out:
                self._leave_out(path)
                continue
            folder = self._list(path, below)
            if below and folder.results:
                self._leave_out(path)
                continue
            found.append(folder)
            folders += [((*below, name), os.path.join(path, name)) for name in folder.folders]
            for name in folder.links:
                heapq.heappush(links, ((*below, name), os.path.join(path, name)))
        return sorted(found, key=lambda folder: folder.below)

    def glob(self, folder: str, parts: Parts, below: Parts = ()) -> Iterator[Match]:
        """What in a folder matches the parts of a pattern, sorted.

        As in shells, wildcards do not match hidden names, and ** matches any number of folders.

        Args:
            folder: where to look; "" is the current one.
            parts: of the pattern, see `split_glob`.
            below: path of the folder below the one that the search started from.
        """
        part, rest = parts[0], parts[1:]
        if part == "**" and not rest:
            yield Match(below, folder, is_folder=True)
        elif part == "**":
            for inside in self.walk(folder):
                where = (*below, *inside.below)
                if inside.error is None:
                    yield from self.glob(inside.path, rest, where)
                else:
                    yield Match(where, inside.path, is_folder=True)
        else:
            try:
                found = self._named(folder, part)
            except OSError:
                # It is found itself, and fails later: what may be in it is not lost in silence.
                yield Match(below, folder, is_folder=True)
                return
            for name, is_folder in found:
                path = os.path.join(folder, name)
                if not rest:
                    yield Match((*below, name), path, is_folder)
                elif is_folder:
                    yield from self.glob(path, rest, (*below, name))

    def _named(self, folder: str, part: str) -> list[tuple[str, bool]]:
        """Names in a folder that match a part of a pattern, sorted, and whether they are folders."""
        if not is_glob(part):
            path = os.path.join(folder, part)
            return [(part, os.path.isdir(path))] if os.path.lexists(path) else []
        found: list[tuple[str, bool]] = []
        with os.scandir(folder or os.curdir) as entries:
            for entry in entries:
                name = entry.name
                if fnmatchcase(name, part) and (part.startswith(".") or not name.startswith(".")):
                    is_folder = _is_folder(entry)
                    if is_folder and self.is_results(entry.path):
                        self._leave_out(entry.path)
                    else:
                        found.append((name, is_folder))
        return sorted(found)

    def _leave_out(self, path: str) -> None:
        """Remember a folder of results if clouds are lost with it."""
        if path in self.left_out:
            return
        for _, _, names in os.walk(path):
            if any(self.is_cloud(name) and not name.lower().endswith(self._results) for name in names):
                self.left_out.append(path)
                return

    def _list(self, path: str, below: Parts) -> Folder:
        folder = Folder(path, below)
        try:
            with os.scandir(path or os.curdir) as entries:
                for entry in entries:
                    name = entry.name
                    if name.startswith("."):
                        continue
                    if _is_folder(entry):
                        (folder.links if entry.is_symlink() else folder.folders).append(name)
                    elif name.lower().endswith(self.endings):
                        folder.clouds.append(name)
                    elif name.endswith(CONFIG_ENDINGS):
                        folder.configs.add(name)
                    elif name == store.NAME:
                        folder.results = True
        except OSError as error:
            return Folder(path, below, error=error)
        folder.clouds.sort()
        return folder


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link in a circle, or to a place that is closed to us
        return False
