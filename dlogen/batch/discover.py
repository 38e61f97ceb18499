"""The clouds of a batch: files, folders, globs and lists, and where the results of each go.

Only folders and lists are opened here: a cloud that cannot be read fails when it is its turn, not before.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from dlogen.batch import store
from dlogen.batch.item import Item
from dlogen.batch.lists import NO_SETTINGS, CloudSettings, ListRow, read_lines, read_table
from dlogen.batch.output_names import FileNames, overwritten, with_unique_keys, without_repeats
from dlogen.batch.paths import below, key_as_named, nearest, opened, shown
from dlogen.batch.search import CONFIG_ENDINGS, Parts, Search, is_glob, split_glob
from dlogen.errors import InputError, UsageError


def find_items(
    inputs: Sequence[str],
    *,
    out: Path | None = None,
    root: str | None = None,
    own_configs: bool = True,
    stdin: BinaryIO | None = None,
    outputs: FileNames | None = None,
    warn: Callable[[str], None] | None = None,
) -> list[Item]:
    """The clouds that the inputs of a batch stand for: in their order, those of a folder sorted.

    What exists is itself, whatever its name. Otherwise "-" is a list on stdin, "@FILE" is a list in a file, and what
    has wildcards is a glob. Keys are relative to the folder that was named, or to that before the first wildcard; of
    clouds that are named themselves, and of several folders, they are as named, or start with the name only where that
    leads out of the current folder.

    Args:
        inputs: as on the command line.
        out: folder for the results. It is not searched, and no cloud in it is overwritten.
        root: keys are relative to this folder.
        own_configs: take `x.yaml` or `x.yml` beside `x.ply` for that cloud's configuration.
        stdin: where "-" is read from; default sys.stdin.
        outputs: stem -> names of the files that are written for it; default those that `dlogen fit` writes.
        warn: is told of clouds that are left out, because they are among results.

    Raises:
        UsageError: something named does not exist or holds no cloud, a list is wrong, or results would overwrite one
            another, or a cloud.
        InputError: a folder or list that was named cannot be read.
    """
    if outputs is None:
        from dlogen.io.outputs import Outputs

        outputs = Outputs().files
    finder = _Finder(out, root, own_configs, stdin, several=sum(map(os.path.isdir, inputs)) > 1)
    found = without_repeats([item for text in inputs for item in finder.find(text)])
    if warn is not None:
        for folder in finder.left_out(found):
            warn(_said_of_left_out(folder))
    if not found:
        raise UsageError("there are no clouds to work on", "name files or folders of clouds")
    items = with_unique_keys(found, outputs)
    if out is None or not (lost := overwritten(items, str(out), outputs)):
        return items
    if not (out / store.NAME).exists():
        cloud = items[min(lost)].cloud
        raise UsageError(f"results would overwrite the cloud {shown(cloud)}", "choose another folder with -o")
    # An earlier run has written them.
    return [item for i, item in enumerate(items) if i not in lost]


def _said_of_left_out(folder: str) -> str:
    return f"the clouds in {shown(folder)} are left out: it is a folder of results; to take them, name it"


class _Finder:
    """Makes items of inputs. Their keys are not yet checked against one another."""

    def __init__(
        self, out: Path | None, root: str | None, own_configs: bool, stdin: BinaryIO | None, several: bool
    ) -> None:
        from dlogen.io.registry import cloud_formats, model_formats

        endings = tuple(suffix for item in cloud_formats() for suffix in item.suffixes)
        results = tuple(name for item in model_formats() for name in item.files("") if name.endswith(endings))
        self._search = Search(endings, results, None if out is None else str(out))
        self._expected = " or ".join(endings)
        self._root = root
        self._below_root: dict[str, str] = {}
        self._own_configs = own_configs
        self._stdin = stdin
        #: Folders are told apart by their names.
        self._several = several
        if root is not None and not os.path.isdir(root):
            raise UsageError(f"there is no folder {shown(root)}", nearest(root) or "--root takes a folder")

    def left_out(self, found: Sequence[Item]) -> list[str]:
        """Folders of results that hold clouds of which none was found, because they were not searched."""
        folders = list(dict.fromkeys(map(os.path.normpath, self._search.left_out)))
        clouds = [os.path.normpath(item.cloud) for item in found] if folders else []
        return [folder for folder in folders if not any(cloud.startswith(folder + os.sep) for cloud in clouds)]

    def _said_of_left_out(self) -> str:
        return next(map(_said_of_left_out, self.left_out([])), "")

    def find(self, text: str) -> Iterator[Item]:
        """The clouds of one input."""
        if os.path.isdir(text):
            yield from self._named_folder(text)
        elif os.path.lexists(text):
            yield self._file(text, key_as_named(text))
        elif text == "-":
            yield from self._listed(read_lines(self._read_stdin(), [""], "stdin"), "stdin")
        elif text.startswith("@") and text != "@":
            yield from self._list(text[1:] if os.path.lexists(text[1:]) else os.path.expanduser(text[1:]))
        elif is_glob(text):
            yield from self._glob(text)
        elif text.startswith("~") and os.path.expanduser(text) != text:
            yield from self.find(os.path.expanduser(text))
        elif text:
            raise UsageError(f"there is no {shown(text)}", nearest(text) or "check the path")
        else:
            raise UsageError("an input without a name", "name a file, a folder, a glob or a list")

    def _named_folder(self, path: str) -> Iterator[Item]:
        empty = True
        parts = tuple(part for part in key_as_named(path).split("/") if part.strip(".")) if self._several else ()
        for item in self._below(path, parts, named=True):
            empty = False
            yield item
        # Shells expand captures/* to all that is in it, also to the results of earlier runs.
        if empty and not self._search.is_results(path):
            hint = f"names of clouds end in {self._expected}"
            raise UsageError(f"there is no cloud in {shown(path)}", self._said_of_left_out() or hint)

    def _glob(self, pattern: str) -> Iterator[Item]:
        """Of what matches the pattern, folders and what ends like a cloud."""
        base, parts = split_glob(os.path.expanduser(pattern))
        if not os.path.isdir(base or os.curdir):
            raise UsageError(f"there is no folder {shown(base)}", nearest(base) or "check the path")
        others = 0
        empty = True
        for match in self._search.glob(base, parts):
            found: Iterable[Item] = ()
            if match.is_folder:
                found = self._below(match.path, match.below)
            elif self._search.is_cloud(match.path):
                found = [self._file(match.path, "/".join(match.below))]
            else:
                others += 1
            for item in found:
                empty = False
                yield item
        if empty:
            hint = f"names of clouds end in {self._expected}: give others in a list" if others else "check the pattern"
            raise UsageError(f"no cloud matches {shown(pattern)}", self._said_of_left_out() or hint)

    def _list(self, path: str) -> Iterator[Item]:
        name = shown(path)
        try:
            data = Path(path).read_bytes()
        except FileNotFoundError:
            raise UsageError(f"there is no list {name}", nearest(path) or "check the path") from None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", "@ takes a list", path=name) from error
        read = read_table if path.lower().endswith(".csv") else read_lines
        yield from self._listed(read(data, ["", os.path.dirname(path)], name), name)

    def _listed(self, rows: Iterable[ListRow], name: str) -> Iterator[Item]:
        """The clouds of a list. One that does not exist fails when it is its turn, unless none of them exists.

        Folders without clouds are passed over: `find` lists them all.
        """
        missing = None
        exists = False
        for row in rows:
            if row.path is None:
                missing = missing or row.named
                yield self._file(row.named, key_as_named(row.named), row.settings)
                continue
            exists = True
            if os.path.isdir(row.path):
                yield from self._below(row.path, settings=row.settings)
            else:
                yield self._file(row.path, key_as_named(row.named), row.settings)
        if missing is not None and not exists:
            hint = "a list has a path on each line, from the current folder or from that of the list"
            raise UsageError(f"nothing in it exists, such as {shown(missing)}", hint, path=name)
        if not exists:
            raise UsageError("the list is empty", "a list has a path on each line", path=name)

    def _read_stdin(self) -> bytes:
        stream = self._stdin or sys.stdin.buffer
        if stream.isatty():
            raise InputError("nothing is piped in", "pipe a list: find . -name '*.ply' | dlogen batch - -o models")
        return stream.read()

    def _file(self, path: str, key: str, settings: CloudSettings = NO_SETTINGS) -> Item:
        """A cloud; unless there is a root, its key is this one, which has the ending yet."""
        folder, name = os.path.split(path)
        if name in ("", os.curdir, os.pardir):
            raise UsageError(f"there is no folder {shown(path)}", nearest(path) or "check the path")
        if self._root is not None:
            key = self._prefix(folder, path) + name
        stem = os.path.splitext(name)[0]
        config = settings.config
        if config is None and self._own_configs:
            beside = (os.path.join(folder, stem + ending) for ending in CONFIG_ENDINGS)
            config = next(filter(os.path.isfile, beside), None)
        return Item(opened(path), key.removesuffix(name) + stem, config, settings.overrides, settings.time)

    def _below(
        self, top: str, parts: Parts = (), settings: CloudSettings = NO_SETTINGS, *, named: bool = False
    ) -> Iterator[Item]:
        """The clouds in a folder and those below it; unless there is a root, their keys start with these parts.

        Raises:
            InputError: it was named itself, and cannot be listed.
        """
        for folder in self._search.walk(top):
            above = (*parts, *folder.below)
            inside = os.path.join(folder.path, "")
            if folder.error is not None:
                if not folder.below and (named or not parts):
                    reason = f"cannot be listed: {folder.error.strerror or folder.error}"
                    raise InputError(reason, "check its permissions", path=shown(top or os.curdir))
                yield self._file(folder.path, "/".join(above), settings)
            if not folder.clouds:
                continue
            if self._root is None:
                prefix = "".join(f"{part}/" for part in above)
            else:
                prefix = self._prefix(folder.path, inside + folder.clouds[0])
            for name in folder.clouds:
                stem = os.path.splitext(name)[0]
                config = settings.config
                if config is None and self._own_configs:
                    beside = (stem + ending for ending in CONFIG_ENDINGS)
                    config = next((inside + name for name in beside if name in folder.configs), None)
                yield Item(inside + name, prefix + stem, config, settings.overrides, settings.time)

    def _prefix(self, folder: str, cloud: str) -> str:
        """What keys of clouds in a folder start with, when there is a root."""
        assert self._root is not None
        if folder not in self._below_root:
            path = below(folder or os.curdir, self._root)
            if path is None:
                raise UsageError(f"{shown(cloud)} is not below --root {shown(self._root)}", "choose a folder higher up")
            self._below_root[folder] = f"{path}/" if path else ""
        return self._below_root[folder]
