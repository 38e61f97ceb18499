"""SRDF beside the URDF, for MoveIt: the group of all joints, its states `scanned` and `straight`, disabled collisions.

Segments of the same bend are joined through links without bodies, so that MoveIt would not know them as adjacent.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dlogen.io.registry import ModelFormat
from dlogen.io.xml_text import HEADER, element, start

if TYPE_CHECKING:
    from dlogen.multibody.model import MultibodyModel
    from dlogen.types import Array, FitData

#: Name of the planning group.
GROUP = "chain"


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.srdf`. Its model has the name that the URDF of the same stem has, as MoveIt wants it."""
    from dlogen.multibody.build import multibody

    return {f"{stem}.srdf": srdf(multibody(result, stem)).encode()}


def srdf(model: MultibodyModel) -> str:
    """The text of the file."""
    lines = [
        HEADER,
        start("robot", name=model.name),
        start("group", name=GROUP),
        "  " + element("chain", base_link=model.root, tip_link=model.tip),
        "</group>",
        *_state(model, "scanned", model.scanned),
        *_state(model, "straight", model.straight),
        *(
            element(
                "disable_collisions",
                link1=model.bodies[i].name,
                link2=model.bodies[j].name,
                reason="Adjacent" if j == i + 1 else "Never",
            )
            for i, j in model.close_pairs()
        ),
        "</robot>\n",
    ]
    return "\n".join(lines)


def _state(model: MultibodyModel, name: str, values: Array) -> list[str]:
    """The hinges' values; a floating base stays where its joint's origin has it."""
    pairs = zip(model.hinge_names, values.ravel(), strict=True)
    lines = [start("group_state", name=name, group=GROUP)]
    if model.floating:
        # Position and quaternion x y z w, as MoveIt orders the variables of a floating joint.
        lines.append("  " + element("joint", name="base_joint", value=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))
    return [*lines, *("  " + element("joint", name=hinge, value=value) for hinge, value in pairs), "</group_state>"]


FORMAT = ModelFormat(
    name="srdf",
    suffixes=(".srdf",),
    description="SRDF (MoveIt): group, states scanned and straight, disabled collisions; goes with the URDF",
    write=write,
)
