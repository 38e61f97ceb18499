"""From capture to capture: which end is first, which one is hidden, and what does not fit between its neighbours."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dlogen.geometry.vectors import dots
from dlogen.types import Array, BoolArray, IntArray

#: Captures in a row that can be left out between two that are kept.
_REACH = 8

#: Weight of the way from one capture to the next beside that of its change. It decides where there is nothing else:
#: with two captures, and after a long gap.
_WAY = 0.05

#: A capture is excluded when it is off by more than this many times what is usual in the recording ...
_USUAL = 6.0

#: ... and by more than this share of the steps around it, at the ends by a whole step: what moves so fast is not known
#: any better. In the middle also by more than the cubic is from the straight way: no more than what acceleration does.
_OF_STEP = 0.3

#: Below this number of captures nobody can tell which one is wrong.
_LEAST = 5

#: A direction is clear when the way it is taken makes the motion smoother by this factor than the other way round.
#: Recordings that are followed rightly have 10 and more at 60 captures, 3 and more at 15; wrong turns 1.0 to 1.8.
_CLEAR = 2.0


def directions(curves: Array, times: Array, least: float) -> tuple[BoolArray, BoolArray]:
    """Which curves are to be reversed so that the same end is first in all, and which to leave out of account.

    Finds the sequence of kept curves, each as it is or reversed, with the least total of

    - the distance of each to the straight way between the ones before and after it (a change of velocity),
    - a little of the distance from each to the next,
    - a price for every curve that is left out: what one pays for keeping a curve that is off by the larger of
      `least` and six times the usual distance.

    The change of velocity tells the strands of a folded cable apart that moves by its own width between two captures.
    The minimum over all sequences (dynamic programming over pairs of kept curves, Viterbi 1967) is not thrown off by a
    wrong curve, nor by the first one.

    Args:
        curves: (F, P, 3) points at the same places of the object, from one end to the other and symmetric to its
            middle, metres.
        times: (F,) seconds, increasing.
        least: distance, metres, that a curve may always be off.

    Returns:
        reverse: (F,), False for the first kept curve; of those left out, what is nearer to the nearest kept one.
        kept: (F,).
    """
    count = len(curves)
    if count < 2:
        return np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    both = np.stack([curves, curves[:, ::-1]], axis=1)
    usual = [_bends(both, times, k, 1, 1).min() for k in range(2, count)]
    price = 2.0 * max(least, _USUAL * float(np.median(usual)) if usual else least)
    # best[k, g, a, b]: ends with the kept curves k - g - 1 in direction a and k in direction b.
    best = np.full((count, _REACH, 2, 2), np.inf)
    before = np.zeros((count, _REACH, 2, 2, 2), dtype=np.intp)  # the g and a that led there; -1 for a beginning
    for k in range(1, count):
        reach = min(k, _REACH)
        way = _WAY * _rms(both[k - reach : k][::-1, :, None] - both[k][None, None])
        skipped = price * np.arange(reach)
        best[k, :reach] = price * (k - 1 - np.arange(reach))[:, None, None] + skipped[:, None, None] + way
        before[k, :reach] = -1
        for g in range(min(reach, k - 1)):
            j = k - g - 1
            further = min(j, _REACH)
            bends = _bends(both, times, k, g + 1, further)
            total = best[j, :further, :, :, None] + bends + skipped[g] + way[g][None, None]
            # (further, a, b, c) -> the best (g', a) for each (b, c)
            flat = total.transpose(2, 3, 0, 1).reshape(2, 2, -1)
            choice = flat.argmin(axis=2)
            cost = np.take_along_axis(flat, choice[..., None], axis=2)[..., 0]
            better = cost < best[k, g]
            best[k, g][better] = cost[better]
            before[k, g][better] = np.stack(np.divmod(choice, 2), axis=-1)[better]
    ending = best + price * (count - 1 - np.arange(count))[:, None, None, None]
    k, g, a, b = (int(i) for i in np.unravel_index(np.argmin(ending), ending.shape))
    reverse, kept = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    while True:
        reverse[k], kept[k] = b, True
        j = k - g - 1
        further_back, direction = before[k, g, a, b]
        if further_back < 0:
            reverse[j], kept[j] = a, True
            break
        k, g, a, b = j, int(further_back), int(direction), a
    if reverse[j]:
        reverse[kept] = ~reverse[kept]
    known = np.flatnonzero(kept)
    for k in np.flatnonzero(~kept).tolist():
        j = known[int(np.argmin(np.abs(times[known] - times[k])))]
        reverse[k] = bool(np.argmin(_rms(both[k] - both[j, int(reverse[j])])))
    return reverse, kept


def unclear_directions(curves: Array, times: Array) -> IntArray:
    """Curves from which on the same end might as well be the other one.

    After a long gap, or when all moves far from one capture to the next, the motion is about as smooth if all curves
    from there on are reversed: in its changes of velocity around the step and a little of the step's own length, as in
    `directions`.

    Args:
        curves: (F, P, 3) in the directions found, at places symmetric to the middle, metres.
        times: (F,) seconds, increasing.

    Returns:
        Indices, in order; 0 is not among them.
    """
    if len(curves) < 2:
        return np.zeros(0, dtype=np.intp)
    share = ((times[2:] - times[1:-1]) / (times[2:] - times[:-2]))[:, None, None]
    cost = []
    for after in (curves, curves[:, ::-1]):
        total = _WAY * _rms(curves[:-1] - after[1:])
        # The changes of velocity at the curve before the step, and at the one after it.
        total[1:] += _rms(share * curves[:-2] + (1.0 - share) * after[2:] - curves[1:-1])
        total[:-1] += _rms(share * curves[:-2] + (1.0 - share) * after[2:] - after[1:-1])
        cost.append(total)
    found: IntArray = np.flatnonzero(cost[1] < _CLEAR * cost[0]) + 1
    return found


def hidden_ends(variants: Array, times: Array) -> IntArray:
    """Which of several versions of each curve make the smoothest motion.

    The sequence with the least changes of velocity, as in `directions`, but without leaving any out, and with less
    weight for what happens across gaps: acceleration does more there.

    Args:
        variants: (F, V, P, 3) points at the same places of the object, by what is taken for hidden, metres.
        times: (F,) seconds, increasing.

    Returns:
        (F,) index of the version.
    """
    count, kinds = variants.shape[:2]
    if count < 3:
        return np.zeros(count, dtype=np.intp)
    usual = float(np.median(np.diff(times)))
    best = _WAY * _rms(variants[0][:, None] - variants[1][None])
    before = np.zeros((count, kinds, kinds), dtype=np.intp)
    for k in range(2, count):
        # (a, b, c): versions of k - 2, k - 1 and k.
        way = _WAY * _rms(variants[k - 1][:, None] - variants[k][None])
        weight = min(1.0, usual**2 / ((times[k] - times[k - 1]) * (times[k - 1] - times[k - 2])))
        total = best[:, :, None] + weight * _bends(variants, times, k, 1)[0] + way
        before[k], best = total.argmin(axis=0), total.min(axis=0)
    choice = np.zeros(count, dtype=np.intp)
    choice[-2:] = np.unravel_index(np.argmin(best), best.shape)
    for k in range(count - 1, 1, -1):
        choice[k - 2] = before[k][choice[k - 1], choice[k]]
    return choice


def _bends(both: Array, times: Array, k: int, gap: int, count: int = 1) -> Array:
    """Distance of curve j = k - gap to the straight way from the curves i = j - 1, j - 2, ... to k.

    Returns:
        (count, 2, 2, 2) by i and the directions, or whichever versions there are, of i, j and k.
    """
    j = k - gap
    i = j - 1 - np.arange(count)
    share = ((times[k] - times[j]) / (times[k] - times[i]))[:, None, None, None, None, None]
    return _rms(
        share * both[i][:, :, None, None] + (1.0 - share) * both[k][None, None, None, :] - both[j][None, None, :, None]
    )


def _rms(offset: Array) -> Array:
    """(..., P, 3) -> (...) root mean square distance."""
    flat = offset.reshape(*offset.shape[:-2], offset.shape[-2] * offset.shape[-1])
    result: Array = np.sqrt(dots(flat, flat) / offset.shape[-2])
    return result


def misfits(curves: Array, times: Array, kept: BoolArray, least: float) -> tuple[Array, Array]:
    """How far curves are from where their neighbours in time say, and how far they may be.

    Of the kept curves, those that are off by more than allowed, and by more than those around them, are dropped until
    none is off: a wrong curve makes those beside it look wrong. In the middle a curve is foretold by the cubic through
    two neighbours on either side, at the ends of the recording by up to three on one.

    Args:
        curves: (F, P, 3) in one direction.
        times: (F,) seconds, increasing.
        kept: (F,) curves to go by.
        least: distance, metres, that a curve may always be off.

    Returns:
        (F,) distance and (F,) allowed, metres: those with more than allowed do not fit.
    """
    kept = kept.copy()
    if kept.sum() < _LEAST:
        return np.where(kept, 0.0, np.inf), np.full(len(kept), least)
    while True:
        off, allowed = _foretold(curves, times, kept, least)
        ratio = np.where(kept, off / allowed, 0.0)
        worst = ratio >= np.array([ratio[max(0, k - 4) : k + 5].max() for k in range(len(ratio))])
        if not (ratio > 1.0).any() or kept.sum() - (worst & (ratio > 1.0)).sum() < _LEAST:
            return off, allowed
        kept &= ~(worst & (ratio > 1.0))


def _foretold(curves: Array, times: Array, kept: BoolArray, least: float) -> tuple[Array, Array]:
    """Distance of every curve to what the kept ones around it say, and what is allowed."""
    places = np.flatnonzero(kept)
    off, noise, unsure, step = (np.zeros(len(curves)) for _ in range(4))
    sided = np.zeros(len(curves), dtype=bool)
    for k in range(len(curves)):
        around, sided[k] = _neighbours(places[places != k], k)
        off[k], noise[k], unsure[k] = _distance(curves, times, k, around)
        speed = max(_farthest(curves[a] - curves[b]) / float(times[b] - times[a]) for a, b in pairwise(around))
        step[k] = speed * np.abs(times[around] - times[k]).min()
    usual = np.full(len(curves), float(np.median((off / noise)[kept & ~sided])))
    if sided.any():
        # Foretelling is harder than filling in: it is judged by how well it works in the middle.
        alike = [_distance(curves, times, k, places[n - 3 : n]) for n, k in enumerate(places.tolist()) if n >= 3]
        usual[sided] = float(np.median([distance / loud for distance, loud, _ in alike]))
    fast = np.where(sided, step, np.maximum(_OF_STEP * step, unsure))
    return off, np.maximum(np.maximum(least, _USUAL * usual * noise), fast)


def _farthest(offset: Array) -> float:
    """(P, 3) -> largest distance: also where a curve is wrong in one place only."""
    return float(np.sqrt(dots(offset, offset).max()))


def _neighbours(others: IntArray, k: int) -> tuple[IntArray, bool]:
    """Two of the others on either side of k, or three on one; and whether all are on one side."""
    at = int(np.searchsorted(others, k))
    if 0 < at < len(others):
        return others[max(0, at - 2) : at + 2], False
    return (others[:3] if at == 0 else others[-3:]), True


def _distance(curves: Array, times: Array, k: int, around: IntArray) -> tuple[float, float, float]:
    """How far curve k is from where others say: by the polynomial in time through all of them.

    Beyond the others, by the nearest of three: the nearest curve, the straight way through two, and the parabola.

    Returns:
        The distance, how much louder than that of a curve its noise is, and how far the polynomial is from the straight
        way between the nearest two.
    """
    t = times[around] - times[k]
    nearest = np.argsort(np.abs(t))
    weights = {count: _weights(t, nearest[:count]) for count in range(1, len(t) + 1)}
    if t[0] < 0.0 < t[-1]:
        after = int(np.searchsorted(t, 0.0))
        straight, best = _weights(t, np.array([after - 1, after])), weights[len(t)]
        unsure = _farthest(np.einsum("k,kpx->px", best - straight, curves[around]))
        weights = {len(t): best}
    else:
        unsure = 0.0
    found = [
        (_farthest(np.einsum("k,kpx->px", row, curves[around]) - curves[k]), float(np.sqrt(1.0 + row @ row)))
        for row in weights.values()
    ]
    return *min(found), unsure


def _weights(t: Array, chosen: IntArray) -> Array:
    """Lagrange's weights at zero for the chosen ones of the times t, zero for the others."""
    weights, near = np.zeros(len(t)), t[chosen]
    for n, k in enumerate(chosen):
        others = np.delete(near, n)
        weights[k] = np.prod(others / (others - near[n]))
    return weights
