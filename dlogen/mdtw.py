"""Modified dynamic time warping, the paper's error between two curves (paper IV.A, Eq. 21-22)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dlogen.model import Array, IntArray, Mdtw

# How the best path reaches a pair (i, j). The order is the tie rule: of equally good steps the first is taken.
_DIAGONAL, _ALONG_V, _ALONG_Q = 0, 1, 2  # from (i-1, j-1), from (i-1, j), from (i, j-1)


def mdtw(v: npt.ArrayLike, q: npt.ArrayLike) -> Mdtw:
    """Modified dynamic time warping error between two sampled curves (paper Eq. 21-22), exact.

    Of all paths of pairs (i, j) from (0, 0) to (H - 1, G - 1) with the steps (1, 0), (0, 1) and (1, 1) the one with the
    smallest sum of Euclidean distances is found. Its distances are the errors; mean, standard deviation and maximum are
    taken over the pairs of the path. The standard deviation is sqrt(sum((e - mean)^2) / (K - 1)): the formula printed
    in the paper grows with K. For a path of a single pair it is 0.

    The result depends on how the curves are sampled: sampled by two different parameters, even a curve and itself are
    about a quarter of the sample spacing apart. Sample both evenly in arc length (`dlogen.polyline.resample`).

    Where several paths have the same sum, the steps are chosen from the far end backwards: diagonal before a step along
    `v` before a step along `q`.

    The cumulative distances are worked out one anti-diagonal i + j = const. at a time (H. Sakoe, S. Chiba, "Dynamic
    programming algorithm optimization for spoken word recognition", 1978, without slope weights), and only the
    steps are kept: one byte per pair of samples, 100 MB for 10,000 by 10,000.

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
    path = _backtrack(*_steps(v, q), shape=(len(v), len(q)))
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


def _steps(v: Array, q: Array) -> tuple[npt.NDArray[np.int8], IntArray]:
    """The best step into every pair, anti-diagonal by anti-diagonal, and the index of (0, k) among them for each k."""
    rows, columns = len(v), len(q)
    k = np.arange(rows + columns - 1)
    low, high = np.maximum(0, k - columns + 1), np.minimum(rows - 1, k) + 1  # i of the first pair, and past the last
    begin = np.concatenate([[0], np.cumsum(high - low)])
    steps = np.empty(rows * columns, dtype=np.int8)

    # Contiguous coordinates; the second curve backwards, so that an anti-diagonal is a slice of both.
    v, q = np.ascontiguousarray(v.T), np.ascontiguousarray(q[::-1].T)
    # Cumulative distances of this and the two anti-diagonals before it, by i + 1. Places outside the matrix stay inf.
    before_last, last, current = (np.full(rows + 1, np.inf) for _ in range(3))
    before_last[0] = 0.0  # the path comes from outside into (0, 0)
    for a, b, shift, first, end in zip(
        low.tolist(), high.tolist(), (columns - 1 - k).tolist(), begin[:-1].tolist(), begin[1:].tolist(), strict=True
    ):
        difference = v[:, a:b] - q[:, shift + a : shift + b]
        difference *= difference
        distance = np.sqrt(np.add.reduce(difference, axis=0))
        diagonal, along_v, along_q = before_last[a:b], last[a:b], last[a + 1 : b + 1]
        straight = np.minimum(along_v, along_q)
        step = (along_q < along_v).view(np.int8)
        step += _ALONG_V  # _ALONG_Q where that is shorter
        np.multiply(step, (diagonal > straight).view(np.int8), out=steps[first:end])
        np.minimum(straight, diagonal, out=straight)
        np.add(straight, distance, out=current[a + 1 : b + 1])
        before_last[0] = np.inf
        before_last, last, current = last, current, before_last
    return steps, begin[:-1] - low


def _backtrack(steps: npt.NDArray[np.int8], origin: IntArray, *, shape: tuple[int, int]) -> IntArray:
    """The warping path, (K, 2), from (0, 0) to the last pair."""
    i, j = shape[0] - 1, shape[1] - 1
    codes, origins = steps.data, origin.tolist()  # plain integers: this is a walk, one pair after another
    path = [(i, j)]
    while i or j:
        code = codes[origins[i + j] + i]
        i -= code != _ALONG_Q
        j -= code != _ALONG_V
        path.append((i, j))
    return np.array(path[::-1], dtype=np.intp)
