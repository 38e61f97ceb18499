"""Cutting the object out of a scene (paper IV.C): background subtraction, removal of specks, down-sampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dlogen.errors import FitError, InputError
from dlogen.types import Array, BoolArray, Cloud, Dropped, RawCloud

#: Standard deviations of the difference between scene and background that make an object.
_SIGMAS = 5.0

#: Points of one object are no farther apart than this many of its spacings, or of the scene's.
_LINK, _LINK_SCENE = 4.0, 10.0

#: Parts with fewer points than this share of the largest are specks, and those with fewer points than that.
_SPECK, _FEWEST = 0.05, 10

#: Parts are told by at most this many points, which bounds the memory for pairs of neighbours.
_MOST = 200_000

#: Where more of the scene than this has changed, it is not because of an object.
_LARGEST_SHARE = 0.8


def extract(
    scene: RawCloud, background: RawCloud, *, threshold: float | None = None, count: int | None = 5000, seed: int = 0
) -> Cloud:
    """What the scene has and the background has not.

    Args:
        scene: with the object.
        background: the same place without it: pixel by pixel the same for organised clouds, any cloud in the same frame
            otherwise.
        threshold: distance to the background from which on a point belongs to the object, in the clouds' unit; by
            default five standard deviations of the noise, which is measured.
        count: number of points to draw from it at random (5,000 in the paper); None keeps all.
        seed: of the drawing.

    Returns:
        The object's points in the scene's frame, with the scene's viewpoint.

    Raises:
        FitError: nothing, or nearly everything, differs from the background, or only specks do.
        InputError: a cloud without points, or organised clouds of different sizes or poses.

    >>> import dlogen, numpy as np
    >>> table = np.stack(np.meshgrid(np.arange(0, 1, 0.02), np.arange(0, 1, 0.02)), axis=-1).reshape(-1, 2)
    >>> background = np.column_stack([table, np.zeros(len(table))])
    >>> cable = dlogen.synth("straight", points=2000).points * [0.5, 0.5, 1.0] + [0.3, 0.6, 0.1]
    >>> scene = dlogen.RawCloud(np.concatenate([background, cable]))
    >>> found = dlogen.extract(scene, dlogen.RawCloud(background), count=1000)
    >>> len(found), bool(found.points[:, 2].min() > 0.05)
    (1000, True)
    """
    seen = int(_finite(scene).sum())
    for cloud, what, points in ((scene, "scene", seen), (background, "background", int(_finite(background).sum()))):
        if points == 0:
            raise InputError(f"the {what} has no finite point", f"it has {len(cloud.points)} rows: take it again")
    if scene.organised and background.organised:
        differs = differing_pixels(scene, background, threshold)
    else:
        differs = differing_points(scene.points, background.points, threshold)
    index = np.flatnonzero(differs)
    if len(index) > 0:
        spacing = _spacing(cKDTree(scene.points[_finite(scene)]))
        index = index[main_parts(scene.points[index], _LINK_SCENE * spacing)]
    if len(index) == 0:
        raise FitError("nothing differs from the background", "lower --threshold, or check the two files")
    share = len(index) / seen
    if share > _LARGEST_SHARE:
        raise _moved(f"{100 * share:.0f} % of the scene differ from the background")
    whole = Cloud(
        scene.points[index],
        None if scene.normals is None else scene.normals[index],
        None if scene.viewpoint is None else scene.viewpoint[:3],
        Dropped(non_finite=len(scene.points) - seen),
        orientation=None if scene.viewpoint is None else scene.viewpoint[3:],
    )
    return whole if count is None else down_sample(whole, count, seed)


def down_sample(cloud: Cloud, count: int, seed: int = 0) -> Cloud:
    """At most `count` points of a cloud, drawn at random without repetition, in the cloud's order."""
    if len(cloud) <= count:
        return cloud
    index = np.sort(np.random.default_rng(seed).choice(len(cloud), count, replace=False))
    return replace(cloud, points=cloud.points[index], normals=None if cloud.normals is None else cloud.normals[index])


def _moved(what: str) -> FitError:
    return FitError(f"{what}: the camera or the table moved", "take both with the same pose, or set --threshold")


