"""Writing files so that no reader ever sees half of one."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from dlogen.errors import OutputError, UsageError

#: What the next file would meet as well.
_NOTHING_CAN_BE_WRITTEN = {
    getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EROFS", "EIO", "ESTALE") if hasattr(errno, name)
}


def temporary_prefix(process: int | None = None) -> str:
    """What the names of temporary files start with that a process makes; of all processes if it is None."""
    return ".dlogen-" if process is None else f".dlogen-{process}-"


def refuse_existing(paths: list[Path], force: bool) -> None:
    """Refuse to overwrite.

    Raises:
        UsageError: a path exists and `force` is not set.
    """
    # lexists: a link that leads nowhere would be replaced as well.
    existing = [path for path in paths if os.path.lexists(path)]
    if existing and not force:
        more = f" and {len(existing) - 1} more" if len(existing) > 1 else ""
        raise UsageError(f"output exists: {existing[0]}{more}", "use --force to overwrite, or -o for another folder")


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Write all files or none: each to a temporary name beside its place first, then renamed.

    Folders are made as needed, and removed again when a file cannot be written.

    Raises:
        UsageError: the place cannot be written (`OutputError`), or is a folder.
    """
    write_with({path: _bytes_writer(data) for path, data in contents.items()})


def write_with(writers: Mapping[Path, Callable[[Path], None]]) -> None:
    """As `write_all`, for writers that want a path to write to. The temporary name keeps the file's ending.

    Raises:
        UsageError: the place cannot be written (`OutputError`), or is a folder.
    """
    staged: list[tuple[Path, Path]] = []
    made: list[Path] = []
    target = Path()
    try:
        for target in writers:
            # Found out now: when renaming it is too late, files before this one would have been written.
            if target.is_dir():
                raise UsageError("it is a folder", "choose another folder with -o, or rename it", path=target)
        for target, writer in writers.items():
            temporary = _temporary(target, made)
            staged.append((temporary, target))
            writer(temporary)
            # mkstemp makes private files; give outputs the mode that an ordinary open() would.
            temporary.chmod(0o666 & ~_umask())
        while staged:
            temporary, target = staged[0]
            temporary.replace(target)
            staged.pop(0)
        made.clear()
    except OSError as error:
        hint = "choose another folder with -o, or check its permissions and free space"
        if error.errno == errno.ENAMETOOLONG:
            hint = "give the input a shorter name: those of the outputs are longer by their endings"
        raise OutputError(
            f"cannot write: {error.strerror or error}",
            hint,
            path=target,
            for_all=error.errno in _NOTHING_CAN_BE_WRITTEN,
        ) from error
    finally:
        for temporary, _ in staged:
            temporary.unlink(missing_ok=True)
        for folder in reversed(made):
            with contextlib.suppress(OSError):  # somebody else has put something there meanwhile
                folder.rmdir()


def _temporary(target: Path, made: list[Path]) -> Path:
    """Make an empty file beside the target; folders that had to be made for it are added to the list."""
    for attempts_left in (2, 1, 0):
        try:
            made += _make_folder(target.parent)
            handle, name = tempfile.mkstemp(
                prefix=temporary_prefix(os.getpid()), suffix=target.suffix, dir=target.parent
            )
        except FileNotFoundError:
            # Another process that could not write there has just removed the folder, which it had made.
            if not attempts_left:
                raise
        else:
            os.close(handle)
            return Path(name)
    raise AssertionError


def _make_folder(folder: Path) -> list[Path]:
    """Make a folder and those above it that are missing; returns the ones made, the highest first."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()][::-1]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _bytes_writer(data: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_bytes(data)

    return write


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
