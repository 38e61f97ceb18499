"""Geometry, tables and kinematics by hand: a second opinion for the tests that rows stay together.

Nothing here uses dlogen, so that a mistake there cannot hide itself. Metres and radians.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

Array = np.ndarray

# Polylines.


@dataclass(frozen=True)
class Feet:
    """The nearest places of a polyline for M points.

    Attributes:
        place: (M,) index of the vertex, with the share of the way to the next one.
        offset: (M, 3) from the polyline to the points.
        distance: (M,) the length of that.
        tangent: (M, 3) unit vectors along the piece.
    """

    place: Array
    offset: Array
    distance: Array
    tangent: Array

    @property
    def outward(self) -> Array:
        """(M, 3) unit vectors from the polyline to the points."""
        return self.offset / self.distance[:, None]


def feet(points: Array, line: Array) -> Feet:
    """The nearest places of a polyline with vertices close together: (M, 3), (K, 3)."""
    nearest = cKDTree(line).query(points)[1]
    found = [
        _feet_on(points, line, first) for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(line) - 2))
    ]
    nearer = found[1].distance < found[0].distance
    place, offset, distance, tangent = (
        np.where(nearer.reshape(-1, *[1] * (before.ndim - 1)), after, before)
        for before, after in zip(vars(found[0]).values(), vars(found[1]).values(), strict=True)
    )
    return Feet(place, offset, distance, tangent)


def _feet_on(points: Array, line: Array, piece: Array) -> Feet:
    """On one given piece for each point."""
    along = line[piece + 1] - line[piece]
    t = np.clip(((points - line[piece]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    offset = points - line[piece] - t[:, None] * along
    return Feet(piece + t, offset, np.linalg.norm(offset, axis=1), along / np.linalg.norm(along, axis=1)[:, None])


def to_segment(points: Array, start: Array, end: Array) -> Array:
    """(M,) distances to the segment from start to end."""
    along = end - start
    t = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - start - t[:, None] * along, axis=1)


def to_chain(points: Array, joints: Array) -> Array:
    """(M,) distances to the nearest of the segments between joints."""
    return np.min([to_segment(points, start, end) for start, end in pairwise(joints)], axis=0)


def arc_lengths(line: Array) -> Array:
    """(K,) from the first vertex on."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def at(places: Array, where: Array, line: Array) -> Array:
    """Points of a polyline whose vertices have the increasing coordinates `where`: (C,), (K,), (K, 3) -> (C, 3)."""
    return np.stack([np.interp(places, where, column) for column in line.T], axis=1)


def evenly(line: Array, count: int) -> Array:
    """(count, 3) points of a polyline, even in arc length."""
    along = arc_lengths(line)
    return at(np.linspace(0.0, along[-1], count), along, line)


def nearest(points: Array, others: Array) -> tuple[Array, Array]:
    """(M,) distances to the nearest of others, and their indices."""
    distance, index = cKDTree(others).query(points)
    return distance, index


def same_rows(a: Array, b: Array, tolerance: float) -> bool:
    """Whether two tables hold the same rows, each as often, in whatever order."""
    if a.shape != b.shape:
        return False
    distance, index = nearest(b, a)
    return bool(distance.max(initial=0.0) <= tolerance) and len(np.unique(index)) == len(a)


# Tables.


def read_dump(path: Path) -> dict[str, Array]:
    """The columns of a binary little-endian PLY file of plain numbers."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in head.decode().splitlines()]
    (count,) = [int(word[2]) for word in words if word[0] == "element"]
    kinds = {"double": "<f8", "float": "<f4", "uchar": "u1"}
    rows = np.frombuffer(body, dtype=[(word[2], kinds[word[1]]) for word in words if word[0] == "property"])
    assert len(rows) == count
    return {name: rows[name] for name in rows.dtype.names}


def read_csv(path: Path) -> list[dict[str, str]]:
    """The rows of a table, by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def columns(path: Path) -> dict[str, Array]:
    """The columns of a table of numbers."""
    rows = read_csv(path)
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def vectors(table: Mapping[str, Array], prefix: str = "", suffix: str = "") -> Array:
    """(M, 3) of three columns: x, y, z with something before or after."""
    return np.stack([table[f"{prefix}{axis}{suffix}"] for axis in "xyz"], axis=1)


