"""Surface normals by local plane fits (paper III.B, refs. [21], [22]) and their orientation to the outside."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.config.fields import AUTO
from dlogen.config.sections import Normals
from dlogen.errors import ConfigError
from dlogen.geometry.vectors import dots
from dlogen.types import Array, Cloud

#: Points of a neighbourhood are gathered in blocks of about this many rows, so that memory stays flat.
_BLOCK = 1_000_000

#: A neighbourhood of this many radii is still close to a plane, and large enough to average noise.
_PATCH_RADII = 0.7

#: Share of normals for which shape and viewpoint must name the same side for the viewpoint to be believed. Half a tube
#: seen from 45 degrees off the given viewpoint has 0.75, and the sum of the two is right there still; a full tube 0.5.
_AGREEMENT = 0.75


def outward_normals(cloud: Cloud, radius: float, wanted: Normals) -> tuple[Array, int | None]:
    """Unit normals of a cloud, outward, as the configuration wants them.

    Args:
        cloud: M points, metres, with normals and a viewpoint if it has any.
        radius: of the object, metres.
        wanted: section `normals` of the configuration.

    Returns:
        (M, 3) normals, and the number of neighbours that they were estimated from, if a number decided.

    Raises:
        ConfigError: the cloud has no normals, or no viewpoint, where the configuration says to go by them.
    """
    if wanted.orientation == "stored":
        if cloud.normals is None:
            raise ConfigError("normals.orientation is stored, but the cloud stores no normals", "use auto")
        return cloud.normals, None
    if wanted.orientation == "viewpoint" and cloud.viewpoint is None:
        raise ConfigError("normals.orientation is viewpoint, but the cloud names none", "use auto or outward")
    tree, neighbours = cKDTree(cloud.points), None
    if wanted.radius != AUTO:
        normals = estimate_normals(cloud.points, radius=wanted.radius, tree=tree)
    else:
        automatic = wanted.neighbours == AUTO
        neighbours = choose_neighbours(cloud.points, radius) if automatic else int(wanted.neighbours)
        normals = estimate_normals(cloud.points, neighbours=neighbours, tree=tree)
    outward = orient_normals(cloud.points, normals, radius, viewpoint=cloud.viewpoint, method=wanted.orientation)
    return outward, neighbours


def choose_neighbours(points: Array, radius: float) -> int:
    """The number k of neighbours whose patch reaches about 0.7 radii, from 6 to 60.

    On the clouds of the paper's evaluation the spacing of the points is about half a radius; a fixed, generous k
    would reach around the tube there and flatten the normals.

    Args:
        points: (M, 3) the cloud, metres.
        radius: radius of the object, metres.
    """
    sample = points[:: max(1, len(points) // 2000)]
    k = min(8, len(points) - 1)
    distance = cKDTree(points).query(sample, k + 1)[0][:, -1]
    # Median of k / (pi d_k^2), as an area density of points.
    density = k / (np.pi * max(float(np.median(distance)), 1e-300) ** 2)
    return int(np.clip(round(density * np.pi * (_PATCH_RADII * radius) ** 2), 6, 60))


def estimate_normals(
    points: Array, *, neighbours: int | None = None, radius: float | None = None, tree: cKDTree | None = None
) -> Array:
    """Unit normals of the planes that fit each point's neighbourhood best in the least-squares sense.

    The normal is the eigenvector of the neighbourhood's covariance with the smallest eigenvalue; its sign is
    arbitrary here.

    Args:
        points: (M, 3) the cloud, metres.
        neighbours: k, the number of nearest neighbours, the point itself included. Or:
        radius: all neighbours within this distance, metres; at least the three nearest.
        tree: a k-d tree of the points, if there is one already.

    Returns:
        (M, 3) unit normals.

    Raises:
        ValueError: neither or both of `neighbours` and `radius` are given.
    """
    if (neighbours is None) == (radius is None):
        raise ValueError("give either neighbours or radius")
    tree = tree or cKDTree(points)
    if neighbours is not None:
        k = min(max(neighbours, 3), len(points))
        normals = np.empty_like(points)
        block = max(1, _BLOCK // k)
        for start in range(0, len(points), block):
            part = slice(start, start + block)
            index = tree.query(points[part], k)[1]
            local = points[index] - points[part, None, :]
            local -= local.mean(axis=1, keepdims=True)
            normals[part] = _plane_normals(local)
        return normals
    assert radius is not None
    return _normals_within(points, radius, tree)


def _normals_within(points: Array, radius: float, tree: cKDTree) -> Array:
    """Plane fits over all neighbours within `radius`; points with fewer than three use their three nearest."""
    normals = np.empty_like(points)
    counts = tree.query_ball_point(points, radius, return_length=True)
    block_ends = np.flatnonzero(np.diff(np.cumsum(counts) // _BLOCK, prepend=0)).tolist()
    for first, last in zip([0, *block_ends], [*block_ends, len(points)], strict=True):
        if first == last:
            continue
        part = slice(first, last)
        lists = tree.query_ball_point(points[part], radius)
        count = np.array([len(item) for item in lists])
        index = np.concatenate([np.asarray(item, dtype=np.intp) for item in lists])
        owner = np.repeat(np.arange(last - first), count)
        local = points[index] - points[part][owner]
        mean = np.stack([np.bincount(owner, local[:, i], last - first) for i in range(3)], axis=1) / count[:, None]
        local -= mean[owner]
        covariance = np.empty((last - first, 3, 3))
        for i in range(3):
            for j in range(i + 1):
                sums = np.bincount(owner, local[:, i] * local[:, j], last - first)
                covariance[:, i, j] = covariance[:, j, i] = sums
        normals[part] = _smallest_axis(covariance)
    lonely = counts < 3
    if lonely.any():
        index = tree.query(points[lonely], min(3, len(points)))[1]
        local = points[index] - points[index].mean(axis=1, keepdims=True)
        normals[lonely] = _plane_normals(local)
    return normals


def _plane_normals(local: Array) -> Array:
    """Of neighbourhoods about their means: (M, K, 3) -> (M, 3)."""
    return _smallest_axis(np.einsum("mki,mkj->mij", local, local))


def _smallest_axis(covariance: Array) -> Array:
    axis: Array = np.linalg.eigh(covariance)[1][:, :, 0]
    return axis


def outwardness(points: Array, normals: Array, radius: float) -> Array:
    """How far each normal points away from the middle of the object, in radii: positive for outward normals.

    The centroid of the surface within two radii lies inside the convex hull of the tube, whether the whole tube was
    seen or one side of it: a normal that points away from it points outward. The centroids are those of small cells
    of the cloud, so that the cost does not grow with the density.

    Args:
        points: (M, 3) the cloud, metres.
        normals: (M, 3) unit normals.
        radius: radius of the object, metres.

    Returns:
        (M,) the component of (point - centroid) along the normal, divided by the radius: about 0.7 on a whole tube, on
        half a tube 0.3 in its middle and 0.7 at its edges.
    """
    keys = np.floor((points - points.min(axis=0)) / (0.5 * radius)).astype(np.int64)
    _, cell, count = np.unique(_row_hash(keys), return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(cell, points[:, i]) for i in range(3)], axis=1) / count[:, None]
    pairs = cKDTree(mean).query_pairs(2.0 * radius, output_type="ndarray")
    a, b = pairs[:, 0], pairs[:, 1]
    total = count.astype(float)
    total += np.bincount(a, count[b], len(count)) + np.bincount(b, count[a], len(count))
    weighted = mean * count[:, None]
    centroid = weighted.copy()
    for i in range(3):
        centroid[:, i] += np.bincount(a, weighted[b, i], len(count)) + np.bincount(b, weighted[a, i], len(count))
    centroid /= total[:, None]
    result: Array = dots(normals, points - centroid[cell]) / radius
    return result


def _row_hash(keys: np.ndarray) -> np.ndarray:
    """One integer for each row of three; unique for all grids below 2^21 cells a side."""
    key: np.ndarray = keys[:, 0] | (keys[:, 1] << 21) | (keys[:, 2] << 42)
    return key


def orient_normals(
    points: Array, normals: Array, radius: float, *, viewpoint: Array | None = None, method: str = "auto"
) -> Array:
    """Turn normals to the outside (the sign that Eq. 4 needs; a wrong one puts the point 2 r off the axis).

    Args:
        points: (M, 3) the cloud, metres.
        normals: (M, 3) unit normals of any sign.
        radius: radius of the object, metres.
        viewpoint: (3,) position of the sensor, if known.
        method: "outward" looks at the shape only (see `outwardness`), "viewpoint" turns all towards the sensor, "auto"
            adds half the cosine to the viewpoint to the outwardness where the two agree by and large, so for a scan
            from one side: the shape is weak where the surface faces the sensor, the viewpoint at the edges. On a full
            tube (of whose normals half point away from any viewpoint), and for the all-zero viewpoint of files that
            know none, they do not agree, and the shape decides.

    Returns:
        (M, 3) unit normals.

    Raises:
        ValueError: method "viewpoint" without a viewpoint, or an unknown method.
    """
    if method not in ("auto", "outward", "viewpoint"):
        raise ValueError(f"unknown method {method!r}")
    if method == "viewpoint" and viewpoint is None:
        raise ValueError("no viewpoint is known")
    score = np.zeros(len(points))
    if method != "viewpoint":
        score = outwardness(points, normals, radius)
    if method != "outward" and viewpoint is not None:
        sight = viewpoint - points
        distance = np.maximum(np.linalg.norm(sight, axis=1), 1e-300)
        towards = dots(normals, sight) / distance
        if method == "viewpoint" or np.mean((towards >= 0.0) == (score >= 0.0)) > _AGREEMENT:
            score += 0.5 * towards
    return np.where(score[:, None] >= 0.0, normals, -normals)
