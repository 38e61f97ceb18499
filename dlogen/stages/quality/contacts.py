"""Where an object comes within touch of itself, and whether its strands were told apart there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dlogen.geometry.polyline import arc_lengths
from dlogen.stages.quality.findings import BRANCH, CROSSING, SIDE_BY_SIDE
from dlogen.types import Array, Finding, IntArray
from dlogen.types.texts import millimetres

#: Axes that come nearer to each other than this, in radii, are in contact: those of tubes that touch are two apart.
_TOUCH = 2.7
#: Places of the line nearer to each other along it than this, in radii, are the same strand.
_SAME_STRAND = 7.0
#: Strands whose axes come nearer to each other than the one, in radii, are one strand; nearer than the other, and they
#: run through each other, which the noise may have done.
_MERGED, _OVERLAP = 1.0, 1.5
#: Strands that touch for longer than this, in radii, run side by side.
_SIDE_BY_SIDE = 10.0
#: Contacts of two lines that are nearer to each other than this, in radii, are the same one.
_SAME_PLACE = 4.0


@dataclass(frozen=True)
class Contact:
    """Two stretches of a line that come near each other.

    Attributes:
        s: middle of the first one, arc length over length.
        position: the middle between the two, metres.
        run: length of the first one, metres.
        distance: the smallest between the two, metres.
    """

    s: float
    position: tuple[float, float, float]
    run: float
    distance: float


def find_contacts(line: Array, radius: float) -> list[Contact]:
    """Where a line comes within touch of itself.

    Args:
        line: (K, 3) vertices about a radius apart, metres.
        radius: of the tube around it, metres.
    """
    s = arc_lengths(line)
    pairs = cKDTree(line).query_pairs(_TOUCH * radius, output_type="ndarray")
    pairs = pairs[np.abs(s[pairs[:, 1]] - s[pairs[:, 0]]) > _SAME_STRAND * radius]
    if len(pairs) == 0:
        return []
    pairs = np.sort(pairs, axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    contacts = []
    for group in np.split(pairs, np.flatnonzero(np.diff(pairs[:, 0]) > 3) + 1):
        x, y, z = (0.5 * (line[group[:, 0]] + line[group[:, 1]])).mean(axis=0).tolist()
        contacts.append(
            Contact(
                s=float(s[group[:, 0]].mean() / s[-1]),
                position=(x, y, z),
                run=float(s[group[:, 0].max()] - s[group[:, 0].min()]),
                distance=_smallest_distance(line, group),
            )
        )
    return contacts


def _smallest_distance(line: Array, pairs: IntArray) -> float:
    """Between the pieces of a line around pairs of its vertices: (K, 3), (P, 2)."""
    places = np.clip(pairs[:, :, None] + np.linspace(-1.0, 1.0, 17), 0.0, len(line) - 1.0)
    vertex = np.minimum(places.astype(np.intp), len(line) - 2)
    points = line[vertex] + (places - vertex)[..., None] * (line[vertex + 1] - line[vertex])
    squared = ((points[:, 0, :, None] - points[:, 1, None, :]) ** 2).sum(axis=3)
    return float(np.sqrt(squared.min()))


def check_contacts(line: Array, backbone: Array, radius: float) -> list[Finding]:
    """Findings about the places where the object crosses, touches or runs beside itself.

    The fitted line tells whether strands were told apart. Where only it does, since the rough line has them in one
    place, they may have been taken for each other.

    Args:
        line: (K, 3) vertices of the fitted line about a radius apart, metres.
        backbone: (L, 3) vertices of the rough line that it was made from, likewise.
        radius: of the object, metres.
    """
    contacts = find_contacts(line, radius)
    unsure = [contact for contact in find_contacts(backbone, radius) if contact.distance < _MERGED * radius]
    findings = []
    for contact in contacts:
        mixed = [rough for rough in unsure if _same(contact, rough, radius)]
        unsure = [rough for rough in unsure if rough not in mixed]
        at, place = contact.s, contact.position
        if contact.distance < _MERGED * radius:
            message = "strands run into one another: the object branches here, or is badly resolved"
            findings.append(BRANCH.found(message, s=at, position=place))
        elif contact.run > _SIDE_BY_SIDE * radius:
            message = f"two strands run side by side for {millimetres(contact.run)}: they may have been mixed up"
            findings.append(SIDE_BY_SIDE.found(message, s=at, position=place))
        elif mixed or contact.distance < _OVERLAP * radius:
            findings.append(CROSSING.found(_MIXED_UP, "doubtful", s=at, position=place))
        else:
            message = "the object crosses or touches itself"
            findings.append(CROSSING.found(message, "note", s=at, position=place))
    findings += [CROSSING.found(_MIXED_UP, "doubtful", s=rough.s, position=rough.position) for rough in unsure]
    return findings


_MIXED_UP = "strands lie so close together here that they may have been mixed up"


def _same(one: Contact, other: Contact, radius: float) -> bool:
    """Whether two contacts, of two lines, are in the same place."""
    apart = float(np.linalg.norm(np.subtract(one.position, other.position)))
    return apart < _SAME_PLACE * radius + 0.5 * (one.run + other.run)
