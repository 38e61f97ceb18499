"""File formats. Each is one module of `dlogen.io.clouds` or `dlogen.io.models` that defines `FORMAT`.

Adding a file there adds a format.

A module whose formats differ in little more than their names defines `FORMATS` instead, a tuple of them.

A `CloudFormat` reads and writes point clouds, a `ModelFormat` writes what a fit made. Modules are imported to
look at these only, so they import their heavy libraries inside their functions.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from dlogen.errors import UsageError
from dlogen.io import clouds, models

if TYPE_CHECKING:
    from dlogen.types import FitData, RawCloud


@dataclass(frozen=True)
class CloudFormat:
    """A point cloud format.

    Attributes:
        name: what the user calls it ("ply").
        suffixes: file name endings, with the dot.
        description: one line for `dlogen formats`.
        sniff: whether these first bytes of a file (up to 4096) are of this format.
        read: path -> cloud; raises `InputError`.
        write: (path, cloud, encoding) -> None; encodings as listed, the first is the default.
        encodings: what `write` can make.
    """

    name: str
    suffixes: tuple[str, ...]
    description: str
    sniff: Callable[[bytes], bool]
    read: Callable[[Path], RawCloud]
    write: Callable[[Path, RawCloud, str], None]
    encodings: tuple[str, ...]


@dataclass(frozen=True)
class ModelFormat:
    """A format for what a fit made.

    Attributes:
        name: what the user calls it ("urdf").
        suffixes: endings of the files that it writes; one that ends with a slash is a folder.
        description: one line for `dlogen formats`.
        write: (result, stem of the file names) -> {file name: content}. Names may have folders before them.
        named: stem -> names of the files that it writes, where they are not the stem with the suffixes.
    """

    name: str
    suffixes: tuple[str, ...]
    description: str
    write: Callable[[FitData, str], dict[str, bytes]]
    named: Callable[[str], tuple[str, ...]] | None = None

    def files(self, stem: str) -> tuple[str, ...]:
        """Names of the files that `write` makes, known before there is anything to write."""
        return tuple(f"{stem}{suffix}" for suffix in self.suffixes) if self.named is None else self.named(stem)


@cache
def registered() -> tuple[CloudFormat | ModelFormat, ...]:
    """All formats, in the order of their names."""
    return tuple(sorted((*cloud_formats(), *model_formats()), key=lambda item: item.name))


@cache
def cloud_formats() -> tuple[CloudFormat, ...]:
    """The formats that clouds can be read from and written to, in the order of their names."""
    return tuple(sorted(_all_in(clouds), key=lambda item: item.name))


@cache
def model_formats() -> tuple[ModelFormat, ...]:
    """The formats that models can be written to, in the order of their names."""
    return tuple(sorted(_all_in(models), key=lambda item: item.name))


@cache
def model_format(name: str) -> ModelFormat:
    """The model format of that name. No more modules are imported than it takes to find it.

    Raises:
        UsageError: there is none.
    """
    names = _modules_of(models)
    # Most formats are called as their module is.
    for module in sorted(names, key=lambda own: own != name):
        for item in _formats_of(models, module):
            if isinstance(item, ModelFormat) and item.name == name:
                return item
    import difflib

    known = [item.name for item in model_formats()]
    near = difflib.get_close_matches(name, known, n=1)
    raise UsageError(
        f"unknown model format {name!r}", f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
    )


def _all_in(room: ModuleType) -> Iterator[Any]:
    for module in _modules_of(room):
        yield from _formats_of(room, module)


def _modules_of(room: ModuleType) -> list[str]:
    return sorted(info.name for info in pkgutil.iter_modules(room.__path__))


def _formats_of(room: ModuleType, module: str) -> tuple[Any, ...]:
    imported = importlib.import_module(f"{room.__name__}.{module}")
    return (imported.FORMAT,) if hasattr(imported, "FORMAT") else tuple(getattr(imported, "FORMATS", ()))
