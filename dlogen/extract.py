"""Cutting the object out of a scene (paper IV.C): background subtraction, removal of specks, down-sampling."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dlogen.errors import FitError, InputError
from dlogen.model import Array, BoolArray, Cloud, Dropped, RawCloud

#: Standard deviations of the difference between scene and background that make an object.
_SIGMAS = 5.0

#: Points of one object are no farther apart than this many spacings.
_LINK = 4.0

#: Parts with fewer points than this share of the largest are specks.
_SPECK = 0.05


def extract(
    scene: RawCloud, background: RawCloud, *, threshold: float | None = None, count: int | None = 5000, seed: int = 0
) -> Cloud:
    """What the scene has and the background has not.

    Args:
        scene: with the object.
        background: the same place without it: pixel by pixel the same for organised clouds, any cloud otherwise.
        threshold: distance to the background from which on a point belongs to the object, in the clouds' unit; by
            default five standard deviations of the noise, which is measured.
        count: number of points to draw from it at random (5,000 in the paper); None keeps all.
        seed: of the drawing.

    Returns:
        The object's points in the scene's frame, with the scene's viewpoint.

    Raises:
        FitError: nothing, or nearly everything, differs from the background.
        InputError: organised clouds of different sizes.
    """
    if scene.organised and background.organised:
        if (scene.width, scene.height) != (background.width, background.height):
            raise InputError(
                f"the scene has {scene.width} x {scene.height} pixels, the background "
                f"{background.width} x {background.height}",
                "both must come from the same sensor at the same place",
            )
        differs = differing_pixels(scene.points, background.points, threshold)
    else:
        differs = differing_points(scene.points, background.points, threshold)
    index = np.flatnonzero(differs)
    if len(index) > 0:
        index = index[main_parts(scene.points[index])]
    if len(index) == 0:
        raise FitError("nothing differs from the background", "lower --threshold, or check the two files")
    share = len(index) / max(int(np.isfinite(scene.points).all(axis=1).sum()), 1)
    if share > 0.8:
        raise FitError(
            f"{100 * share:.0f} % of the scene differ from the background: the camera or the table moved",
            "take both with the same pose, or raise --threshold",
        )
    if count is not None and len(index) > count:
        index = np.sort(np.random.default_rng(seed).choice(index, count, replace=False))
    return Cloud(
        scene.points[index],
        None if scene.normals is None else scene.normals[index],
        None if scene.viewpoint is None else scene.viewpoint[:3],
        Dropped(non_finite=int(np.sum(~np.isfinite(scene.points).all(axis=1)))),
    )


def differing_pixels(scene: Array, background: Array, threshold: float | None = None) -> BoolArray:
    """Pixels that are nearer to the camera than the background, or whose background was not seen.

    Depths are compared as 1 / Z: there the noise of disparity sensors is the same at every depth.

    Args:
        scene, background: (M, 3) points of the same pixels in the camera frame; NaN where nothing was seen.
        threshold: difference in depth, metres; None measures the noise.

    Returns:
        (M,) booleans.
    """
    near, far = scene[:, 2], background[:, 2]
    seen = np.isfinite(scene).all(axis=1) & (near > 0.0)
    both = seen & np.isfinite(far) & (far > 0.0)
    differs = seen & ~np.isfinite(far)
    if threshold is not None:
        differs[both] = far[both] - near[both] > threshold
        return differs
    closer = 1.0 / near[both] - 1.0 / far[both]
    differs[both] = closer > _SIGMAS * _noise(closer)
    return differs


def _noise(difference: Array) -> float:
    """Standard deviation of the background's differences, whatever the object's are."""
    if len(difference) == 0:
        return 0.0
    # The side away from the camera holds no object; its root mean square also sees noise that is mostly rounded to 0.
    behind = difference[difference <= 0.0]
    if len(behind) == 0:
        return 0.0
    limit = 6.0 * 1.4826 * float(np.median(np.abs(behind))) or float(np.abs(behind).max())
    return float(np.sqrt(np.mean(behind[np.abs(behind) <= limit] ** 2)))


def differing_points(scene: Array, background: Array, threshold: float | None = None) -> BoolArray:
    """Points of an unorganised scene that are far from all points of the background.

    Args:
        scene, background: points; rows with NaN are left out.
        threshold: distance to the nearest background point; None takes what the background's own spacing and the
            bulk of the scene suggest.

    Returns:
        (M,) booleans.
    """
    finite = np.isfinite(scene).all(axis=1)
    known = background[np.isfinite(background).all(axis=1)]
    if len(known) < 2:
        return finite
    tree = cKDTree(known)
    distance = tree.query(scene[finite])[0]
    if threshold is None:
        sample = known[:: max(1, len(known) // 5000)]
        spacing = float(np.median(tree.query(sample, 2)[0][:, 1]))
        lower = distance[distance <= np.median(distance)]
        threshold = max(3.0 * spacing, _SIGMAS * float(np.sqrt(np.mean(lower**2))))
    differs = np.zeros(len(scene), dtype=bool)
    differs[finite] = distance > threshold
    return differs


def main_parts(points: Array) -> BoolArray:
    """Leave out specks and loose points.

    Points closer than four spacings belong together; parts with less than a twentieth of the largest part's points go.
    So do points with hardly any neighbours, as sensors put between an edge and what is behind it.

    Args:
        points: (M, 3) finite.

    Returns:
        (M,) which ones to keep.
    """
    if len(points) < 3:
        return np.ones(len(points), dtype=bool)
    tree = cKDTree(points)
    spacing = float(np.median(tree.query(points[:: max(1, len(points) // 5000)], 3)[0][:, 2]))
    pairs = tree.query_pairs(_LINK * spacing, output_type="ndarray")
    neighbours = np.bincount(pairs.ravel(), minlength=len(points))
    firm = neighbours >= 0.2 * np.median(neighbours)
    kept = pairs[firm[pairs].all(axis=1)]
    graph = coo_matrix((np.ones(len(kept), dtype=np.int8), (kept[:, 0], kept[:, 1])), shape=(len(points),) * 2)
    part = connected_components(graph, directed=False)[1]
    size = np.bincount(part)
    result: BoolArray = firm & (size[part] >= max(3.0, _SPECK * size.max()))
    return result
