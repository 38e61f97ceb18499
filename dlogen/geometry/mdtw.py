"""Modified dynamic time warping, the paper's error between two curves (paper IV.A, Eq. 21-22)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dlogen.types import Array, IntArray, Mdtw

# How the best path reaches a pair (i, j). The order is the tie rule: of equally good steps the first is taken.
_DIAGONAL, _ALONG_V, _ALONG_Q = 0, 1, 2  # from (i-1, j-1), from (i-1, j), from (i, j-1)

#: Places on either side of the main diagonal in the first band, and how many times wider each next one is.
_FIRST_BAND, _WIDER = 12, 6
#: Pairs that are worked on at a time.
_AT_ONCE = 1 << 15


def mdtw(v: npt.ArrayLike, q: npt.ArrayLike) -> Mdtw:
    """Modified dynamic time warping error between two sampled curves (paper Eq. 21-22), exact.

    Of all paths of pairs (i, j) from (0, 0) to (H - 1, G - 1) with the steps (1, 0), (0, 1) and (1, 1) the one with the
    smallest sum of Euclidean distances is found. Its distances are the errors; mean, standard deviation and maximum are
    taken over the pairs of the path. The standard deviation is sqrt(sum((e - mean)^2) / (K - 1)): the formula printed
    in the paper grows with K. For a path of a single pair it is 0.

    The result depends on how the curves are sampled: sampled by two different parameters, even a curve and itself are
    about a quarter of the sample spacing apart. Sample both evenly in arc length (`dlogen.geometry.polyline.resample`).

    Where several paths have the same sum, the steps are chosen from the far end backwards: diagonal before a step along
    `v` before a step along `q`.

    The cumulative distances are worked out one anti-diagonal i + j = const. at a time (H. Sakoe, S. Chiba, "Dynamic
    programming algorithm optimization for spoken word recognition", 1978, without slope weights), in a band around the
    main diagonal that is widened until no path through its edge can be as good as the best one in it (after E. Ukkonen,
    "Algorithms for approximate string matching", 1985). For curves that lie close together that is a small share of the
    pairs. Only the steps are kept: one byte per pair of samples at most, 100 MB for 10,000 by 10,000.

    Args:
        v: (H, D) samples of the first curve, H >= 1; D is 3 in dlogen, other dimensions work as well. Metres.
        q: (G, D) samples of the second curve, G >= 1, metres.

    Returns:
        The errors, the path and their statistics. `s` is i / (H - 1), which is the material coordinate of the first
        curve when its samples are even in arc length.

    Raises:
        ValueError: wrong shapes, no points, or coordinates that are not finite.
    """
    v, q = _samples(v, "first"), _samples(q, "second")
    if v.shape[1] != q.shape[1]:
        raise ValueError(f"the curves differ in dimension: {v.shape[1]} and {q.shape[1]}")
    path = _backtrack(_best_steps(v, q), len(v) - 1, len(q) - 1)
    error = np.linalg.norm(v[path[:, 0]] - q[path[:, 1]], axis=1)
    return Mdtw(
        error=error,
        path=path,
        s=path[:, 0] / max(len(v) - 1, 1),
        mean=float(error.mean()),
        std=float(error.std(ddof=1)) if len(error) > 1 else 0.0,
        max=float(error.max()),
    )


def _samples(curve: npt.ArrayLike, which: str) -> Array:
    samples = np.asarray(curve, dtype=float)
    if samples.ndim != 2 or 0 in samples.shape:
        raise ValueError(f"the {which} curve must be an array of shape (samples, 3), not {samples.shape}")
    if not np.isfinite(samples).all():
        raise ValueError(f"the {which} curve has coordinates that are not finite")
    return samples


@dataclass(frozen=True, eq=False)
class _Steps:
    """The best step into every pair of a band, in blocks of anti-diagonals.

    The pairs of the anti-diagonal k = i + j are told apart by their place i - floor(k / 2).

    Attributes:
        size: anti-diagonals of a block.
        blocks: for every block its first place, and the steps: a row for each anti-diagonal, a column for each place.
        edges: (K, 2) cumulative distance of the first and the last place of the band; infinite outside of the matrix.
        total: cumulative distance of the last pair.
    """

    size: int
    blocks: list[tuple[int, npt.NDArray[np.int8]]]
    edges: Array
    total: float


def _best_steps(v: Array, q: Array) -> _Steps:
    """The steps in a band that holds the best path."""
    rows, columns = len(v), len(q)
    # Places of the last pair and of (0, 0), which is 0.
    begin, end = min(0, (rows - columns) // 2), max(0, (rows - columns + 1) // 2)
    band = _FIRST_BAND
    after: tuple[Array, Array] | None = None
    while band * _WIDER <= min(rows, columns):
        steps = _steps(v, q, begin - band, end + band)
        after = after or _least_after(v, q)
        if _no_better_outside(steps, begin - band, end + band, *after):
            return steps
        band *= _WIDER
    return _steps(v, q, -columns // 2, rows // 2)


def _steps(v: Array, q: Array, low: int, high: int) -> _Steps:
    """The steps in the band of the places from low to high, without a look at what is outside."""
    rows, columns = len(v), len(q)
    # Whatever lies outside of the matrix is infinitely far away.
    padding = (0, 0), (1, 1)
    v, q = np.pad(v.T, padding, constant_values=np.inf), np.pad(q.T, padding, constant_values=-np.inf)
    k = np.arange(rows + columns - 1)
    first_place = np.maximum(np.maximum(0, k - columns + 1) - k // 2, low)
    last_place = np.minimum(np.minimum(rows - 1, k) - k // 2, high)
    size = min(2 * (_AT_ONCE // (2 * (high - low + 1)) + 1), len(k) + len(k) % 2)
    blocks, edges = [], []
    # Cumulative distances: two anti-diagonals before the block, then those of the block; a place more on either side.
    sums = np.full((size + 2, high - low + 3), np.inf)
    sums[0, 1 - low] = 0.0  # the path comes from outside into (0, 0)
    for begin in range(0, len(k), size):
        now = slice(begin, begin + size)
        a, b = int(first_place[now].min()), int(last_place[now].max())
        i = k[now, None] // 2 + np.arange(a + 1, b + 2)  # in the padded curve
        j = k[now, None] + 2 - i
        distance = np.zeros(i.shape)
        for x, y in zip(v, q, strict=True):
            difference = x.take(i, mode="clip")
            difference -= y.take(j, mode="clip")
            difference *= difference
            distance += difference
        np.sqrt(distance, out=distance)
        sums[2:] = np.inf
        before, here, behind = (sums[:, a - low + shift : b - low + shift + 1] for shift in range(3))
        # Where steps along v and along q come from, one anti-diagonal before: even ones and odd ones.
        along = (here, behind), (before, here)
        for n in range(len(distance)):
            along_v, along_q = along[n & 1]
            current = here[n + 2]
            np.minimum(along_v[n + 1], along_q[n + 1], out=current)
            np.minimum(current, here[n], out=current)
            np.add(current, distance[n], out=current)

        steps = np.empty(distance.shape, dtype=np.int8)
        count = len(steps)
        for odd in range(2):
            along_v, along_q = (source[odd + 1 : count + 1 : 2] for source in along[odd])
            straight = (along_q < along_v).view(np.int8) + np.int8(_ALONG_V)  # _ALONG_Q where that is shorter
            steps[odd::2] = straight * (here[odd:count:2] > np.minimum(along_v, along_q))
        blocks.append((a, steps))
        edges.append(sums[2 : count + 2, [1, -2]])
        sums[:2] = sums[count : count + 2]
    return _Steps(size, blocks, np.concatenate(edges), float(sums[1, rows - len(k) // 2 - low]))


def _least_after(v: Array, q: Array) -> tuple[Array, Array]:
    """What is left of any path after a sample of v, or of q, costs as much as this at least: (H,), (G,).

    It passes every sample that is left, and none is nearer to the other curve than its nearest sample.
    """
    centre = v.mean(axis=0)
    v, q = v - centre, q - centre
    v_squares, q_squares = (v**2).sum(axis=1), (q**2).sum(axis=1)
    # |v - q|^2 as one product.
    left = np.column_stack([-2.0 * v, v_squares, np.ones(len(v))])
    right = np.column_stack([q, np.ones(len(q)), q_squares]).T.copy()
    nearest_v, nearest_q = np.empty(len(v)), np.full(len(q), np.inf)
    rows = max(1, _AT_ONCE // len(q))
    for begin in range(0, len(v), rows):
        squares = left[begin : begin + rows] @ right
        nearest_v[begin : begin + rows] = squares.min(axis=1)
        np.minimum(nearest_q, squares.min(axis=0), out=nearest_q)
    # Differences of squares are rounded; the bound must not be too large.
    rounding = 1e-14 * (v_squares.max() + q_squares.max())
    distances = (np.sqrt(np.maximum(nearest - rounding, 0.0)) for nearest in (nearest_v, nearest_q))
    after_v, after_q = (np.append(distance[:0:-1].cumsum()[::-1], 0.0) for distance in distances)
    return after_v, after_q


def _no_better_outside(steps: _Steps, low: int, high: int, after_v: Array, after_q: Array) -> bool:
    """Whether all paths that leave the band are longer than the best one in it.

    Such a path has a first pair on the edge. Up to there it is in the band, and cannot be shorter than the best one to
    that pair.
    """
    k = np.arange(len(steps.edges))[:, None]
    i = np.clip(k // 2 + np.array([low, high]), 0, len(after_v) - 1)
    j = np.clip(k - i, 0, len(after_q) - 1)
    least = steps.edges + np.maximum(after_v[i], after_q[j])
    # The margin is for rounding.
    return bool((least > steps.total * (1.0 + 1e-9)).all())


def _backtrack(steps: _Steps, i: int, j: int) -> IntArray:
    """The warping path, (K, 2), from (0, 0) to the pair (i, j), which is the last."""
    # Plain integers: this is a walk, one pair after another.
    blocks = [(place, block.data) for place, block in steps.blocks]
    path = [(i, j)]
    while i or j:
        k = i + j
        place, block = blocks[k // steps.size]
        code = block[k % steps.size, i - k // 2 - place]
        i -= code != _ALONG_Q
        j -= code != _ALONG_V
        path.append((i, j))
    return np.array(path[::-1], dtype=np.intp)
