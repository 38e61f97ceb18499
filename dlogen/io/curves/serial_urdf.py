"""The shape of a serial chain in URDF: forward kinematics with all joints at zero."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from dlogen.errors import InputError
from dlogen.geometry.polyline import segment_lengths
from dlogen.geometry.poses import pose
from dlogen.geometry.rotations import from_roll_pitch_yaw
from dlogen.types import Array

#: Link frames nearer to one another than this are one joint: stacked revolutes, and what rounding leaves of them.
_SAME_PLACE = 1e-9


@dataclass(frozen=True, eq=False)
class _Joint:
    parent: str
    child: str
    moves: bool
    origin: Array  # (4, 4), parent from child at zero


def link_origins(data: bytes) -> Array:
    """Link origins of a serial chain from its root to its tip, all joints at zero.

    Frames before the first link that has a body (`base_link`) place the model and are not part of it. Link frames in
    one place (stacked revolutes) count once. The curve ends at the last link's origin: a model needs a frame there.
    Where several joints leave a link, the one behind which something moves is followed: frames that are fixed to a
    segment are passed over.

    Args:
        data: the content of the file.

    Returns:
        (K, 3) positions in the root's frame, metres, K >= 1.

    Raises:
        InputError: it is no URDF, or not one of a single serial chain.
    """
    robot = _xml(data)
    if robot.tag != "robot":
        raise InputError(f"this is XML with the root <{robot.tag}>; URDF has <robot>", "convert the model to URDF")
    body = {
        str(link.get("name")): any(link.find(part) is not None for part in ("inertial", "visual", "collision"))
        for link in robot.findall("link")
    }
    path = _serial_path([_joint(joint) for joint in robot.findall("joint")], list(body))
    frame, origins, names = np.eye(4), [np.zeros(3)], [path[0].parent if path else ""]
    for joint in path:
        frame = frame @ joint.origin
        origins.append(frame[:3, 3])
        names.append(joint.child)
    first = next((i for i, name in enumerate(names) if body.get(name)), 0)
    points = np.array(origins[first:])
    apart = segment_lengths(points) > _SAME_PLACE
    vertices: Array = points[np.concatenate([[True], apart])]
    return vertices


def _xml(data: bytes) -> ElementTree.Element:
    """The root element.

    Document types are refused: URDF has none, and entities declared there can fill the memory of a reader.
    """

    def refuse(*_: object) -> None:
        raise InputError("the XML declares a document type", "URDF has none: take <!DOCTYPE ...> out")

    checker = expat.ParserCreate()
    checker.StartDoctypeDeclHandler = refuse
    try:
        checker.Parse(data, True)
        return ElementTree.fromstring(data)
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"this is not valid XML: {error}", "the file may be cut off: write it again") from None


def _joint(joint: ElementTree.Element) -> _Joint:
    name = joint.get("name")
    ends = [element.get("link") if (element := joint.find(tag)) is not None else None for tag in ("parent", "child")]
    if ends[0] is None or ends[1] is None:
        raise InputError(f"the joint {name!r} does not name its parent and child links", "correct the URDF")
    origin = np.eye(4)
    place = joint.find("origin")
    if place is not None:
        xyz, rpy = (_three(place.get(key, "0 0 0"), name, key) for key in ("xyz", "rpy"))
        origin = pose(from_roll_pitch_yaw(*rpy), xyz)
    return _Joint(ends[0], ends[1], joint.get("type") != "fixed", origin)


def _three(text: str, joint: str | None, key: str) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise InputError(f"the origin of the joint {joint!r} has {key}={text!r}", "it takes three numbers")
    return values


def _serial_path(joints: list[_Joint], links: list[str]) -> list[_Joint]:
    """The joints of a tree from its root to its tip; refuses what is no tree, or branches."""
    below: dict[str, list[_Joint]] = {link: [] for link in links}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in below:
                raise InputError(f"a joint names the link {link!r}, which is not there", "correct the URDF")
        below[joint.parent].append(joint)
    children = [joint.child for joint in joints]
    roots = [link for link in links if link not in set(children)]
    if len(roots) != 1 or len(set(children)) != len(children):
        raise InputError(
            f"the links make no tree: {len(roots)} of {len(links)} have no parent, "
            f"{len(children) - len(set(children))} have several",
            "a serial chain has one root, and one parent for every other link",
        )
    # Joints in order from the root; parents before children, so that backwards every subtree is known.
    order: list[_Joint] = list(below[roots[0]])
    for joint in order:
        order.extend(below[joint.child])
    if len(order) != len(joints):
        raise InputError("the links make a ring", "a serial chain has one root, and one parent for every other link")
    leads_on: dict[str, bool] = {}
    for joint in reversed(order):
        leads_on[joint.child] = joint.moves or any(leads_on[other.child] for other in below[joint.child])

    path, link = [], roots[0]
    while below[link]:
        onward = below[link]
        if len(onward) > 1:
            onward = [joint for joint in onward if leads_on[joint.child]]
        if len(onward) != 1:
            branches = ", ".join(repr(joint.child) for joint in below[link])
            raise InputError(
                f"the model branches at the link {link!r} (to {branches}), so that it is no single curve",
                "give a model of one serial chain",
            )
        path.append(onward[0])
        link = onward[0].child
    return path
