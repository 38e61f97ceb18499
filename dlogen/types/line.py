"""The skeleton line and what leads to it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from dlogen.types.arrays import Array, BoolArray, IntArray
from dlogen.types.intermediate import Intermediate
from dlogen.types.quality import Finding, Uncertainty
from dlogen.types.short_repr import ShortRepr

#: How far beyond 0 and 1 a coordinate may be.
_ROUNDING = 1e-9


class Basis(Protocol):
    """N functions of s in [0, 1]."""

    @property
    def size(self) -> int:
        """N."""
        ...

    @property
    def margin(self) -> float:
        """Stretch of s at either end where the functions, not the data, make the curvature."""
        ...

    def __call__(self, s: Array, derivative: int = 0) -> Array:
        """Values, or derivatives with respect to s, of all functions: (K,) -> (K, N)."""
        ...

    def combine(self, s: Array, weights: Array, derivative: int = 0) -> Array:
        """The weighted sum of the functions (Eq. 7) or its derivative: (K,), (N, 3) -> (K, 3)."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Everything needed to evaluate the basis again."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class SortedPoints(ShortRepr):
    """Projected points in their order along the object (the paper's P_s and s_s).

    Attributes:
        index: (K,) indices into the stage's input, in order along the object; K <= M.
        s: (K,) material coordinate in [0, 1], non-decreasing.
        length: length of the walk, metres.
        unreached: (M - K,) indices of points that the walk did not reach.
    """

    index: IntArray
    s: Array
    length: float
    unreached: IntArray


@dataclass(frozen=True, eq=False, repr=False)
class Skeleton(ShortRepr):
    """The skeleton line f(s) = sum_j W_j phi_j(s) + offset, s in [0, 1] (paper III.C, Eq. 7).

    Attributes:
        basis: the basis functions phi_j.
        weights: (N, 3) the paper's W, metres.
        offset: (3,) a constant added to the sum, metres. It keeps the sum accurate far from the origin.
        length: arc length, metres.

    >>> import dlogen
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> result.skeleton(0.5).shape, result.skeleton(0.5, derivative=1).shape
    ((3,), (3,))
    >>> bool(abs(result.skeleton.length - 4.84) < 0.01)
    True
    """

    basis: Basis
    weights: Array
    offset: Array
    length: float

    def __call__(self, s: npt.ArrayLike, derivative: int = 0) -> Array:
        """f(s), or its derivative with respect to s.

        Args:
            s: a coordinate in [0, 1], or (K,) of them.
            derivative: 0 to 3.

        Returns:
            (3,) or (K, 3), metres.

        Raises:
            ValueError: a coordinate outside of [0, 1].

        >>> import dlogen
        >>> line = dlogen.fit(dlogen.synth("straight", points=2000, seed=1).points).skeleton
        >>> line(0.5).shape, line([0.0, 0.5, 1.0]).shape
        ((3,), (3, 3))
        >>> line(1.5)
        Traceback (most recent call last):
        ...
        ValueError: the skeleton line is defined for s from 0 to 1, not at 1.5
        """
        places = np.asarray(s, dtype=float)
        along = np.atleast_1d(places)
        # Rounding may lead a little beyond the ends.
        if along.size and not (along.min() >= -_ROUNDING and along.max() <= 1.0 + _ROUNDING):
            wrong = along[~((along >= -_ROUNDING) & (along <= 1.0 + _ROUNDING))][0]
            raise ValueError(f"the skeleton line is defined for s from 0 to 1, not at {wrong:g}")
        value = self.basis.combine(along, self.weights, derivative)
        value = value + self.offset if derivative == 0 else value
        return value if places.ndim else value[0]


@dataclass(frozen=True, eq=False, repr=False)
class FittedLine(ShortRepr):
    """A skeleton line with what a profile knows of it.

    Attributes:
        skeleton: the line.
        radius: of the object, metres.
        distance: (M,) distance of the cloud's points to the line, metres.
        on_tube: (M,) which of them count as points of the tube.
        intermediates: what the profile's stages made of the points, in their order.
        findings: what they found.
        chosen: what they chose by themselves, by the dotted key of the configuration.
        regime: what of the object shows: "surface", "strand" (its width, but no depth) or "thread" (not even that).
        uncertainty: how well the line is known along it, if that is known.
    """

    skeleton: Skeleton
    radius: float
    distance: Array
    on_tube: BoolArray
    intermediates: tuple[Intermediate, ...]
    findings: tuple[Finding, ...]
    chosen: dict[str, Any] = field(default_factory=dict)
    regime: str = "surface"
    uncertainty: Uncertainty | None = None
