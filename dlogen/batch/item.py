"""One cloud of a batch."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Item:
    """One cloud of a batch.

    Attributes:
        cloud: path of the cloud as it is opened. A folder that cannot be listed is one as well: it fails when it is
            read, so that the clouds in it are not lost in silence.
        key: where its results go below the output folder, without an ending and with "/" between folders: those of
            "a/x" are a/x.urdf and so on. Different for every item, never absolute, without "..".
        config: YAML file of its own: that of the column `config`, or the one beside the cloud.
        overrides: "KEY=VALUE" from the columns of a CSV list.
        time: column `time` of a CSV list, seconds.
    """

    cloud: str
    key: str
    config: str | None = None
    overrides: tuple[str, ...] = ()
    time: float | None = None