def _spacing(tree: cKDTree) -> float:
    """Median distance from a point to the second nearest one; of a sample where there are many points."""
    sample = tree.data[:: max(1, tree.n // 5000)]
    return float(np.median(tree.query(sample, min(tree.n, 3))[0].reshape(len(sample), -1)[:, -1]))


def _finite(cloud: RawCloud) -> BoolArray:
    """(M,) which points were seen."""
    return np.asarray(np.isfinite(cloud.points).all(axis=1))


def differing_pixels(scene: RawCloud, background: RawCloud, threshold: float | None = None) -> BoolArray:
    """Pixels that are nearer to the sensor than the background, or whose background was not seen.

    Distances from the sensor are compared as 1 / d: there the noise of disparity sensors is the same at every distance.

    Args:
        scene, background: organised clouds of the same pixels, NaN where nothing was seen. A cloud without viewpoint is
            in the sensor's own frame.
        threshold: difference in distance, in the clouds' unit; None measures the noise.

    Returns:
        (M,) booleans.

    Raises:
        InputError: other pixels, or another pose of the sensor.
    """
    if (scene.width, scene.height) != (background.width, background.height):
        raise InputError(
            f"the scene has {scene.width} x {scene.height} pixels, the background "
            f"{background.width} x {background.height}",
            "both must come from the same sensor at the same place",
        )
    origin = np.zeros(3) if scene.viewpoint is None else scene.viewpoint[:3]
    if background.viewpoint is not None and not np.allclose(background.viewpoint[:3], origin):
        raise InputError(
            "the scene and the background were taken from different places", "take both with the same pose"
        )
    known = _finite(background)
    near, far = (np.linalg.norm(cloud.points - origin, axis=1) for cloud in (scene, background))
    # A distance of zero is how some drivers write that nothing was seen.
    seen: BoolArray = _finite(scene) & (near > 0.0)
    both = seen & known & (far > 0.0)
    differs: BoolArray = seen & ~both
    if threshold is not None:
        differs[both] = far[both] - near[both] > threshold
        return differs
    closer = 1.0 / near[both] - 1.0 / far[both]
    differs[both] = closer > _SIGMAS * _noise(closer)
    return differs


def _noise(difference: Array) -> float:
    """Standard deviation of the background's differences, whatever the object's are."""
    # The side away from the sensor holds no object; its root mean square also sees noise that is mostly rounded to 0.
    behind = -difference[difference <= 0.0]
    if len(behind) == 0:
        return 0.0
    # A normal distribution keeps within four times its 0.9 quantile; what was taken away from the scene does not.
    limit = 4.0 * float(np.quantile(behind, 0.9)) or float(behind.max())
    return float(np.sqrt(np.mean(behind[behind <= limit] ** 2)))


def differing_points(scene: Array, background: Array, threshold: float | None = None) -> BoolArray:
    """Points of an unorganised scene that are far from all points of the background.

    Args:
        scene, background: points; rows with NaN are left out.
        threshold: distance to the nearest background point; None takes what the background's own spacing and the
            bulk of the scene suggest.

    Returns:
        (M,) booleans.

    Raises:
        FitError: without a threshold, and most of the scene is not where the background is.
    """
    finite = np.isfinite(scene).all(axis=1)
    known = background[np.isfinite(background).all(axis=1)]
    tree = cKDTree(known)
    distance = tree.query(scene[finite])[0]
    if threshold is None:
        spacing, middle = _spacing(tree), float(np.median(distance))
        if middle > 3.0 * spacing:
            raise _moved("most of the scene is away from the background")
        lower = distance[distance <= middle]
        threshold = max(3.0 * spacing, _SIGMAS * float(np.sqrt(np.mean(lower**2))))
    differs = np.zeros(len(scene), dtype=bool)
    differs[finite] = distance > threshold
    return differs


def main_parts(points: Array, farthest: float = np.inf) -> BoolArray:
    """Leave out specks and loose points.

    Points closer than four spacings belong together; parts with less than a twentieth of the largest part's points go,
    and all of a handful of points. So do points with hardly any neighbours, as sensors put between an edge and what is
    behind it.

    Args:
        points: (M, 3) finite.
        farthest: points farther apart than this do not belong together, however few there are.

    Returns:
        (M,) which ones to keep.
    """
    if len(points) < _FEWEST:
        return np.zeros(len(points), dtype=bool)
    if len(points) > _MOST:
        chosen = points[np.random.default_rng(0).choice(len(points), _MOST, replace=False)]
        # Thinned out, they are farther apart by the square root of how many there were for each: they fill a surface.
        thinned = farthest * np.sqrt(len(points) / _MOST)
        belongs: BoolArray = main_parts(chosen, thinned)[cKDTree(chosen).query(points)[1]]
        return belongs
    tree = cKDTree(points)
    pairs = tree.query_pairs(min(_LINK * _spacing(tree), farthest), output_type="ndarray")
    neighbours = np.bincount(pairs.ravel(), minlength=len(points))
    firm = neighbours >= 0.2 * np.median(neighbours)
    kept = pairs[firm[pairs].all(axis=1)]
    graph = coo_matrix((np.ones(len(kept), dtype=np.int8), (kept[:, 0], kept[:, 1])), shape=(len(points),) * 2)
    part = connected_components(graph, directed=False)[1]
    size = np.bincount(part)
    result: BoolArray = firm & (size[part] >= max(_FEWEST, _SPECK * size.max()))
    return result
