"""The results of one cloud of a batch as files: written all or none, found again, tidied up after."""

from __future__ import annotations

import contextlib
from pathlib import Path

from dlogen.io.outputs import Outputs


def write_files(folder: str, key: str, files: dict[str, bytes]) -> None:
    """Write the results of a cloud, all or none.

    Raises:
        OutputError: they cannot be written.
    """
    from dlogen.io.atomic import write_all

    place = Path(folder, *key.split("/")[:-1])
    write_all({place / name: data for name, data in files.items()})


def paths_of(folder: str | Path, key: str, outputs: Outputs) -> list[Path]:
    """The results of a cloud."""
    above, _, stem = key.rpartition("/")
    return [Path(folder, above, name) for name in outputs.files(stem)]


def remove_temporaries(folder: str | Path, key: str, outputs: Outputs, process: int | None = None) -> None:
    """Remove what processes that were killed have left beside the results of a cloud.

    Args:
        folder: of the batch.
        key: of the cloud.
        outputs: that it was to have.
        process: number of the process; None for all of them.
    """
    from dlogen.io.atomic import temporary_prefix

    for place in {path.parent for path in paths_of(folder, key, outputs)}:
        for path in place.glob(f"{temporary_prefix(process)}*"):
            with contextlib.suppress(OSError):
                path.unlink()
