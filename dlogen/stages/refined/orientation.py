"""The outward side of surface normals, which a plane fit leaves open.

Points of a tube that was seen from all sides have their neighbours' centroid inside it. Where only a narrow arc of the
circumference was seen, that centroid is as near to the surface as the noise is, and the side of each single normal is
chance. Neighbours then help each other: normals that are nearly parallel have the same side (Hoppe et al., "Surface
reconstruction from unorganized points", SIGGRAPH 1992), and all those of a piece of surface together say which.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from dlogen.geometry.vectors import dots
from dlogen.types import Array, IntArray

#: What an edge costs beyond the angle between its normals: no edge may cost nothing, for it would be none.
_LEAST = 1e-6


def alike(positions: Array, normals: Array, outward: Array, pairs: IntArray) -> Array:
    """Signs that give neighbouring normals the same side, and each connected piece of surface the likelier one.

    Args:
        positions: (M, 3) metres.
        normals: (M, 3) unit normals of any sign.
        outward: (M, 3) from the centroid of the surroundings to each point, metres: outward where it is not noise.
        pairs: (2, P) neighbours, each pair once.

    Returns:
        (M,) 1 or -1.
    """
    count = len(positions)
    i, j = pairs
    cosine = dots(normals[i], normals[j])
    # The two walls of a thin tube are near each other, with normals that are parallel or nearly so: what is between
    # them is along the normals, and beside them on one wall.
    apart = positions[i] - positions[j]
    length = np.sqrt(np.maximum(dots(apart, apart), 1e-300))
    steep = np.maximum(np.abs(dots(apart, normals[i])), np.abs(dots(apart, normals[j]))) / length
    cost = 1.0 + _LEAST - np.abs(cosine) + steep**2
    tree = minimum_spanning_tree(coo_matrix((cost, (i, j)), shape=(count, count)).tocsr())
    sign = np.ones(count)
    pieces, piece = connected_components(tree, directed=False)
    first = np.full(pieces, count)
    np.minimum.at(first, piece, np.arange(count))
    for start in first:
        order, before = breadth_first_order(tree, start, directed=False)
        parents = before[order[1:]]
        same = np.where(dots(normals[order[1:]], normals[parents]) < 0.0, -1.0, 1.0)
        for child, parent, factor in zip(order[1:].tolist(), parents.tolist(), same.tolist(), strict=True):
            sign[child] = factor * sign[parent]
    evidence = np.bincount(piece, sign * dots(normals, outward), pieces)
    signs: Array = sign * np.where(evidence < 0.0, -1.0, 1.0)[piece]
    return signs
