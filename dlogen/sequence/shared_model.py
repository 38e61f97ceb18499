"""One model for all captures: which ones to believe, what they have in common, and a chain of rigid links for each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dlogen.config.defaults import R_PER_E_MAX
from dlogen.config.fields import AUTO
from dlogen.config.sections import Segmentation
from dlogen.errors import FitError
from dlogen.geometry.vectors import dots
from dlogen.sequence.captures import CaptureFit
from dlogen.sequence.interpolation import filled_in, smoothed
from dlogen.sequence.orientation import directions, hidden_ends, misfits, unclear_directions
from dlogen.sequence.outliers import Exclusion, Sizes, common_sizes, exclusion_by_size
from dlogen.sequence.reasons import DIRECTION, DOUBTFUL, FAILED, LENGTH, MOTION, RADIUS, SIZES
from dlogen.sequence.rigid_links import Shape, deviations, equal_links, fewest_links, fit_links, links_of_length
from dlogen.stages.segmentation.segment_length import max_segment_length
from dlogen.types import Array, BoolArray

#: More links than any simulator takes.
_MOST_LINKS = 2000

#: Points of a curve by which its direction is found, and by which it is compared with its neighbours in time.
_DIRECTED, _COMPARED = 16, 76

#: Shares of what is missing in length that may be missing at the beginning of a curve.
_AT_START = np.array([0.5, 0.0, 1.0])

#: Bends are measured over this many of the thousand points of a curve, to either side.
_STENCIL = 10


@dataclass(frozen=True)
class Bend:
    """The tightest bend of a recording: its radius in metres, the capture and the place in [0, 1]."""

    radius: float
    capture: int
    s: float


@dataclass(frozen=True)
class Doubt:
    """What may be wrong with the model or the motion as a whole.

    Attributes:
        code: "sizes" (the captures are not those of one object) or "direction" (which end is first may change).
        message: one sentence, with numbers.
        capture: from which on; None if it is about all.
    """

    code: str
    message: str
    capture: int | None = None


@dataclass(frozen=True, eq=False)
class SharedModel:
    """One object in several captures.

    Attributes:
        captures: F captures as their own fits have them.
        exclusions: (F) why a capture is excluded; None for good ones.
        sizes: what the good captures have in common.
        criterion: what decided on the links: "fewest", "paper", "segments", "segment_length" or "bend_radius".
        e_max: largest deviation allowed, metres.
        links: (n,) link lengths, metres.
        reverse: (F,) whether the capture's own curve runs the other way.
        joints: (F, n + 1, 3) metres; NaN for captures that have no chain.
        deviation: (F,) largest distance between a capture's curve and its chain, metres; NaN where it is excluded.
        bend: the tightest one of the good captures.
        reference: the good capture that is bent the least at its joints.
        doubts: about all of it.
    """

    captures: tuple[CaptureFit, ...]
    exclusions: tuple[Exclusion | None, ...]
    sizes: Sizes
    criterion: str
    e_max: float
    links: Array
    reverse: BoolArray
    joints: Array
    deviation: Array
    bend: Bend
    reference: int
    doubts: tuple[Doubt, ...] = ()

    @property
    def good(self) -> BoolArray:
        """(F,) captures that are not excluded."""
        return np.array([exclusion is None for exclusion in self.exclusions])


def shared_model(
    captures: Sequence[CaptureFit],
    times: Array | None = None,
    *,
    segmentation: Segmentation | None = None,
    e_max: float | None = None,
    smooth: bool = False,
) -> SharedModel:
    """The model that all captures share, and its chain in each.

    Args:
        captures: those of the object; in the order of time, if there is one.
        times: (F,) seconds, increasing. With them, the same end is first in all captures by their motion, those that
            do not fit between their neighbours are excluded, and those that are excluded get a chain from the ones
            around them. Without, directions are those in which the ends are nearest to those of the first good capture.
        segmentation: how long the links are; see `dlogen.config.sections`. Joints are material points beside the curve,
            whatever its `placement`.
        e_max: largest distance allowed between the curve of a good capture and its chain, metres; half of the radius by
            default.
        smooth: even out the noise from capture to capture; see `dlogen.sequence.interpolation.smoothed`.

    Raises:
        FitError: no capture can be believed, or there would be more than 2000 links.
    """
    exclusions = [
        Exclusion((DOUBTFUL if item.points is not None else FAILED).code, item.problem) if item.problem else None
        for item in captures
    ]
    sizes = common_sizes(captures, _good(exclusions, captures))
    for k, item in enumerate(captures):
        exclusions[k] = exclusions[k] or exclusion_by_size(item, sizes)
    doubts = _of_sizes(captures, exclusions, sizes)
    used = np.flatnonzero(_good(exclusions, captures)).tolist()
    shape = _shape([captures[k] for k in used], sizes.length.value)
    reverse = np.zeros(len(captures), dtype=bool)
    if times is None:
        reverse[used] = _nearest_ends(shape.points(np.array([0.0, sizes.length.value])))
    else:
        reverse[used], wrong = _by_motion(shape, times[used], sizes.radius.value)
        for k, exclusion in zip(used, wrong, strict=True):
            exclusions[k] = exclusion
    sizes = common_sizes(captures, _good(exclusions, captures))
    good = np.flatnonzero(_good(exclusions, captures)).tolist()
    shape = _shape([captures[k] for k in good], sizes.length.value, reverse[good])
    if times is not None:
        doubts += _of_directions(captures, good, shape, times)
        shape = _with_hidden_ends(shape, times[good], 3.0 * sizes.length.spread)

    e_max = sizes.radius.value / R_PER_E_MAX if e_max is None else e_max
    radius, which, s = _tightest(shape)
    criterion, links = _links(shape, e_max, radius, segmentation or Segmentation())
    fitted = fit_links(shape, links)
    if smooth and times is not None:
        # Both ends make the noise of the length.
        fitted = smoothed(fitted, links, times[good], 2.0 * sizes.length.spread)
    joints = np.full((len(captures), len(links) + 1, 3), np.nan)
    joints[good] = fitted
    deviation = np.full(len(captures), np.nan)
    deviation[good] = deviations(shape, fitted, links)
    if times is not None:
        joints = filled_in(joints, links, times, _good(exclusions, captures))
    edges = np.diff(fitted, axis=1) / links[:, None]
    bends = 1.0 - dots(edges[:, 1:], edges[:, :-1])
    return SharedModel(
        captures=tuple(captures),
        exclusions=tuple(exclusions),
        sizes=sizes,
        criterion=criterion,
        e_max=e_max,
        links=links,
        reverse=reverse,
        joints=joints,
        deviation=deviation,
        bend=Bend(radius, int(good[which]), s),
        reference=int(good[np.argmin(bends.max(axis=1, initial=0.0))]),
        doubts=tuple(doubts),
    )


def _of_sizes(captures: Sequence[CaptureFit], exclusions: Sequence[Exclusion | None], sizes: Sizes) -> list[Doubt]:
    """That the sizes are not those of one object: what they scatter about may be the size of none."""
    believed = [item for item in captures if item.problem is None]
    within = sum(exclusion is None for exclusion in exclusions)
    if len(believed) < 2 or (sizes.length.agreed and sizes.radius.agreed and 2 * within > len(believed)):
        return []
    codes = Counter(exclusion.code for exclusion in exclusions if exclusion is not None)
    what = (
        "radius" if codes[RADIUS.code] > codes[LENGTH.code] or sizes.length.agreed > sizes.radius.agreed else "length"
    )
    values, usual = [getattr(item, what) for item in believed], getattr(sizes, what).value
    return [
        Doubt(
            SIZES.code,
            f"{'radii' if what == 'radius' else 'lengths'} differ, {min(values):.4g} to {max(values):.4g} m, and only "
            f"{within} of {len(believed)} go by {usual:.4g} m: is it one object, and is all of it in view?",
        )
    ]


def _of_directions(captures: Sequence[CaptureFit], good: list[int], shape: Shape, times: Array) -> list[Doubt]:
    places = np.linspace(0.0, shape.length, _DIRECTED)
    return [
        Doubt(
            DIRECTION.code,
            f"which end is first may be wrong from {captures[good[k]].name} on: the motion since "
            f"{captures[good[k - 1]].name} is about as smooth the other way round",
            good[k],
        )
        for k in unclear_directions(shape.points(places), times[good]).tolist()
    ]


def _good(exclusions: Sequence[Exclusion | None], captures: Sequence[CaptureFit]) -> BoolArray:
    """(F,) which captures are not excluded.

    Raises:
        FitError: all are.
    """
    good = np.array([exclusion is None for exclusion in exclusions])
    if not good.any():
        counts = Counter(exclusion.code for exclusion in exclusions if exclusion is not None)
        said = ", ".join(f"{count} {code}" for code, count in counts.most_common())
        first = next((f"{item.name}: {item.problem}" for item in captures if item.problem), "")
        raise FitError(
            f"no frame can be believed: {said or 'there is none'}" + (f"; {first}" if first else ""),
            "try dlogen fit on one of them; dlogen sequence --keep-doubtful goes by doubtful ones as well",
            stage="sequence",
        )
    return good


def _shape(captures: Sequence[CaptureFit], length: float, reverse: BoolArray | None = None) -> Shape:
    """Curves, each with half of what it lacks in length at either end."""
    curves = np.array([item.points for item in captures])
    if reverse is not None:
        curves[reverse] = curves[reverse][:, ::-1]
    lengths = np.array([item.length for item in captures])
    return Shape(curves, lengths, length, 0.5 * (length - lengths))


def _by_motion(shape: Shape, times: Array, radius: float) -> tuple[BoolArray, list[Exclusion | None]]:
    """Which curves to reverse, and which do not fit between their neighbours in time."""
    compared = shape.points(np.linspace(0.0, shape.length, _COMPARED))
    # Every fifth, both ends among them.
    reverse, kept = directions(compared[:, :: (_COMPARED - 1) // (_DIRECTED - 1)], times, radius)
    compared[reverse] = compared[reverse][:, ::-1]
    off, allowed = misfits(compared, times, kept, radius)
    exclusions = [
        Exclusion(MOTION.code, f"{1e3 * far:.1f} mm from where its neighbours in time say (allowed {1e3 * most:.1f})")
        if far > most
        else None
        for far, most in zip(off, allowed, strict=True)
    ]
    return reverse, exclusions


def _with_hidden_ends(shape: Shape, times: Array, noise: float) -> Shape:
    """The same curves, with what is missing in length where their motion says: at one end, the other, or half at each.

    Only where more is missing, or too much, than noise explains: what noise adds or takes away is the same at both ends
    on average.
    """
    lack = shape.length - shape.lengths
    places = np.linspace(0.0, shape.length, _DIRECTED)
    starts = np.where(np.abs(lack)[:, None] > noise, lack[:, None] * _AT_START, 0.5 * lack[:, None])
    variants = [Shape(shape.curves, shape.lengths, shape.length, start).points(places) for start in starts.T]
    choice = hidden_ends(np.stack(variants, axis=1), times)
    return Shape(shape.curves, shape.lengths, shape.length, starts[np.arange(len(lack)), choice])


def _nearest_ends(curves: Array) -> BoolArray:
    """Which curves to reverse so that their ends are nearest to those of the first: (F, P, 3) -> (F,)."""
    first = curves[0, [0, -1]]
    same, other = (np.linalg.norm(curves[:, ends] - first, axis=2).sum(axis=1) for ends in ([0, -1], [-1, 0]))
    result: BoolArray = other < same
    return result


def _tightest(shape: Shape) -> tuple[float, int, float]:
    """Smallest radius of curvature in all curves, the curve and where on the object."""
    curves, last = shape.curves, shape.curves.shape[1] - 1
    reach = min(_STENCIL, last // 2)
    bent = curves[:, 2 * reach :] - 2.0 * curves[:, reach:-reach] + curves[:, : -2 * reach]
    curvature = np.linalg.norm(bent, axis=2) / (reach * shape.lengths[:, None] / last) ** 2
    which, i = (int(index) for index in np.unravel_index(np.argmax(curvature), curvature.shape))
    most = float(curvature[which, i])
    s = (shape.start[which] + shape.lengths[which] * (i + reach) / last) / shape.length
    return (1.0 / most if most > 0.0 else np.inf), which, float(s)


def _links(shape: Shape, e_max: float, radius: float, segmentation: Segmentation) -> tuple[str, Array]:
    """What decides on the links, and their lengths.

    Raises:
        FitError: there would be too many.
    """
    length = shape.length
    known = [1.0 / segmentation.curvature_max] if segmentation.curvature_max != AUTO else []
    known += [segmentation.min_bend_radius] if segmentation.min_bend_radius != AUTO else []
    if segmentation.segments != AUTO:
        return "segments", equal_links(length, segmentation.segments)
    if segmentation.segment_length != AUTO:
        criterion, link = "segment_length", segmentation.segment_length
    elif known:
        criterion, link = "bend_radius", max_segment_length(e_max, known[0])
    elif segmentation.criterion == "paper":
        criterion, link = "paper", max_segment_length(e_max, radius)
    else:
        count = fewest_links(shape, e_max, _MOST_LINKS)
        if count is not None:
            return "fewest", equal_links(length, count)
        criterion, link = "fewest", 0.0
    if link * _MOST_LINKS < length:
        raise FitError(
            f"e_max = {e_max:g} m takes more than {_MOST_LINKS} segments"
            if criterion != "segment_length"
            else f"segments of {link:g} m are more than {_MOST_LINKS} of them",
            "raise e_max" if criterion != "segment_length" else "raise segmentation.segment_length",
            stage="sequence",
        )
    return criterion, links_of_length(length, min(link, length))
