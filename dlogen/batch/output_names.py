"""Where the results of the clouds of a batch go, so that none overwrites another, nor a cloud."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dlogen.batch import store, summary
from dlogen.batch.paths import below, shown
from dlogen.errors import UsageError

if TYPE_CHECKING:
    from dlogen.batch.item import Item

#: stem -> names of the files that are written for it.
FileNames = Callable[[str], tuple[str, ...]]

#: What a batch itself writes at the top of its output folder; sqlite has files beside a database while it is in use.
OWN_FILES = frozenset(
    {summary.CSV_NAME, summary.JSON_NAME}
    | {name + more for name in (store.NAME, store.LOCK) for more in ("", "-wal", "-shm", "-journal")}
)


def without_repeats(items: list[Item]) -> list[Item]:
    """The first of those that are the same file and have the same key.

    Raises:
        UsageError: a later one has settings of its own, which would be lost.
    """
    keys: set[str] = set()
    repeated: set[str] = set()
    for item in items:
        (repeated if item.key in keys else keys).add(item.key)
    if not repeated:
        return items
    kept: list[Item] = []
    first: dict[tuple[str, str], Item] = {}
    for item in items:
        if item.key in repeated:
            earlier = first.setdefault((item.key, os.path.realpath(item.cloud)), item)
            if earlier is not item:
                if _has_settings(item) and _settings(item) != _settings(earlier):
                    raise UsageError(
                        f"{shown(item.cloud)} is there twice, with different settings",
                        "run a batch for each, with different -o",
                    )
                continue
        kept.append(item)
    return kept


def _has_settings(item: Item) -> bool:
    """Whether a list says something of the cloud: any but the YAML file beside it."""
    config = None if item.config is None else os.path.splitext(item.config)[0]
    return bool(item.overrides) or item.time is not None or config not in (None, os.path.splitext(item.cloud)[0])


def _settings(item: Item) -> tuple[object, ...]:
    return item.overrides, item.time, item.config and os.path.realpath(item.config)


def with_unique_keys(items: Sequence[Item], outputs: FileNames) -> list[Item]:
    """The items, with the ending kept in the keys of those whose files would collide.

    Raises:
        UsageError: they collide nevertheless.
    """
    settled = list(items)
    whole: set[int] = set()
    while longer := _in_need_of_ending(settled, outputs, whole):
        for i in longer:
            settled[i] = replace(settled[i], key=settled[i].key + _ending(settled[i]))
        whole |= longer
    return settled


def _in_need_of_ending(items: Sequence[Item], outputs: FileNames, whole: set[int]) -> set[int]:
    """Indices of items whose files would collide with something; those in `whole` have their endings already.

    Files collide also where one would have to be a folder: x.json of x.ply with the folder x.json of x.json/y.ply.

    Raises:
        UsageError: none of those that collide can be given its ending.
    """
    members: dict[str, list[int]] = {}
    for i, item in enumerate(items):
        members.setdefault(os.path.normcase(item.key.rpartition("/")[0]), []).append(i)
    # Every folder below the top, with one of the items in it.
    folders: dict[str, int] = {}
    for path, inside in members.items():
        while path and path not in folders:
            folders[path] = inside[0]
            path = path.rpartition("/")[0]
    for name in OWN_FILES & folders.keys():
        raise _own_collision(items[folders[name]])

    needing: set[int] = set()

    def lengthen(*collided: int) -> bool:
        longer = {i for i in collided if i not in whole and _ending(items[i])}
        needing.update(longer)
        return bool(longer)

    for path, inside in members.items():
        owners: dict[str, int] = {}
        for i in inside:
            stem = items[i].key.rpartition("/")[2]
            # Of a folder its name.
            for name in {os.path.normcase(name.partition("/")[0]) for name in outputs(stem)}:
                file = f"{path}/{name}" if path else name
                if file.casefold() in OWN_FILES and not lengthen(i):
                    raise _own_collision(items[i])
                if (other := owners.setdefault(name, i)) != i and not lengthen(i, other):
                    raise _collision(items, i, other, file)
                if file in folders and not lengthen(i):
                    raise _collision(items, i, folders[file], file)
    return needing


def _ending(item: Item) -> str:
    return os.path.splitext(item.cloud)[1]


def _own_collision(item: Item) -> UsageError:
    return UsageError(
        f"the results of {shown(item.cloud)} would overwrite the batch's own files",
        "rename it, or lay out the results as below a folder higher up with --root",
    )


def _collision(items: Sequence[Item], i: int, other: int, name: str) -> UsageError:
    hint = "rename one of them, or run a batch for each with different -o"
    if items[i].key == items[other].key:
        folders = {os.path.abspath(os.path.dirname(item.cloud)) for item in items}
        with contextlib.suppress(ValueError):  # on different drives
            common = shown(os.path.commonpath(folders))
            hint = f"use --root {common}: results are laid out as the clouds are below that folder"
    clouds = f"{shown(items[other].cloud)} and {shown(items[i].cloud)}"
    return UsageError(f"{clouds} would both write {shown(name)}", hint)


def overwritten(items: Sequence[Item], out: str, outputs: FileNames) -> set[int]:
    """Indices of items whose clouds lie where the results of one of them go."""
    target = os.path.realpath(out)
    inside: dict[str, str | None] = {}
    places: dict[str, int] = {}
    for i, item in enumerate(items):
        folder, name = os.path.split(item.cloud)
        if folder not in inside:
            inside[folder] = below(os.path.realpath(folder), target)
        if (path := inside[folder]) is not None:
            places[f"{path}/{name}" if path else name] = i
    if not places:
        return set()
    found: set[int] = set()
    for item in items:
        folder, slash, stem = item.key.rpartition("/")
        found.update(places[path] for name in outputs(stem) if (path := f"{folder}{slash}{name}") in places)
    return found
