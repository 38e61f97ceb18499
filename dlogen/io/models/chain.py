"""The kinematic chain as JSON, schema `dlogen.chain/1`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dlogen.io.json_text import dump_json
from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.types import FitData


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.json`."""
    from dlogen.io.report import chain_dict

    return {f"{stem}.json": dump_json(chain_dict(result)).encode()}


FORMAT = ModelFormat(
    name="json",
    suffixes=(".json",),
    description="JSON kinematic chain dlogen.chain/1: skeleton line, joints, links, quality",
    write=write,
)
