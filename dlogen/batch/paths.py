"""Paths as texts: what they are, how messages show them, and where results go for them.

There may be a million of them, and `Path` objects take twenty times as long to make.
"""

from __future__ import annotations

import os
from itertools import islice

# With more entries, looking for the nearest name would take longer than finding the mistake.
_MOST_NAMES = 5000


def shown(path: str) -> str:
    """A path as messages have it: with escapes where it would garble them."""
    return path if path.isprintable() else repr(path)


def as_unicode(path: str) -> str:
    """A path as the records have it: names need not be Unicode, the records are."""
    return path if path.isascii() else path.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def nearest(path: str) -> str:
    """A hint at the name that is most like the first part of the path that does not exist, or nothing."""
    import difflib

    missing = os.path.normpath(path)
    while (parent := os.path.dirname(missing)) != missing and not os.path.lexists(parent or os.curdir):
        missing = parent
    try:
        with os.scandir(parent or os.curdir) as entries:
            names = [entry.name for entry in islice(entries, _MOST_NAMES + 1)]
    except OSError:
        return ""
    near = difflib.get_close_matches(os.path.basename(missing), sorted(names), n=1) if len(names) <= _MOST_NAMES else []
    return f"did you mean {shown(os.path.join(parent, near[0]))}?" if near else ""


def opened(path: str) -> str:
    """A path that readers do not take for stdin."""
    return os.path.join(os.curdir, path) if path == "-" else path


def identity(folder: str) -> tuple[int, int] | None:
    """Device and inode, which tell that two paths lead to one folder; None if it cannot be told."""
    try:
        status = os.stat(folder)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def key_as_named(path: str) -> str:
    """Where the results of a named cloud go: as it is named if that is below the current folder, else its name only."""
    normal = os.path.normpath(path)
    if os.path.isabs(normal) or os.path.splitdrive(normal)[0] or _leaves(normal):
        return os.path.basename(normal)
    return normal.replace(os.sep, "/")


def below(folder: str, root: str) -> str | None:
    """Path of a folder below another one, with "/" between parts and "" for itself; None if it is not below."""
    for absolute in (os.path.abspath, os.path.realpath):
        try:
            relative = os.path.relpath(absolute(folder), absolute(root))
        except ValueError:  # on another drive
            continue
        if not _leaves(relative):
            return "" if relative == os.curdir else relative.replace(os.sep, "/")
    return None


def _leaves(normal: str) -> bool:
    return normal == os.pardir or normal.startswith(os.pardir + os.sep)