# Models.


@dataclass(frozen=True)
class Step:
    """From a frame to the next one: a fixed pose, then hinges about axes of which each turns with those before it.

    Attributes:
        child: name of the next frame.
        origin: (4, 4) pose of the next frame at joint values of zero.
        hinges: names and axes.
    """

    child: str
    origin: Array
    hinges: tuple[tuple[str, Array], ...] = ()


@dataclass(frozen=True)
class Model:
    """A serial chain as a file has it.

    Attributes:
        steps: from the root to the tip.
        masses: of the segments by name, kg.
        lengths: of the segments by name, metres.
        limits: lower and upper value of the hinges by name.
    """

    steps: tuple[Step, ...]
    masses: dict[str, float] = field(default_factory=dict)
    lengths: dict[str, float] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)

    def joints(self, values: Mapping[str, float], base: Array | None = None) -> Array:
        """(n + 1, 3) origins of the segments, in order, and of the tip.

        Args:
            values: of the hinges by name, radians; zero for others.
            base: (4, 4) pose of the first segment, in place of the model's own.
        """
        pose, out = np.eye(4), []
        for k, step in enumerate(self.steps):
            pose = pose @ step.origin if k or base is None else base
            for name, axis in step.hinges:
                pose = pose @ homogeneous(Rotation.from_rotvec(values.get(name, 0.0) * axis).as_matrix())
            if step.child.startswith("segment") or step.child == "tip":
                out.append(pose[:3, 3])
        return np.array(out)

    @property
    def hinges(self) -> list[str]:
        """Names of all hinges in order."""
        return [name for step in self.steps for name, _ in step.hinges]


