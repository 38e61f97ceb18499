"""The order of a few points that are beads on a string."""

from __future__ import annotations

import numpy as np

from dlogen.geometry.polyline import segment_lengths
from dlogen.types import Array


def string_beads(points: Array) -> Array:
    """Order points that are beads on a string, too few to see its width: (M, 3) -> (K, 3).

    The shortest links are taken first, two for each point at most and none that closes a ring. Beads at the ends that
    are far from all others are left out.
    """
    count = len(points)
    distance = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
    links: list[tuple[int, int]] = []
    degree, group = np.zeros(count, dtype=int), np.arange(count)
    for flat in np.argsort(distance, axis=None, kind="stable"):
        i, j = divmod(int(flat), count)
        if degree[i] < 2 and degree[j] < 2 and group[i] != group[j]:
            links.append((i, j))
            degree[[i, j]] += 1
            group[group == group[j]] = group[i]
    neighbours: dict[int, list[int]] = {i: [] for i in range(count)}
    for i, j in links:
        neighbours[i].append(j)
        neighbours[j].append(i)
    order = [int(np.flatnonzero(degree == 1)[0])]
    while len(order) < count:
        order.append(next(i for i in neighbours[order[-1]] if i not in order[-2:-1]))
    string = points[order]
    steps = segment_lengths(string)
    while len(string) > 4 and max(steps[0], steps[-1]) > 3.0 * np.median(steps):
        string, steps = (string[1:], steps[1:]) if steps[0] > steps[-1] else (string[:-1], steps[:-1])
    return string
