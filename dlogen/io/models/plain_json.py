"""The chain in as few keys as possible, for programs that want polylines and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dlogen.io.json_text import dump_json
from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.types import FitData

SCHEMA = "dlogen.plain/1"


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.plain.json`: joints in order, lengths of the segments between them, radius; metres."""
    chain = result.chain
    data = {
        "schema": SCHEMA,
        "name": stem,
        "frame": result.frame.name,
        "radius": chain.radius,
        "joints": chain.joints.tolist(),
        "lengths": chain.lengths.tolist(),
    }
    return {f"{stem}.plain.json": dump_json(data).encode()}


FORMAT = ModelFormat(
    name="json-plain",
    suffixes=(".plain.json",),
    description="JSON with the joints, the lengths of the segments and the radius only",
    write=write,
)