def homogeneous(rotation: Array, position: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Array:
    """(4, 4) of a rotation and a position."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def from_quaternion(wxyz: Sequence[float] | Array) -> Array:
    """(3, 3) of a unit quaternion, the real part first."""
    return Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()


def _from_angles(numbers: Sequence[float]) -> Array:
    """(4, 4) of x y z and roll, pitch, yaw about fixed axes: URDF and SDFormat."""
    return homogeneous(Rotation.from_euler("xyz", numbers[3:]).as_matrix(), numbers[:3])


def _numbers(text: str | None) -> list[float]:
    return [float(word) for word in (text or "0 0 0").split()]


def _found(element: ElementTree.Element, path: str) -> ElementTree.Element:
    found = element.find(path)
    assert found is not None, path
    return found


def read_urdf(path: Path) -> Model:
    """The chain of a URDF file."""
    robot = ElementTree.parse(path).getroot()
    steps, parents, limits = {}, {}, {}
    for joint in robot.findall("joint"):
        origin, name = _found(joint, "origin"), joint.attrib["name"]
        child, parents_name = _found(joint, "child").attrib["link"], _found(joint, "parent").attrib["link"]
        hinges: tuple[tuple[str, Array], ...] = ()
        if joint.get("type") == "revolute":
            hinges = ((name, np.array(_numbers(_found(joint, "axis").get("xyz")))),)
            limit = _found(joint, "limit")
            limits[name] = float(limit.attrib["lower"]), float(limit.attrib["upper"])
        pose = _from_angles(_numbers(origin.get("xyz")) + _numbers(origin.get("rpy")))
        steps[parents_name], parents[child] = Step(child, pose, hinges), parents_name
    (name,) = steps.keys() - parents.keys()
    chain = []
    while name in steps:
        chain.append(steps[name])
        name = steps[name].child
    bodies = {link.attrib["name"]: link for link in robot.findall("link") if link.find("visual") is not None}
    return Model(
        tuple(chain),
        {name: float(_found(link, "inertial/mass").attrib["value"]) for name, link in bodies.items()},
        {name: float(_found(link, "visual/geometry/cylinder").attrib["length"]) for name, link in bodies.items()},
        limits,
    )


def read_sdf(path: Path) -> Model:
    """The chain of an SDFormat file."""
    model = _found(ElementTree.parse(path).getroot(), "model")
    links = {link.attrib["name"]: link for link in model.findall("link")}
    first = next(iter(links.values()))
    steps = [Step(first.attrib["name"], _from_angles(_numbers(_found(first, "pose").text)))]
    for joint in model.findall("joint"):
        if joint.get("type") == "fixed":
            continue
        name, child = joint.attrib["name"], _found(joint, "child").text or ""
        assert _found(joint, "pose").attrib["relative_to"] == _found(joint, "parent").text == steps[-1].child
        assert _found(links[child], "pose").attrib["relative_to"] == name
        axes = [
            np.array(_numbers(_found(joint, f"{tag}/xyz").text))
            for tag in ("axis", "axis2")
            if joint.find(tag) is not None
        ]
        hinges = tuple((f"{name}_{'xyz'[int(np.argmax(axis))]}", axis) for axis in axes)
        steps.append(Step(child, _from_angles(_numbers(_found(joint, "pose").text)), hinges))
    (tip,) = [frame for frame in model.findall("frame") if frame.get("attached_to") == steps[-1].child]
    steps.append(Step(tip.attrib["name"], _from_angles(_numbers(_found(tip, "pose").text))))
    return Model(
        tuple(steps),
        {name: float(_found(link, "inertial/mass").text or "") for name, link in links.items()},
        {name: float(_found(link, "visual/geometry/cylinder/length").text or "") for name, link in links.items()},
    )


def read_mjcf(path: Path) -> tuple[Model, dict[str, tuple[float | None, Array]]]:
    """The chain of an MJCF file, and time and numbers of its keyframes by their names."""
    root = ElementTree.parse(path).getroot()
    steps, masses = [], {}

    def walk(body: ElementTree.Element) -> Iterator[ElementTree.Element]:
        yield body
        for inner in body.findall("body"):
            yield from walk(inner)

    bodies = list(walk(_found(root, "worldbody/body")))
    for body in bodies:
        pose = homogeneous(from_quaternion(_numbers(body.attrib["quat"])), _numbers(body.attrib["pos"]))
        hinges = tuple(
            (joint.attrib["name"], np.array(_numbers(joint.attrib["axis"]))) for joint in body.findall("joint")
        )
        steps.append(Step(body.attrib["name"], pose, hinges))
        masses[body.attrib["name"]] = float(_found(body, "inertial").attrib["mass"])
    site = _found(bodies[-1], "site")
    steps.append(Step(site.attrib["name"], homogeneous(np.eye(3), _numbers(site.attrib["pos"]))))
    keys = {}
    for key in root.findall("keyframe/key"):
        time = float(key.attrib["time"]) if "time" in key.attrib else None
        keys[key.attrib["name"]] = time, np.array(_numbers(key.attrib["qpos"]))
    return Model(tuple(steps), masses), keys


def read_srdf(path: Path) -> dict[str, dict[str, float]]:
    """The values of the hinges by the states of an SRDF file."""
    return {
        state.attrib["name"]: {
            joint.attrib["name"]: float(joint.attrib["value"])
            for joint in state.findall("joint")
            if joint.attrib["name"] != "base_joint"
        }
        for state in ElementTree.parse(path).getroot().findall("group_state")
    }


def of_json(data: Mapping[str, Any], links: Sequence[Mapping[str, Any]]) -> Model:
    """The chain of the key `model` in a JSON file, with the file's `links` for masses and lengths."""
    axes = dict(zip("xyz", np.eye(3), strict=True))
    steps = [Step(links[0]["name"], np.array(data["base_transform"]))]
    limits = {}
    for joint in data["joints"]:
        assert joint["parent"] == steps[-1].child
        hinges = tuple((name, axes[axis]) for name, axis in zip(joint["hinges"], joint["axes"], strict=True))
        steps.append(Step(joint["child"], np.array(joint["origin"]), hinges))
        limits |= dict(zip(joint["hinges"], zip(joint["lower"], joint["upper"], strict=True), strict=True))
    steps.append(Step(data["tip"], homogeneous(np.eye(3), (links[-1]["length"], 0.0, 0.0))))
    return Model(
        tuple(steps),
        {link["name"]: link["mass"] for link in links},
        {link["name"]: link["length"] for link in links},
        limits,
    )
