"""The steps in which a cloud's coordinates are stored: few digits far from the origin, and grids of voxels.

A file of single precision keeps 24 bits: at survey coordinates of 5e6 m they are half a metre apart. The centres of
voxels mark cells that the surface touches anywhere, so that a tube seems thicker than it is.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dlogen.errors import FitError
from dlogen.geometry.sampling import spatial_sample
from dlogen.stages.quality.findings import COARSE_GRID, FEW_DIGITS, NOT_ROUND
from dlogen.types import Array, BoolArray, Finding
from dlogen.types.texts import millimetres

#: Size of the subset that tells the steps.
_LOOKED_AT = 20_000
#: Steps are no shorter than this share of the extent: below it, they do not matter.
_LEAST = 1e-5
#: Differences that are multiples of the step, within this share of it, and how many have to be.
_WHOLE, _NEARLY_ALL = 0.02, 0.98
#: Points for each value that a coordinate has, at least: without two of them in one place there is no step.
_SHARED = 1.2
#: Coordinates that are so many extents from the origin are far away from it, and the digits of single precision.
_FAR, _SINGLE = 20.0, 2.0**24
#: Steps over the radius that are worth a note, that leave the radius doubtful, and that leave nothing.
_NOTED, _DOUBTFUL, _LOST = 0.1, 0.45, 1.5
#: Of a cloud that is no more than so many steps large nothing is left.
_HOPELESS = 40.0
#: Few digits round points along an axis that lies anyhow to the object: they spoil it sooner.
_SPOILT = 0.3
#: Steps of a grid are alike within this share.
_ALIKE = 0.02


@dataclass(frozen=True, eq=False)
class Steps:
    """The steps of coordinates, in the cloud's own numbers.

    Attributes:
        along: (3,) the step on each axis; 0 where there is none that matters.
        varying: (3,) whether an axis has several values.
        farthest: (3,) the largest coordinate on each axis, without its sign.
        few_digits: whether the numbers are so large that their digits do not suffice.
    """

    along: Array
    varying: BoolArray
    farthest: Array
    few_digits: bool

    @property
    def largest(self) -> float:
        """The longest step."""
        return float(self.along.max())

    @property
    def is_grid(self) -> bool:
        """Whether all axes have the same step, as voxels have."""
        along = self.along[self.varying]
        return len(along) > 1 and bool(along.min() > (1.0 - _ALIKE) * along.max() > 0.0)

    def check(self, points: Array, scale: float) -> None:
        """Refuse clouds of which rounding left nothing.

        Args:
            points: (M, 3) the cloud.
            scale: metres in one of its numbers.

        Raises:
            FitError: the steps are long beside the whole cloud.
        """
        if self.few_digits and self.largest > float(np.ptp(points, axis=0).max()) / _HOPELESS:
            message, _, hint = self.said(scale).partition(": ")
            raise FitError(f"no chain can be made of this cloud: {message}", hint, stage="input")

    @contextlib.contextmanager
    def blamed(self, scale: float) -> Iterator[None]:
        """Where coordinates have few digits, that is why what is done inside fails.

        Args:
            scale: metres in one of the cloud's numbers.

        Raises:
            FitError: the one that was raised inside, with that reason.
        """
        try:
            yield
        except FitError as error:
            if not self.few_digits:
                raise
            message, _, hint = self.said(scale).partition(": ")
            raise FitError(f"{error.message}; {message}", hint, stage=error.stage) from error

    def said(self, scale: float) -> str:
        """What is wrong with few digits: `scale` is metres in one of the cloud's numbers."""
        axis = int(np.argmax(self.along))
        single = self.farthest[axis] / self.along[axis] > 0.4 * _SINGLE
        why = "which is all that single precision (float) has there" if single else "with too few digits"
        what = f"{'xyz'[axis]} is stored in steps of {millimetres(scale * self.largest)} at {self.farthest[axis]:.3g}"
        return f"{what}, {why}: export the cloud with double precision, or nearer to the origin"


def coordinate_steps(points: Array) -> Steps:
    """The steps in which coordinates are stored.

    Args:
        points: (M, 3) finite, in the cloud's own numbers, not moved.
    """
    sample = points[spatial_sample(points, _LOOKED_AT)]
    extent = float(np.ptp(sample, axis=0).max())
    along = np.array([_step(column, extent) for column in sample.T])
    varying = np.ptp(sample, axis=0) > 0.0
    farthest = np.abs(sample).max(axis=0)
    # What rounding made flat has one value.
    with np.errstate(over="ignore", invalid="ignore"):
        single = np.spacing(farthest.astype(np.float32)).astype(np.float64)
    along = np.where(~varying & (single > extent / _HOPELESS), single, along)
    far = (along > 0.0) & (farthest > _FAR * extent) & (farthest < 1.01 * _SINGLE * np.maximum(along, 1e-300))
    return Steps(along, varying, farthest, bool(far.any()))


def _step(values: Array, extent: float) -> float:
    """The step that all differences of values are multiples of; 0 where there is none."""
    different = np.unique(values)
    apart = np.diff(different)
    apart = apart[apart > _LEAST * extent]
    if len(apart) < 1 or len(values) < _SHARED * (len(apart) + 1):
        return 0.0
    least = float(apart.min())
    multiples = np.round(apart / least)
    step = float(np.median(apart / multiples))
    whole = np.abs(apart / step - np.round(apart / step)) < _WHOLE
    return step if whole.mean() >= _NEARLY_ALL else 0.0


def without_those_of_the_grid(findings: Iterable[Finding], steps: Steps, scale: float, radius: float) -> list[Finding]:
    """Findings without those that a grid of points makes: cross-sections on one are not round, whatever the object is.

    Args:
        findings: about the line.
        steps, scale, radius: as in `check_steps`.
    """
    coarse = steps.is_grid and scale * steps.largest > _NOTED * radius
    return [item for item in findings if not (coarse and NOT_ROUND.matches(item))]


def check_steps(steps: Steps, scale: float, radius: float) -> list[Finding]:
    """Whether the steps of the coordinates are too long for an object.

    Args:
        steps: of the cloud.
        scale: metres in one of its numbers.
        radius: of the object, metres.
    """
    share = scale * steps.largest / radius
    if share <= _NOTED:
        return []
    if steps.few_digits:
        message = f"{steps.said(scale)} ({100 * share:.0f} % of the radius)"
        return [FEW_DIGITS.found(message, "note" if share <= _SPOILT else "doubtful" if share <= _LOST else "bad")]
    if not steps.is_grid:
        return []
    step = millimetres(scale * steps.largest)
    message = f"the points lie on a grid with a step of {step}, {100 * share:.0f} % of the radius"
    if share <= _DOUBTFUL:
        return [COARSE_GRID.found(message, "note")]
    return [COARSE_GRID.found(f"{message}: the object seems thicker than it is", "doubtful")]
